//! The active goal and its messages.
//!
//! **Invariant:** a goal's messages have the target and the setpoint with which it was accepted.

use super::messages::{CancelRejected, GoalNews, GoalOwner, Meant};
use crate::actors::arm::sim::GoalJudged;
use crate::math::goal::Outcome;
use crate::protocol::messages::goal::{IkFeedback, IkResult};
use crate::protocol::op::GoalStatus;
use crate::services::goals::AcceptedGoal;

/// The active goal.
pub(super) struct ActiveGoal<const N: usize> {
    pub(super) goal: AcceptedGoal<N>,
    /// The receiver of the goal's news besides the subscribers.
    pub(super) owner: Option<GoalOwner<N>>,
    /// The status for its client if it ends before it is reached.
    pub(super) if_preempted: GoalStatus,
}

impl<const N: usize> ActiveGoal<N> {
    pub(super) fn is(&self, judged: &GoalJudged<N>) -> bool {
        self.goal.number == judged.number
    }

    pub(super) fn feedback(&self, judged: &GoalJudged<N>) -> IkFeedback {
        self.goal.feedback(judged.distance, judged.elapsed)
    }

    pub(super) fn result(&self, judged: &GoalJudged<N>) -> IkResult {
        self.goal.result(judged.distance, judged.outcome)
    }

    fn status(&self, judged: &GoalJudged<N>) -> GoalStatus {
        match judged.outcome {
            Some(Outcome::Reached) => GoalStatus::Succeeded,
            _ => self.if_preempted,
        }
    }

    /// Whether this goal has the given id.
    pub(super) fn check(&self, meant: &Meant) -> Result<(), CancelRejected> {
        match (meant, &self.owner) {
            (Meant::Active, _) => Ok(()),
            (Meant::Called(id), _) if *id == self.goal.id => Ok(()),
            (Meant::Called(_), _) => Err(CancelRejected::OtherGoal {
                active: self.goal.id.clone(),
            }),
            (Meant::Sent(goal), Some(GoalOwner::Client(client))) if client.is(goal) => Ok(()),
            (Meant::Sent(_), _) => Err(CancelRejected::NotSent),
        }
    }

    /// Informs its owner of feedback or of its end.
    pub(super) fn inform_owner(&self, judged: &GoalJudged<N>) {
        match &self.owner {
            None => {}
            Some(GoalOwner::Client(client)) => match judged.outcome {
                None => client.feed_back(self.feedback(judged)),
                Some(_) => client.conclude(self.result(judged), self.status(judged)),
            },
            Some(GoalOwner::Node(owner)) => owner.do_send(GoalNews {
                goal_id: self.goal.id.clone(),
                distance: judged.distance,
                positions: self.goal.positions,
                pose: judged.pose,
                outcome: judged.outcome,
            }),
        }
    }
}
