//! The arm, the integrators, the control law, the kinematics: against reference values, properties and exact counts.

#![allow(
    clippy::approx_constant,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    dead_code,
    reason = "a test that panics has failed; compared and cast numbers are exact; programs share their helpers"
)]

#[cfg(feature = "batch")]
mod batch;
mod control;
mod count;
mod default_gains;
mod divergence;
mod dynamics;
mod expression;
mod friction;
mod goal;
mod integrators;
mod kinematics;
mod limits;
mod pacer;
mod particle;
mod sensors;
mod simulation;
#[path = "../support/stored.rs"]
mod stored;
mod trajectory;
mod trial;
mod trig;
