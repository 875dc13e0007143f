//! The study: the effect of method and timestep on the arm, predicted and measured.
//!
//! Everything steps through [`crate::math`], the live arm's own code.
//!
//! **Invariant:** pure: no clock, no I/O, no JSON, no threads; every computation is bounded when it is made.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays and matrices of that size, as they do in the formulas"
)]

pub mod beside;
pub mod clocks;
pub mod continuous;
pub mod control_loop;
mod critical;
pub mod encoder;
pub(crate) mod equilibrium;
pub mod error_estimate;
pub mod fewest;
pub mod gains;
pub mod held_loop;
mod limits;
pub mod linear;
pub mod matrix;
pub mod method;
pub mod motion;
mod own_run;
pub mod paused;
pub mod planner;
mod poses;
mod proof;
pub mod rollout;
mod slow_modes;
pub mod stability;
pub mod tableau;
pub mod taylor;
