//! The measurements of the report: experiments on the arm that the running service has no use for.
//!
//! | module | answers |
//! | --- | --- |
//! | [`measure`] | the largest stable timestep and the growth per control period, measured on the arm itself |
//! | [`scenarios`] | named stiff and extreme scenes, each with its expected verdict and the observed one |
//! | [`reference`](mod@reference) | the true motion, with twice the digits and a bound on its own error |
//! | [`task`] | error and cost of a run of a motion by any solver |
//! | [`error`](mod@error) | error against evaluations for all methods in the same scenes |
//! | [`conditioning`] | digits lost in the accelerations of arms with uneven masses |
//! | [`budget`] | truncation, rounding and control hold, apart |
//! | [`step_scene`] | the arm whose steps are timed and counted |
//! | [`chaos`] | separation from the reference, and what becomes of the energy |
//! | [`stiff`] | the cost of an error by stiffness, beside implicit baselines |
//! | [`nonlinear`] | which moves and swings a timestep carries, and what becomes of deviations from a periodic swing |
//!
//! Everything steps through [`crate::math`], the live arm's own code, and is compared with [`crate::study`]'s
//! predictions.
//!
//! **Invariant:** pure: no clock, no I/O, no JSON, no threads; every computation is bounded when it is made.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays and matrices of that size, as they do in the formulas"
)]

pub mod budget;
pub mod chaos;
pub mod conditioning;
pub mod error;
pub mod measure;
pub mod nonlinear;
pub mod reference;
pub mod scenarios;
pub mod step_scene;
pub mod stiff;
pub mod task;
