//! The study: what a method, a timestep and a control law cost, and where they go wrong.
//!
//! Uses `math` and nothing else, the same stepper as the live arm.
//!
//! **Invariant:** no clock, no I/O, no JSON, no threads, no actors in here.

pub mod budget;
pub mod chaos;
pub mod error;
pub mod reference;
