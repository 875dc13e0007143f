//! The nodes in virtual time: their messages, the receivers and the times.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    clippy::expect_used,
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::needless_pass_by_value,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "a test that panics has failed, and may say what it saw; numbers that are compared, written or cast exactly are exact; \
              helpers are handed values that were made for them, and binaries that share them need not use every part"
)]

mod admission;
mod arm_steps;
mod arm_turns;
#[path = "../support/askers.rs"]
mod askers;
mod by_hand;
mod connection;
mod encodings;
mod endings;
mod exchanges;
mod ik;
mod ik_action;
mod ik_trial;
mod integration;
mod kernel;
mod listener;
mod log_repeats;
mod memory;
#[path = "../support/nodes.rs"]
mod nodes;
mod pacing;
#[cfg(feature = "record")]
mod recorder;
mod refusals;
mod registrations;
mod registry;
#[cfg(feature = "record")]
mod replay;
mod rosapi;
mod slow;
#[path = "../support/stage.rs"]
mod stage;
mod study;
#[path = "../support/system.rs"]
mod system;
#[path = "../support/virtual_time.rs"]
mod virtual_time;
mod web;
