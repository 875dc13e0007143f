//! The actors, and the messages between them. All are on one thread; Zenoh has threads of its own, which only put
//! messages into mailboxes.
//!
//! | actor | does |
//! | --- | --- |
//! | [`gateway::Gateway`] | one rosbridge connection to the arm, opened again when it ends |
//! | [`graph::GraphBridge`] | the Zenoh session; starts the bridges when both sides are there, and stops them |
//! | [`publisher::Publisher`] | one per topic that the arm publishes |
//! | [`subscription::Subscription`] | one per topic that the arm takes |
//! | [`service::ServiceBridge`] | one per service |
//! | [`action::ActionBridge`] | one per action |
//!
//! **Invariant:** mailboxes are bounded. One that is full refuses a message, and says so to the sender.

pub mod action;
mod endpoints;
pub mod gateway;
mod goals;
pub mod graph;
mod inlet;
mod link;
mod outlet;
pub mod publisher;
pub mod service;
pub mod subscription;

use actix::prelude::*;
use pendularm::protocol::catalog::Action;
use serde_json::Value;

/// Messages that may wait for one actor.
const MAILBOX: usize = 1024;

/// The arm came or went. Addressed to the graph.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
#[rtype(result = "()")]
pub enum ArmPresence {
    /// It answers.
    Here,
    /// Its connection has ended.
    Gone,
}

/// A message of the arm's. Addressed to the topic's publisher.
#[derive(Message, Debug)]
#[rtype(result = "()")]
pub struct ArmMessage(pub Value);

/// The arm's messages on a topic are wanted, or no longer. Addressed to the gateway.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Listen {
    /// The topic, by the arm's name.
    pub topic: &'static str,
    /// Where its messages go; none ends it.
    pub to: Option<Recipient<ArmMessage>>,
}

/// A message for the arm. Addressed to the gateway.
#[derive(Message, Debug)]
#[rtype(result = "()")]
pub struct PublishToArm {
    /// The topic, by the arm's name.
    pub topic: &'static str,
    /// The message.
    pub msg: Value,
}

/// A call of a service of the arm's. Addressed to the gateway; the error says why there is no answer.
#[derive(Message, Debug)]
#[rtype(result = "Result<Answer, String>")]
pub struct CallArm {
    /// The service, by the arm's name.
    pub service: &'static str,
    /// The arguments.
    pub args: Value,
}

/// The arm's answer.
#[derive(Debug)]
pub struct Answer {
    /// Its fields.
    pub values: Value,
    /// Whether the call was done.
    pub is_success: bool,
    /// Why not.
    pub status: String,
}

/// A goal for the arm. Addressed to the gateway; the error says why it was not sent.
#[derive(Message)]
#[rtype(result = "Result<(), String>")]
pub struct Pursue {
    /// The action, by the arm's name.
    pub action: Action,
    /// The goal's id.
    pub id: String,
    /// The goal.
    pub goal: Value,
    /// The subscribers of it.
    pub to: Recipient<GoalUpdate>,
}

/// A goal is no longer wanted. Addressed to the gateway.
#[derive(Message, Debug)]
#[rtype(result = "()")]
pub struct Cancel {
    /// The action, by the arm's name.
    pub action: Action,
    /// The goal's id.
    pub id: String,
}

/// News of a goal from the arm. Addressed to the action.
#[derive(Message, Debug)]
#[rtype(result = "()")]
pub struct GoalUpdate {
    /// The goal's id.
    pub id: String,
    /// The news.
    pub what: GoalEvent,
}

/// An event in the life of a goal.
#[derive(Debug)]
pub enum GoalEvent {
    /// How it goes.
    Feedback(Value),
    /// It has ended, with a status of `action_msgs/msg/GoalStatus`; 0 if it was never accepted.
    End(i8, Value),
}

/// The arm has gone: the graph shall not show the bridge any longer. Addressed to every bridge.
#[derive(Message, Debug)]
#[rtype(result = "()")]
pub struct Leave;
