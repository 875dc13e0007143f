//! Goals of an action: the registry's message to the node that serves the action, and the way back to the sender.
//!
//! **Invariant:** feedback may be lost on its way to a slow client, the end of a goal may not, and it comes after it.
//! Both are handed over as values, and written by the registry.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use actix::prelude::*;
use serde::Serialize;

use crate::actors::ConnectionId;
use crate::actors::node::{Done, Feedback, FrameOut, Respond};
use crate::protocol::messages::{self, Level};
use crate::protocol::op::{Arguments, GoalStatus};
use crate::protocol::wire::json::Payload;

/// A client's goal for an action or its end, as the registry passes it on.
pub enum ActionRequest {
    /// A goal.
    Goal {
        /// Its fields, unread.
        arguments: Arguments,
        /// The client that sent it.
        client: ActionClient,
        /// Dropped when the goal has been set in motion, or refused: the client's next frame is read then.
        done: Done,
    },
    /// The end of a goal that the same client has sent under the same id.
    Cancel {
        /// The client that wants it; it gets an error status if no such goal is active.
        from: Canceller,
        /// Dropped when the goal has ended.
        done: Done,
    },
}

/// A goal of the action: its client and the client's id.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SentGoal {
    /// The connection.
    pub connection: ConnectionId,
    /// The goal's id, if it has one.
    pub id: Option<Payload>,
}

/// The client that cancels a goal.
pub struct Canceller {
    /// The way back.
    pub respond: Recipient<Respond>,
    /// The goal that is meant.
    pub goal: SentGoal,
}

/// The client that sent a goal, and the ways to it.
pub struct ActionClient {
    /// Results, which are never lost.
    pub respond: Recipient<Respond>,
    /// Feedback, which may be.
    pub feedback: Recipient<Feedback>,
    /// The connection.
    pub connection: ConnectionId,
    /// The action's name as the client spells it.
    pub action: Arc<str>,
    /// The goal's id, if it has one.
    pub id: Option<Payload>,
    /// Whether feedback was asked for.
    pub wants_feedback: bool,
    /// Set when the client is gone.
    pub gone: Arc<AtomicBool>,
}

impl Canceller {
    /// Tells why nothing was ended.
    pub fn refuse(&self, why: &str) {
        let SentGoal { connection, id } = &self.goal;
        let status = Respond::error(*connection, why, id.as_ref());
        self.respond.do_send(status);
    }
}

impl ActionClient {
    /// True once the client has disconnected.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }

    /// Whether this goal is the one that is meant.
    #[must_use]
    pub fn is(&self, goal: &SentGoal) -> bool {
        self.connection == goal.connection && self.id == goal.id
    }

    /// Tells by a status why the goal has no effect yet.
    pub fn warn(&self, why: &str) {
        let id = self.id.as_ref();
        let status = Respond::status(self.connection, Level::Warning, why, id);
        self.respond.do_send(status);
    }

    /// Tells how the goal goes, if that was asked for.
    pub fn feed_back(&self, values: impl Serialize + Send + 'static) {
        if self.wants_feedback {
            let (action, id) = (Arc::clone(&self.action), self.id.clone());
            let write = move || messages::action_feedback(&action, id.as_ref(), &values);
            self.feedback.do_send(Feedback {
                connection: self.connection,
                frame: FrameOut::unwritten(write),
            });
        }
    }

    /// Tells how the goal ended.
    pub fn conclude(&self, values: impl Serialize + Send + 'static, status: GoalStatus) {
        let result = status != GoalStatus::Unknown;
        let (action, id) = (Arc::clone(&self.action), self.id.clone());
        let write =
            move || messages::action_result(&action, id.as_ref(), &values, status as u8, result);
        self.respond.do_send(Respond {
            connection: self.connection,
            frame: FrameOut::unwritten(write),
            service: None,
            status: None,
            done: None,
        });
    }

    /// Tells why the goal was not accepted: there, clients expect a text for values.
    pub fn refuse(&self, why: &str) {
        self.conclude(why.to_owned(), GoalStatus::Unknown);
    }
}
