//! Timed trials: `/ik_trial/start`, `/ik_trial/skip` and `/ik_trial/stop`.
//!
//! **Invariant:** settings change only with a valid start. A refused start echoes the present ones.

use std::time::Duration;

use bytes::Bytes;
use serde_json::json;

use super::goals::target_message;
use super::{Address, Answered, Ask, Callable};
use crate::math::trial::{Changes, Rejection, Settings, Status};
use crate::protocol::catalog::Service;
use crate::protocol::messages::Empty;
use crate::protocol::messages::goal::TrialStatus;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

/// Time between two messages of `/ik_trial/status` while nothing changes.
pub const STATUS_PERIOD: Duration = Duration::from_millis(100);

/// Starts a new trial, unless a field was rejected.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StartTrial {
    /// Changed settings.
    pub changes: Changes,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl Ask for StartTrial {
    type Answer = Terms;
}

/// The settings of trials, and whether one has been started.
#[derive(Debug, Clone, PartialEq)]
pub struct Terms {
    /// The present settings.
    pub settings: Settings,
    /// Whether a trial has been started.
    pub outcome: Result<(), NotStarted>,
}

/// Why no trial was started.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NotStarted {
    /// Fields were rejected.
    #[error("{0}")]
    Rejected(Rejections),
    /// The trial's own reason.
    #[error(transparent)]
    Refused(#[from] Rejection),
}

/// Replaces the present target by a new one.
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

impl Callable for StartTrial {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read_or_none(arguments, service);
        Ok(Self {
            changes: Changes {
                duration: fields.number("duration", Bound::Positive),
                epsilon: fields.number("epsilon", Bound::Positive),
                success_hold: fields.number("success_hold", Bound::NonNegative),
            },
            rejected: fields.finish(),
        })
    }
}

impl Answered for StartTrial {
    fn write(Terms { settings, outcome }: Terms, to: &Address) -> Bytes {
        let Settings { duration, criteria } = settings;
        let values = json!({
            "duration": duration,
            "epsilon": criteria.epsilon,
            "success_hold": criteria.success_hold,
        });
        let status = outcome.map_or_else(|why| why.to_string(), |()| String::new());
        to.response(&values, &status)
    }
}

impl Callable for SkipTarget {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Fields::read(arguments, service)?;
        Ok(Self)
    }
}

impl Answered for SkipTarget {
    fn write(answer: Result<(), Rejection>, to: &Address) -> Bytes {
        to.outcome(answer.map(|()| Empty {}))
    }
}

impl Callable for StopTrial {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Fields::read(arguments, service)?;
        Ok(Self)
    }
}

impl Answered for StopTrial {
    fn write(answer: Result<(), Rejection>, to: &Address) -> Bytes {
        to.outcome(answer.map(|()| Empty {}))
    }
}

/// The status in the form of its message.
#[must_use]
pub fn status_message(status: &Status) -> TrialStatus {
    TrialStatus {
        running: status.running,
        elapsed: status.elapsed,
        duration: status.duration,
        targets_reached: status.targets_reached,
        target: status.target.as_ref().map(target_message),
        error: status.error,
        desired_positions: status.desired_positions.clone(),
        action_status: status.action_status.name(),
    }
}
