//! Goals, their ends and their news, as nodes say them to one another and clients by the service or the action.
//!
//! **Invariant:** every message is plain, and nobody has to ask twice: every question says what has become of it.

use std::sync::Arc;

use actix::prelude::*;

use crate::actors::arm::sim::Pose;
use crate::actors::node::Ask;
use crate::actors::wire::action_client::{ActionClient, SentGoal};
use crate::math::goal::{Criteria, Outcome};
use crate::math::kinematics::Target;
pub use crate::services::goals::{CancelRejected, GoalRejected};

/// Go there. The answer is the goal's id, given before its trajectory goes out.
#[derive(Clone)]
pub struct SendGoal<const N: usize> {
    /// The target.
    pub target: Target,
    /// When it counts as reached.
    pub criteria: Criteria,
    /// Hears how the goal goes, besides the subscribers; its being gone is nobody's trouble.
    pub owner: Option<GoalOwner<N>>,
}

impl<const N: usize> Ask for SendGoal<N> {
    type Answer = Result<String, GoalRejected>;
}

/// The one that follows a goal besides the subscribers.
#[derive(Clone)]
pub enum GoalOwner<const N: usize> {
    /// A node.
    Node(Recipient<GoalNews<N>>),
    /// A client that sent it by the action.
    Client(Arc<ActionClient>),
}

/// A goal is preempted if it is the active one; answered after its result has been published.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CancelGoal {
    /// The goal that is meant.
    pub goal: Meant,
}

/// A goal, as who wants its end knows it.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Meant {
    /// Whichever is active.
    #[default]
    Active,
    /// The goal of this id, which its sender got for an answer.
    Called(String),
    /// The goal that a client has sent by the action.
    Sent(SentGoal),
}

impl Ask for CancelGoal {
    type Answer = Result<(), CancelRejected>;
}

/// How a goal goes. To the owner that its [`SendGoal`] named.
#[derive(Message, Debug, Clone, PartialEq)]
#[rtype(result = "()")]
pub struct GoalNews<const N: usize> {
    /// The goal.
    pub goal_id: String,
    /// Distance between end effector and target \[m\].
    pub distance: f64,
    /// The setpoint that the goal commanded \[rad\].
    pub positions: [f64; N],
    /// The arm at that instant.
    pub pose: Pose<N>,
    /// How it ended; none while it is active.
    pub outcome: Option<Outcome>,
}
