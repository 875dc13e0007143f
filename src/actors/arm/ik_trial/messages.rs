//! The questions to `ik_trial`.
//!
//! **Invariant:** settings change only with a start that has no bad field.

use crate::actors::node::Ask;
use crate::math::trial::{Changes, Rejection, Settings};
use crate::protocol::op::fields::Rejections;

/// Starts a trial afresh, unless something was rejected.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StartTrial {
    /// Settings that are to be others from now on.
    pub changes: Changes,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl Ask for StartTrial {
    type Answer = Terms;
}

/// The terms of trials, and whether one has been started.
#[derive(Debug, Clone, PartialEq)]
pub struct Terms {
    /// The settings in force.
    pub settings: Settings,
    /// Whether a trial has been started.
    pub outcome: Result<(), NotStarted>,
}

/// Why no trial was started.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotStarted {
    /// Fields were not valid.
    #[error("{0}")]
    Rejected(Rejections),
    /// The trial's own reason.
    #[error(transparent)]
    Refused(#[from] Rejection),
}

/// Abandons the present target for a new one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SkipTarget;

impl Ask for SkipTarget {
    type Answer = Result<(), Rejection>;
}

/// Ends the trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StopTrial;

impl Ask for StopTrial {
    type Answer = Result<(), Rejection>;
}
