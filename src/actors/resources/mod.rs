//! The machine that all nodes share: memory, which is counted, time for work, which is measured, and threads for work
//! that takes long.
//!
//! **Invariant:** nothing in here imports a node, so that every node can use it.

pub mod aside;
pub mod gauges;
pub mod memory;
pub mod priority;
pub mod work_clock;
