//! How a trial moves the arm: by goals that it sends to `ik_action`.
//!
//! **Invariant:** each command is carried out whole before the next.

use actix::prelude::*;

use crate::actors::arm::ik_action::{CancelGoal, GoalNews, GoalOwner, Meant, SendGoal};
use crate::actors::arm::sim::{ArmPose, Barrier};
use crate::actors::node::{Call, ask};
use crate::math::trial::TrialCommand;

/// `ik_action`, as its client sees it.
#[derive(Clone)]
pub struct GoalClient<const N: usize> {
    /// Sends a goal.
    pub send: Recipient<Call<SendGoal<N>>>,
    /// Cancels it.
    pub cancel: Recipient<Call<CancelGoal>>,
    /// Waits until the news so far have arrived.
    pub barrier: Recipient<Barrier>,
}

/// The answer of `ik_action` to a goal that the trial sent.
pub(super) struct GoalAnswer<const N: usize> {
    pub(super) ticket: u64,
    /// The goal's id, if it was accepted.
    pub(super) goal_id: Option<String>,
    /// Lengths after a refusal \[m\]: they may have been the reason.
    pub(super) lengths: Option<[f64; N]>,
}

/// Takes the trial's commands to `ik_action`, one after another.
pub(super) async fn carry_out<const N: usize>(
    commands: Vec<TrialCommand>,
    arm: Recipient<ArmPose<N>>,
    goals: GoalClient<N>,
    owner: Recipient<GoalNews<N>>,
) -> Vec<GoalAnswer<N>> {
    let mut answers = Vec::new();
    for command in commands {
        match command {
            TrialCommand::CancelGoal { goal_id } => {
                let goal = Meant::Called(goal_id);
                // A refusal means that the goal is over already: all that was wanted.
                let _ = ask(&goals.cancel, CancelGoal { goal }).await;
            }
            TrialCommand::SendGoal {
                ticket,
                target,
                criteria,
            } => {
                let goal = SendGoal {
                    target,
                    criteria,
                    owner: Some(GoalOwner::Node(owner.clone())),
                };
                let goal_id = ask(&goals.send, goal).await.ok().and_then(Result::ok);
                let lengths = match goal_id {
                    Some(_) => None,
                    None => arm.send(ArmPose).await.ok().map(|pose| pose.lengths),
                };
                answers.push(GoalAnswer {
                    ticket,
                    goal_id,
                    lengths,
                });
            }
            TrialCommand::PublishStatus => {}
        }
    }
    answers
}
