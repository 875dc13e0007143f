//! The arm, the integrators, the control law, the kinematics: against reference values, properties and exact counts.

#![allow(
    clippy::approx_constant,
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

#[cfg(feature = "batch")]
mod batch;
mod control;
mod control_period;
mod default_gains;
mod divergence;
mod dynamics;
mod expression;
mod goal;
mod integrators;
mod kinematics;
mod pacer;
mod particle;
mod simulation;
#[path = "../support/stored.rs"]
mod stored;
mod trajectory;
mod trial;
mod trig;
