//! Shared resources of all nodes: counted memory, measured work time, and threads for long work.
//!
//! **Invariant:** nothing here imports a node, so every node can use it.

pub mod gauges;
pub mod long_work;
pub mod memory;
pub mod priority;
pub mod turns;
pub mod work_clock;
