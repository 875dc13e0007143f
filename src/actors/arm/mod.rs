//! The arm and those who drive it: the simulation, inverse kinematics, goals, paths and timed trials.
//!
//! **Invariant:** the arm is stepped in one place, `sim`; the others ask it by messages.

pub mod follow;
pub mod ik;
pub mod ik_action;
pub mod ik_trial;
pub mod sim;
