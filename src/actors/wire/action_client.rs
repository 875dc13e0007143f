//! Goals of an action: the registry's message to the node of the action, and the way back to the sender.
//!
//! **Invariant:** feedback for a slow client may be dropped. The end of a goal is never dropped, and follows all
//! feedback.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;

use crate::actors::ConnectionId;
use crate::actors::node::{Done, FrameKind, Respond};
use crate::protocol::catalog::Action;
use crate::protocol::messages::{self, Level};
use crate::protocol::op::fields::Rejections;
use crate::protocol::op::{Arguments, GoalStatus};
use crate::protocol::wire::json::Payload;

/// A client's goal or cancellation, forwarded by the registry.
pub enum ActionRequest {
    /// A goal whose fields are not parsed yet.
    Goal(ForwardGoal<Arguments>),
    /// A cancellation.
    Cancel(CancelSent),
}

/// A goal that clients send by an action.
pub trait Goal: Sized + Send + 'static {
    /// The action.
    const ACTION: Action;

    /// Reads a goal.
    ///
    /// # Errors
    /// All rejected fields, by name.
    fn read(arguments: &Arguments) -> Result<Self, Rejections>;
}

/// A goal with its client. From clients, by the action.
#[derive(Message)]
#[rtype(result = "()")]
pub struct ForwardGoal<G> {
    /// The goal.
    pub goal: G,
    /// The client that sent it.
    pub client: ActionClient,
    /// Dropped when the goal has started or is refused. The client's next frame is read then.
    pub done: Done,
}

/// Cancels the goal that the same client has sent. From clients, by the action.
#[derive(Message)]
#[rtype(result = "()")]
pub struct CancelSent {
    /// The goal. Its client gets an error status if it is not active.
    pub goal: SentGoal,
    /// The way back.
    pub respond: Recipient<Respond>,
    /// Dropped when the goal has ended.
    pub done: Done,
}

/// A goal of the action: its client and the client's id.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SentGoal {
    /// The connection.
    pub connection: ConnectionId,
    /// The goal's id, if it has one.
    pub id: Option<Payload>,
}

/// The client that sent a goal, and its recipients.
pub struct ActionClient {
    /// The way back.
    pub respond: Recipient<Respond>,
    /// The connection.
    pub connection: ConnectionId,
    /// The action's name as the client spells it.
    pub action: Arc<str>,
    /// The goal's id, if it has one.
    pub id: Option<Payload>,
    /// Whether the client gets feedback.
    pub wants_feedback: bool,
    /// Set when the client has disconnected.
    pub gone: Arc<AtomicBool>,
}

impl CancelSent {
    /// Sends the reason why no goal was cancelled.
    pub fn refuse(&self, why: &str) {
        let SentGoal { connection, id } = &self.goal;
        let status = Respond::error(*connection, why, id.as_ref());
        self.respond.do_send(status);
    }
}

impl ActionClient {
    /// Whether the client has disconnected.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }

    /// Whether this is the given goal.
    #[must_use]
    pub fn is(&self, goal: &SentGoal) -> bool {
        self.connection == goal.connection && self.id == goal.id
    }

    /// Sends a status with the reason why the goal has no effect yet.
    pub fn warn(&self, why: &str) {
        let id = self.id.as_ref();
        let status = Respond::status(self.connection, Level::Warning, why, id);
        self.respond.do_send(status);
    }

    /// Sends feedback, if the client gets it.
    pub fn feed_back(&self, values: impl Serialize) {
        if self.wants_feedback {
            let frame = messages::action_feedback(&self.action, self.id.as_ref(), &values);
            self.send(FrameKind::Feedback, frame);
        }
    }

    /// Sends the result of the goal.
    pub fn conclude(&self, values: impl Serialize, status: GoalStatus) {
        let result = status != GoalStatus::Unknown;
        let (action, id) = (&self.action, self.id.as_ref());
        let frame = messages::action_result(action, id, &values, status as u8, result);
        self.send(FrameKind::End, frame);
    }

    fn send(&self, kind: FrameKind, frame: Bytes) {
        self.respond.do_send(Respond {
            connection: self.connection,
            frame,
            kind,
            done: None,
        });
    }

    /// Sends the reason why the goal was not accepted. In this case clients expect a text in `values`.
    pub fn refuse(&self, why: &str) {
        self.conclude(why, GoalStatus::Unknown);
    }
}
