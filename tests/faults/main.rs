//! Panics. These tests have their own process, because the panic hook belongs to the process.

#![allow(
    dead_code,
    reason = "test programs that share helpers need not use every part"
)]

mod panics;
#[path = "../support/system.rs"]
mod system;
#[path = "../support/virtual_time.rs"]
mod virtual_time;
