//! The arm and the nodes that drive it: simulation, goals, paths and timed trials.
//!
//! **Invariant:** only `sim` steps the arm. The others send it messages.

pub mod follow;
pub mod ik_action;
pub mod ik_trial;
pub mod sim;
