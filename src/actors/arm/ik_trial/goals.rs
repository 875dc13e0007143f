//! The goals that a trial sends to `ik_action`.
//!
//! **Invariant:** each command is completed before the next.

use actix::prelude::*;

use crate::actors::arm::ik_action::{CancelGoal, GoalNews, GoalOwner, Meant, SendGoal};
use crate::actors::arm::sim::{ArmPose, Barrier};
use crate::actors::node::{Call, ask};
use crate::math::trial::TrialCommand;

/// The messages to `ik_action`.
#[derive(Clone)]
pub struct GoalClient<const N: usize> {
    /// Sends a goal.
    pub send: Recipient<Call<SendGoal<N>>>,
    /// Cancels it.
    pub cancel: Recipient<Call<CancelGoal>>,
    /// Waits until all earlier news have arrived.
    pub barrier: Recipient<Barrier>,
}

/// The answer of `ik_action` to a goal of the trial.
pub(super) struct GoalAnswer<const N: usize> {
    pub(super) ticket: u64,
    /// The goal's id, if it was accepted.
    pub(super) goal_id: Option<String>,
    /// Lengths after a refusal \[m\], which may have been the reason.
    pub(super) lengths: Option<[f64; N]>,
}

/// Sends the trial's commands to `ik_action`, one after another.
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
                // A refusal means that the goal has already ended, as wanted.
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
