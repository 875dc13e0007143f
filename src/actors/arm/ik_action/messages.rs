//! Messages about goals between nodes, and from clients by the service or the action.
//!
//! **Invariant:** every message is a plain value, and every request is answered with its outcome.

use std::sync::Arc;

use actix::prelude::*;

use crate::actors::arm::sim::Pose;
use crate::actors::node::Ask;
use crate::actors::wire::action_client::{ActionClient, SentGoal};
use crate::math::goal::{Criteria, Outcome};
use crate::math::kinematics::Target;
pub use crate::services::goals::{CancelRejected, GoalRejected};

/// A goal. The answer is its id, sent before its trajectory is published.
#[derive(Clone)]
pub struct SendGoal<const N: usize> {
    /// The target.
    pub target: Target,
    /// The condition for success.
    pub criteria: Criteria,
    /// The receiver of feedback besides the subscribers. It may end at any time.
    pub owner: Option<GoalOwner<N>>,
}

impl<const N: usize> Ask for SendGoal<N> {
    type Answer = Result<String, GoalRejected>;
}

/// The receiver of a goal's news besides the subscribers.
#[derive(Clone)]
pub enum GoalOwner<const N: usize> {
    /// A node.
    Node(Recipient<GoalReport<N>>),
    /// A client that sent it by the action.
    Client(Arc<ActionClient>),
}

/// Preempts a goal if it is the active one. Answered after its result has been published.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CancelGoal {
    /// The goal to preempt.
    pub goal: GoalSelector,
}

/// The identification of a goal to be ended.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum GoalSelector {
    /// The active goal.
    #[default]
    Active,
    /// The goal with this id, from the answer to its sender.
    ById(String),
    /// The goal of this client, sent by the action.
    Sent(SentGoal),
}

impl Ask for CancelGoal {
    type Answer = Result<(), CancelRejected>;
}

/// The progress of a goal, for the owner in its [`SendGoal`].
#[derive(Message, Debug, Clone, PartialEq)]
#[rtype(result = "()")]
pub struct GoalReport<const N: usize> {
    /// The goal.
    pub goal_id: String,
    /// Distance between end effector and target \[m\].
    pub distance: f64,
    /// The setpoint that the goal commanded \[rad\].
    pub positions: [f64; N],
    /// The state of the arm at that time.
    pub pose: Pose<N>,
    /// How it ended; `None` while it is active.
    pub outcome: Option<Outcome>,
}
