//! The types of a trial: settings, actions, rejections, status.
//!
//! **Invariant:** these are plain values. All rules are in [`Trial`](super::Trial).

use crate::math::goal::{Criteria, Outcome};
use crate::math::kinematics::Target;

/// Default of `duration` \[s\]: time for a few dozen targets.
pub const DURATION: f64 = 60.0;

/// The settings of a trial; kept from start to start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Duration of a trial in simulation time \[s\], greater than 0.
    pub duration: f64,
    /// The condition for a reached target.
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

/// The settings in a start request, all valid. The others do not change.
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
    /// `settings` with these changes.
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

/// An action for the actor of the trial. Several actions are executed in order.
#[derive(Debug, Clone, PartialEq)]
pub enum TrialCommand {
    /// Cancel this goal. The id prevents cancelling another client's goal. A rejection means that it has already ended.
    CancelGoal {
        /// The goal's id.
        goal_id: String,
    },
    /// Send a goal, and answer with [`accepted`](super::Trial::accepted) or [`refused`](super::Trial::refused).
    SendGoal {
        /// Identifies this request in the answer.
        ticket: u64,
        /// The target.
        target: Target,
        /// When it counts as reached.
        criteria: Criteria,
    },
    /// Publish the [`status`](super::Trial::status), which has changed.
    PublishStatus,
}

/// Why a request to the trial is rejected. A rejected request changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Rejection {
    /// Skip or stop without a running trial.
    #[error("no trial is running")]
    NotRunning,
    /// The sampler found no target.
    #[error("no reachable target could be sampled for the arm's present lengths")]
    NoTarget,
}

/// The state of the trial's goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ActionStatus {
    /// No goal is active.
    Idle,
    /// A goal is being pursued.
    Active,
    /// The latest goal was reached; the next one is requested.
    Reached,
    /// Another client ended the latest goal; the trial waits.
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
    /// The present target, or the last one; none once the trial has ended.
    pub target: Option<Target>,
    /// The end effector's distance from the target \[m\], from the latest feedback.
    pub error: Option<f64>,
    /// The setpoint of the goal \[rad\], from the latest feedback.
    pub desired_positions: Option<Vec<f64>>,
    /// The state of the goal.
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
