//! The goals of `/ik_action`. The host passes orders to the arm, and the arm's news to this value.
//!
//! **Invariant:** at most one goal is active, and each has exactly one result. A preempting goal comes in this order:
//! the old goal's result, the response, the trajectory, feedback, result.

use bytes::Bytes;

use super::goals::{GoalOrder, GoalProgress, Tracking};
use crate::math::goal::Outcome;
use crate::protocol::catalog::Topic;
use crate::protocol::messages;
use crate::services::goals::{AcceptedGoal, CancelRejected, GoalRequest};

/// The active goal with its owner: the receiver of its news besides the subscribers.
#[derive(Debug, Default)]
pub struct IkGoals<const N: usize, O> {
    active: Option<(AcceptedGoal<N>, O)>,
    /// Goals accepted so far: their numbers make the ids.
    accepted: u64,
}

/// Feedback or the end of a goal, for its subscribers and its owner.
#[derive(Debug, Clone, PartialEq)]
pub struct GoalReport<const N: usize> {
    /// The goal.
    pub goal: AcceptedGoal<N>,
    /// Its progress, or its end.
    pub progress: GoalProgress<N>,
}

impl<const N: usize, O: Clone> IkGoals<N, O> {
    /// The order for the arm, which solves the goal.
    #[must_use]
    pub fn order(&self, GoalRequest { target, criteria }: GoalRequest<N>) -> GoalOrder {
        GoalOrder {
            number: self.accepted + 1,
            target,
            criteria,
        }
    }

    /// Replaces the active goal by one that the arm tracks. Returns the end of the old one, which is published first.
    /// The new goal's trajectory is published after the response, and then its setpoint is held.
    pub fn accept(
        &mut self,
        order: &GoalOrder,
        owner: O,
        tracking: &Tracking<N>,
    ) -> (Option<(GoalReport<N>, O)>, AcceptedGoal<N>) {
        let before = tracking.before.and_then(|before| self.report(before));
        let goal = AcceptedGoal::new(order.number, order.target, tracking.positions);
        self.accepted = order.number;
        self.active = Some((goal.clone(), owner));
        (before, goal)
    }

    /// The active goal and its owner.
    #[must_use]
    pub fn active(&self) -> Option<&(AcceptedGoal<N>, O)> {
        self.active.as_ref()
    }

    /// The number of the goal to be cancelled: the active one, if its id is the given one or none is given.
    ///
    /// # Errors
    /// If that goal is not active.
    pub fn to_cancel(&self, goal_id: Option<&str>) -> Result<u64, CancelRejected> {
        let (goal, _) = self.active().ok_or(CancelRejected::NotActive)?;
        if goal_id.is_some_and(|id| id != goal.id) {
            let active = goal.id.clone();
            return Err(CancelRejected::OtherGoal { active });
        }
        Ok(goal.number)
    }

    /// News of the arm: feedback of the active goal, or its end, for its subscribers and its owner. `None` if that goal
    /// is no longer active.
    pub fn report(&mut self, progress: GoalProgress<N>) -> Option<(GoalReport<N>, O)> {
        let is_active = |(goal, _): &(AcceptedGoal<N>, O)| goal.number == progress.number;
        let (goal, owner) = match progress.outcome {
            Some(_) => self.active.take_if(|active| is_active(active))?,
            None => self.active().filter(|active| is_active(active))?.clone(),
        };
        Some((GoalReport { goal, progress }, owner))
    }
}

/// The answer to a cancellation, from how the latest goal ended. It may have been reached before.
///
/// # Errors
/// If it was not cancelled.
pub fn cancelled<const N: usize>(latest: Option<GoalProgress<N>>) -> Result<(), CancelRejected> {
    match latest.and_then(|latest| latest.outcome) {
        Some(Outcome::Preempted) => Ok(()),
        _ => Err(CancelRejected::NotActive),
    }
}

impl<const N: usize> GoalReport<N> {
    /// The message for the subscribers: its topic, and the writer of its frame.
    pub fn message(&self) -> (Topic, impl FnOnce() -> Bytes + Send + use<N>) {
        let Self { goal, progress } = self.clone();
        let topic = match progress.outcome {
            None => Topic::IkFeedback,
            Some(_) => Topic::IkResult,
        };
        let write = move || match progress.outcome {
            None => messages::publish(
                topic.name(),
                &goal.feedback(progress.distance, progress.elapsed),
            ),
            outcome => messages::publish(topic.name(), &goal.result(progress.distance, outcome)),
        };
        (topic, write)
    }
}
