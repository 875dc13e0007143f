//! The study: the effect of method and timestep on the arm, predicted and measured.
//!
//! | module | answers |
//! | --- | --- |
//! | [`stability`] | the largest stable timestep, by the linearised loop ([`linear`], [`matrix`]) |
//! | [`motion`] | the largest timestep of a motion |
//! | [`clocks`] | the largest stable control period, and the largest stable timestep at a control period |
//! | [`control_loop`] | the loop that all of these speak of, and how it is stepped |
//! | [`continuous`] | the same loop with its law in every stage |
//! | [`gains`] | gains for an arm and a timestep, stable in every pose, that settle in time |
//! | [`fewest`] | the fewest steps with which a run is good enough |
//! | [`planner`] | the cheapest method and timestep for an allowed error at the end effector |
//! | [`rollout`] | an offline run with its error against a reference ([`taylor`]) |
//! | [`paused`] | long computations, a piece at a time |
//! | [`error_estimate`] | the local error of the step about to be taken |
//!
//! Everything steps through [`crate::math`], the live arm's own code.
//!
//! **Invariant:** pure: no clock, no I/O, no JSON, no threads; every computation is bounded when it is made.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays and matrices of that size, as they do in the formulas"
)]

pub(crate) mod beside;
pub mod clocks;
pub mod continuous;
pub mod control_loop;
mod critical;
mod equilibrium;
pub mod error_estimate;
pub mod fewest;
pub mod gains;
mod limits;
pub mod linear;
pub mod matrix;
pub mod motion;
pub mod paused;
pub mod planner;
mod poses;
mod proof;
pub mod rollout;
mod slow_modes;
pub mod stability;
mod symmetric;
pub mod taylor;
