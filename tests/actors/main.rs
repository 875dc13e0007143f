//! The nodes in virtual time: their messages, the receivers and the times.

#![allow(
    dead_code,
    reason = "test programs that share helpers need not use every part"
)]

mod arm_rest;
mod arm_steps;
mod arm_turns;
#[path = "../support/askers.rs"]
mod askers;
mod by_hand;
mod connection;
mod endings;
mod exchanges;
#[cfg(feature = "web")]
#[path = "../support/folder.rs"]
mod folder;
mod ik_action;
mod ik_trial;
mod kernel;
mod listener;
mod log_repeats;
mod memory;
mod pacing;
#[cfg(feature = "record")]
mod recorder;
mod refusals;
mod registry;
#[cfg(feature = "record")]
mod replay;
#[path = "../support/stage.rs"]
mod stage;
mod study;
#[path = "../support/system.rs"]
mod system;
#[path = "../support/virtual_time.rs"]
mod virtual_time;
mod web;
