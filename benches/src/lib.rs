//! The part that several of these programs share: clients, the program as a process, and the attacks.

pub mod attack;
pub mod healthy;
pub mod program;
pub mod protocol;
pub mod random;
#[cfg(feature = "library")]
pub mod step_scene;
