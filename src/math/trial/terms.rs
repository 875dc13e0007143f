//! The terms of a trial: settings, actions, rejections, status.
//!
//! **Invariant:** plain values; the rules are all in [`Trial`](super::Trial).

use std::fmt;

use crate::math::goal::{Criteria, Outcome};
use crate::math::kinematics::Target;

/// `duration` where no start has given one \[s\]: time for a few dozen targets.
pub const DURATION: f64 = 60.0;

/// The settings of a trial; kept from start to start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Simulation time that a trial lasts \[s\], greater than 0.
    pub duration: f64,
    /// When a target counts as reached.
    pub criteria: Criteria,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            duration: DURATION,
            criteria: Criteria::default(),
        }
    }
}

/// The settings that a start names, all valid; the others stay as they are.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Changes {
    /// \[s\], greater than 0.
    pub duration: Option<f64>,
    /// \[m\], greater than 0.
    pub epsilon: Option<f64>,
    /// \[s\], not negative.
    pub success_hold: Option<f64>,
}

impl Changes {
    /// `settings` with these changes made.
    pub(super) fn to(self, settings: Settings) -> Settings {
        Settings {
            duration: self.duration.unwrap_or(settings.duration),
            criteria: Criteria {
                epsilon: self.epsilon.unwrap_or(settings.criteria.epsilon),
                success_hold: self.success_hold.unwrap_or(settings.criteria.success_hold),
            },
        }
    }
}

/// A thing that the trial wants done; several are done in order.
#[derive(Debug, Clone, PartialEq)]
pub enum TrialCommand {
    /// Cancel this goal, by its id, so that nobody else's is hit; a rejection means that it is over already.
    CancelGoal {
        /// The goal's id.
        goal_id: String,
    },
    /// Send a goal, and answer with [`accepted`](super::Trial::accepted) or [`refused`](super::Trial::refused).
    SendGoal {
        /// Names this request in the answer.
        ticket: u64,
        /// The target.
        target: Target,
        /// When it counts as reached.
        criteria: Criteria,
    },
    /// The [`status`](super::Trial::status) has changed and is to be shown.
    PublishStatus,
}

/// Why a request to the trial is rejected; it has changed nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Rejection {
    /// Skip and stop are for a running trial.
    #[error("no trial is running")]
    NotRunning,
    /// The sampler found nothing.
    #[error("no reachable target could be sampled for the arm's present lengths")]
    NoTarget,
}

/// The trial's view of the goal that it tracks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ActionStatus {
    /// Nothing in flight.
    Idle,
    /// A goal is being pursued.
    Active,
    /// The latest goal was reached; the next one is being asked for.
    Reached,
    /// Somebody else ended the latest goal; the trial waits.
    Preempted,
}

impl ActionStatus {
    /// The name that messages use.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Idle => "idle",
            Self::Active => "active",
            Self::Reached => "reached",
            Self::Preempted => "preempted",
        }
    }
}

impl fmt::Display for ActionStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The state of a trial as clients see it.
#[derive(Debug, Clone, PartialEq)]
pub struct Status {
    /// Whether the trial is neither over nor stopped.
    pub running: bool,
    /// Simulation time since the start \[s\], at most `duration`.
    pub elapsed: f64,
    /// \[s\].
    pub duration: f64,
    /// Targets reached since the start.
    pub targets_reached: u64,
    /// The target being pursued, or the last one; none once the trial has ended.
    pub target: Option<Target>,
    /// The end effector's distance from the target \[m\], as last heard.
    pub error: Option<f64>,
    /// The setpoint that the goal commands \[rad\], as last heard.
    pub desired_positions: Option<Vec<f64>>,
    /// How the goal stands.
    pub action_status: ActionStatus,
}

/// The end of any goal.
#[derive(Debug, Clone, PartialEq)]
pub struct Conclusion {
    /// The goal's id.
    pub goal_id: String,
    /// How it ended.
    pub outcome: Outcome,
    /// The end effector's distance from the target at the end \[m\].
    pub final_distance: f64,
}
