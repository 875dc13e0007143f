//! The measurements of the report: experiments on the arm that the running service has no use for.
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
pub mod design;
pub mod error;
pub mod measure;
pub mod nonlinear;
pub mod reference;
pub mod scenarios;
pub mod solvers;
pub mod stiff;
pub mod task;
