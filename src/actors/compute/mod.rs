//! Work that takes longer than a turn of an actor: the computations and the long frames of each client, a pool of
//! workers, and the services that compute on it.
//!
//! **Invariant:** nothing here blocks an actor's thread for longer than a slice.

pub mod computations;
pub mod long_frames;
pub mod study;
pub mod workers;
