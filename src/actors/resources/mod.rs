//! Shared resources of all nodes: counted memory, measured work time, threads for long work, and questions to the
//! operating system.
//!
//! **Invariant:** nothing here imports a node, so every node can use it.

pub mod gauges;
pub mod long_work;
pub mod memory;
pub mod open_files;
pub mod priority;
pub mod turns;
pub mod unread;
pub mod work_clock;
