//! Panics. They have a process of their own, since a panic hook is the whole process's.

#![allow(
    dead_code,
    reason = "test programs that share helpers need not use every part"
)]

mod panics;
#[path = "../support/system.rs"]
mod system;
#[path = "../support/virtual_time.rs"]
mod virtual_time;
