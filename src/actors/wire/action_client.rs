//! Goals of an action: what the registry hands to the node that serves the action, and the way back to the sender.
//!
//! **Invariant:** feedback may be lost on its way to a slow client, the end of a goal may not, and it comes after it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use actix::prelude::*;
use serde::Serialize;

use crate::actors::ConnectionId;
use crate::actors::node::{Done, Feedback, Respond};
use crate::actors::resources::budget::Share;
use crate::protocol::messages;
use crate::protocol::op::{Arguments, GoalStatus};
use crate::protocol::wire::payload::Payload;

/// A client's goal for an action or its end, as the registry has it.
pub enum ActionRequest {
    /// A goal.
    Goal {
        /// Its fields, unread.
        arguments: Arguments,
        /// Who sent it.
        client: ActionClient,
        /// Dropped when the goal has been set in motion, or refused: the client's next frame is read then.
        done: Done,
    },
    /// The end of a goal that the same client has sent under the same id.
    Cancel {
        /// Who wants it; an error status goes there where no such goal is active.
        from: Canceller,
        /// Dropped when the goal has ended.
        done: Done,
    },
}

/// Who wants a goal to end.
pub struct Canceller {
    /// The way back.
    pub respond: Recipient<Respond>,
    /// The connection.
    pub connection: ConnectionId,
    /// The goal's id.
    pub id: Option<Payload>,
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
    /// Its share of its client's account: a goal may last for as long as the client likes.
    pub share: Share,
}

impl Canceller {
    /// Tells why nothing was ended.
    pub fn refuse(&self, why: &str) {
        let status = Respond::error(self.connection, why, self.id.as_ref());
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
    pub fn is_meant_by(&self, who: &Canceller) -> bool {
        self.connection == who.connection && self.id == who.id
    }

    /// Tells how the goal goes, if that was asked for.
    pub fn feed_back(&self, values: &impl Serialize) {
        if self.wants_feedback {
            self.feedback.do_send(Feedback {
                connection: self.connection,
                action: Arc::clone(&self.action),
                frame: messages::action_feedback(&self.action, self.id.as_ref(), values),
            });
        }
    }

    /// Tells how the goal ended.
    pub fn conclude(&self, values: &impl Serialize, status: GoalStatus) {
        let result = status != GoalStatus::Unknown;
        let id = self.id.as_ref();
        let frame = messages::action_result(&self.action, id, values, status as u8, result);
        self.respond.do_send(Respond {
            connection: self.connection,
            frame: frame.into(),
            service: None,
            status: None,
            done: None,
        });
    }

    /// Tells why the goal was not accepted: there, clients expect a text for values.
    pub fn refuse(&self, why: &str) {
        self.conclude(&why, GoalStatus::Unknown);
    }
}
