//! The physics and the control of the arm: plain values and pure functions that get the time.
//!
//! **Invariant:** this module uses no clock, no I/O, no JSON, no threads and no actors.

pub mod arm;
pub mod count;
pub mod dynamics;
pub(crate) mod elementary;
pub mod expression;
pub mod goal;
pub mod integrator;
pub mod kinematics;
pub mod number;
pub mod pacer;
pub mod particle;
pub mod pid;
pub(crate) mod shown;
pub mod simulation;
pub mod trajectory;
pub mod trial;
pub mod trig;
