//! The study: what method and timestep do to the arm, predicted and measured.
//!
//! | module | answers |
//! | --- | --- |
//! | [`stability`] | the largest stable timestep, predicted from the linearised loop ([`linear`], [`matrix`]) |
//! | [`measure`] | the same, measured on the arm itself |
//! | [`growth`] | growth per control period, measured |
//! | [`scenarios`] | named stiff and extreme scenes, each with its expected verdict and the observed one |
//! | [`reference`](mod@reference) | the true motion, with twice the digits and a bound on its own error |
//! | [`error`](mod@error) | error against evaluations for all methods in the same scenes |
//! | [`conditioning`] | digits lost in the accelerations of arms with uneven masses |
//! | [`budget`] | truncation, rounding and control hold, apart |
//! | [`chaos`] | how far a chaotic swing can be followed, and what becomes of its energy |
//! | [`rollout`] | an offline run with its error against a reference ([`extrapolation`]) |
//! | [`error_estimate`] | the local error of the step about to be taken |
//!
//! Everything steps through [`crate::math`], the live arm's own code.
//!
//! **Invariant:** pure: no clock, no I/O, no JSON, no threads; every computation is bounded when it is made.

pub mod budget;
pub mod chaos;
pub mod conditioning;
pub mod error;
pub mod error_estimate;
pub mod extrapolation;
pub mod growth;
mod limits;
pub mod linear;
pub mod matrix;
pub mod measure;
mod poses;
pub mod reference;
pub mod rollout;
pub mod scenarios;
pub mod stability;
