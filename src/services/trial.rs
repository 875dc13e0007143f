//! Timed trials: `/ik_trial/start`, `/ik_trial/skip` and `/ik_trial/stop`.
//!
//! **Invariant:** settings change only with a valid start. A refused start echoes the present ones.

use std::time::Duration;

use bytes::Bytes;
use serde::Serialize;

use super::goals::TargetMessage;
use super::{Address, Ask};
use crate::math::trial::{Changes, Rejection, Settings, Status};
use crate::protocol::catalog::Service;
use crate::protocol::messages::Empty;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

/// Time between two messages of `/ik_trial/status` while nothing changes.
pub const STATUS_PERIOD: Duration = Duration::from_millis(100);

/// A request about the trial.
#[derive(Debug, Clone, PartialEq)]
pub enum TrialRequest {
    /// Starts a new trial, unless a field was rejected.
    Start {
        /// Changed settings.
        changes: Changes,
        /// Fields that were not valid.
        rejected: Rejections,
    },
    /// Replaces the present target by a new one.
    Skip,
    /// Ends the trial.
    Stop,
}

/// The settings of trials, and the outcome of a request.
#[derive(Debug, Clone, PartialEq)]
pub struct Terms {
    /// The present settings.
    pub settings: Settings,
    /// Whether it was done.
    pub outcome: Result<(), TrialRefused>,
}

/// Why a request about the trial was not done.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrialRefused {
    /// Fields were rejected.
    #[error("{0}")]
    Rejected(Rejections),
    /// The trial's own reason.
    #[error(transparent)]
    Refused(#[from] Rejection),
}

impl Ask for TrialRequest {
    type Answer = Terms;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        if service != Service::TrialStart {
            Fields::read(arguments, service)?;
        }
        Ok(match service {
            Service::TrialSkip => Self::Skip,
            Service::TrialStop => Self::Stop,
            _ => {
                let mut fields = Fields::read_or_none(arguments, service);
                Self::Start {
                    changes: Changes {
                        duration: fields.number("duration", Bound::Positive),
                        epsilon: fields.number("epsilon", Bound::Positive),
                        success_hold: fields.number("success_hold", Bound::NonNegative),
                    },
                    rejected: fields.finish(),
                }
            }
        })
    }

    fn write(Terms { settings, outcome }: Terms, to: &Address) -> Bytes {
        if to.service() != Service::TrialStart {
            return to.outcome(outcome.map(|()| Empty {}));
        }
        let Settings { duration, criteria } = settings;
        let values = object! {
            duration: duration,
            epsilon: criteria.epsilon,
            success_hold: criteria.success_hold,
        };
        let status = outcome.map_or_else(|why| why.to_string(), |()| String::new());
        to.response(&values, &status)
    }
}

/// The message of `/ik_trial/status`.
#[must_use]
pub fn status_message(status: &Status) -> impl Serialize + use<> {
    object! {
        running: status.running,
        elapsed: status.elapsed,
        duration: status.duration,
        targets_reached: status.targets_reached,
        target: status.target.as_ref().map(TargetMessage::from),
        error: status.error,
        desired_positions: status.desired_positions.clone(),
        action_status: status.action_status.name(),
    }
}
