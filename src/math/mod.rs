//! The physics and the control of the arm: plain values and pure functions that get the time.
//!
//! Kinematics and the study take elementary functions from `libm`. They have the same bits on every platform, unlike
//! those of the standard library.
//!
//! **Invariant:** this module uses no clock, no I/O, no JSON, no threads and no actors.

pub mod arm;
pub mod count;
pub mod dynamics;
pub mod expression;
pub mod goal;
pub mod integrator;
pub mod kinematics;
pub mod limits;
pub mod number;
pub mod pacer;
pub mod particle;
pub mod pid;
pub mod sensors;
pub(crate) mod shown;
pub mod simulation;
pub mod trajectory;
pub mod trial;
pub mod trig;
