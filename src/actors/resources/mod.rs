//! Shared resources: places, counted memory, gauges, turns, measured work time, threads for long work, and the operating
//! system's sockets and files.
//!
//! **Invariant:** nothing here imports a node, so every node can use it.

pub mod gauges;
pub mod gone;
pub mod listening;
pub mod long_work;
pub mod memory;
pub mod open_files;
pub mod places;
pub mod priority;
pub mod turns;
pub mod unread;
pub mod work_clock;
