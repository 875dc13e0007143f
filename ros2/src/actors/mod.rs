//! The actors, and the messages between them. All are on one thread. Zenoh has its own threads, which only put
//! messages into mailboxes.
//!
//! | actor | does |
//! | --- | --- |
//! | [`gateway::Gateway`] | one rosbridge connection to the arm, opened again when it ends |
//! | [`graph::GraphBridge`] | the Zenoh session; starts the bridges when both sides are there, and stops them |
//! | [`publisher::Publisher`] | one per topic that the arm publishes |
//! | [`subscription::Subscription`] | one per topic that the arm subscribes to |
//! | [`service::ServiceBridge`] | one per service |
//! | [`action::ActionBridge`] | one per action |
//!
//! **Invariant:** mailboxes are bounded. A full one refuses a message, and the sender gets an error.

/// Stops a bridge when the arm has disconnected.
macro_rules! stops_with_the_arm {
    ($bridge:ident) => {
        impl actix::Handler<$crate::actors::Leave> for $bridge {
            type Result = ();

            fn handle(&mut self, _: $crate::actors::Leave, ctx: &mut Self::Context) {
                ctx.stop();
            }
        }
    };
}

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

/// Most messages that wait for one actor.
const MAILBOX: usize = 1024;

/// The arm has connected or disconnected. For the graph.
#[derive(Message, Debug, Clone, Copy, PartialEq, Eq)]
#[rtype(result = "()")]
pub enum ArmPresence {
    /// It is connected.
    Here,
    /// Its connection has ended.
    Gone,
}

/// A message of the arm. For the topic's publisher.
#[derive(Message, Debug)]
#[rtype(result = "()")]
pub struct ArmMessage(pub Value);

/// Subscribes to a topic of the arm, or ends that. For the gateway.
#[derive(Message)]
#[rtype(result = "()")]
pub struct Listen {
    /// The topic, by the arm's name.
    pub topic: &'static str,
    /// The recipient of its messages; `None` ends the subscription.
    pub to: Option<Recipient<ArmMessage>>,
}

/// A message for the arm. For the gateway.
#[derive(Message, Debug)]
#[rtype(result = "()")]
pub struct PublishToArm {
    /// The topic, by the arm's name.
    pub topic: &'static str,
    /// The message.
    pub msg: Value,
}

/// A call of a service of the arm. For the gateway. The error has the reason for no answer.
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
    /// Whether the call succeeded.
    pub is_success: bool,
    /// The reason for a failure.
    pub status: String,
}

/// A goal for the arm. For the gateway. The error has the reason why it was not sent.
#[derive(Message)]
#[rtype(result = "Result<(), String>")]
pub struct ForwardGoal {
    /// The action, by the arm's name.
    pub action: Action,
    /// The goal's id.
    pub id: String,
    /// The goal.
    pub goal: Value,
    /// The subscribers of it.
    pub to: Recipient<GoalUpdate>,
}

/// Cancels a goal. For the gateway.
#[derive(Message, Debug)]
#[rtype(result = "()")]
pub struct Cancel {
    /// The action, by the arm's name.
    pub action: Action,
    /// The goal's id.
    pub id: String,
}

/// An event of a goal from the arm. For the action.
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
    /// The arm has accepted it.
    Accepted,
    /// Feedback.
    Feedback(Value),
    /// It has ended, with a status of `action_msgs/msg/GoalStatus`; 0 if it was never accepted.
    End(i8, Value),
}

/// The arm has disconnected, so the graph must not show the bridge any more. For every bridge.
#[derive(Message, Debug)]
#[rtype(result = "()")]
pub struct Leave;
