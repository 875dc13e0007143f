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

mod actions;
mod advice;
#[path = "../support/arm.rs"]
mod arm;
mod backpressure;
mod broken_providers;
mod cbor;
mod client_actions;
mod clock_diagnostics;
mod closing;
#[cfg(feature = "cli")]
mod command;
#[path = "../support/common.rs"]
mod common;
mod computations;
#[path = "../support/diagnostics.rs"]
mod diagnostics;
mod divergence;
mod external_services;
mod faults;
mod faults_files;
mod faults_slow;
mod faults_threads;
mod follow_path;
mod fragments;
mod framing;
mod hostile_log;
mod hostile_pages;
mod hostile_users;
mod hostile_websocket;
mod http;
mod ids;
mod ik_action;
mod ik_trial;
mod joint_states;
#[path = "../support/json.rs"]
mod json;
mod latched;
mod launch;
mod limits;
mod memory_slow;
mod mishaps;
mod names;
mod opening;
mod options;
mod order;
mod parameters;
mod places;
#[cfg(target_os = "linux")]
mod present;
mod priority;
mod readme;
#[cfg(feature = "record")]
mod record;
#[cfg(feature = "record")]
mod record_words;
mod rosapi;
mod series;
mod services;
mod shutdown;
mod stamps;
mod step_disturb;
mod study;
mod tf_web;
mod time;
mod token;
mod topics;
mod two_clocks;
#[path = "../support/web_client.rs"]
mod web_client;
mod websocket;
