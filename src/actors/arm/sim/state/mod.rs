//! The arm's memory, each part apart from the actor that has it.
//!
//! **Invariant:** plain values: none of them knows the actor.

pub(crate) mod goals;
pub(crate) mod journal;
pub(crate) mod limit;
pub(crate) mod steps;
pub(crate) mod telemetry;
pub(crate) mod turn;
