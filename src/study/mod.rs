//! The study: the effect of method and timestep on the arm, predicted and measured.
//!
//! Everything steps through [`crate::math`], the live arm's own code. Long computations are `async`, so that a caller can
//! do them in pieces. [`paused::at_once`] does one at once:
//!
//! ```
//! use pendularm::math::arm::{Arm, State};
//! use pendularm::study::control_loop::ControlLoop;
//! use pendularm::study::paused::at_once;
//! use pendularm::study::rollout::{RolloutRequest, rollout};
//! use pendularm::study::stability::limits;
//!
//! let swing = ControlLoop::free(Arm::<2>::default()); // Runge-Kutta 4 at 1 ms
//! let start = State::at_rest([0.4, -0.3]);
//! let request = RolloutRequest { control: swing, start, duration: 1.0, samples: 101, reference: true };
//! let run = at_once(rollout(request))?;
//! assert!(run.deviation.is_some_and(|it| it.error < 1e-6), "rad from the true motion");
//! assert!(limits(&swing).held.is_some_and(|timestep| timestep > 0.01));
//! # Ok::<(), pendularm::study::rollout::RolloutError>(())
//! ```
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
