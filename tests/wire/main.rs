//! The built program, driven over TCP and WebSocket as a client would.

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

#[cfg(feature = "cli")]
mod command;
#[path = "../support/common.rs"]
mod common;
mod computations;
mod faults_files;
mod faults_threads;
#[path = "../support/folder.rs"]
mod folder;
mod hostile_log;
mod http;
mod launch;
mod mishaps;
mod options;
mod places;
#[cfg(target_os = "linux")]
mod present;
mod priority;
mod readme;
#[cfg(feature = "record")]
mod record;
mod shutdown;
#[path = "../support/web_client.rs"]
mod web_client;
