//! The study of method and timestep: limits, references, scenes, and the report that shows them.

#![allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    dead_code,
    unreachable_pub,
    reason = "a test that panics has failed; compared and cast numbers are exact; programs share their helpers"
)]

mod clocks;
mod drawing;
mod encoder;
mod equilibrium;
mod error;
mod experiments;
mod fewest;
#[cfg(feature = "report")]
#[path = "../support/folder.rs"]
mod folder;
mod friction;
mod held_loop;
mod matrix;
mod method;
mod motion;
mod planner;
mod poses;
mod properties;
mod readme;
mod reference;
mod report;
mod rollout;
mod scenarios;
mod sensors;
mod stability;
#[path = "../support/stored.rs"]
mod stored;
mod taylor;
