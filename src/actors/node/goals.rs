//! Goals of an action, and the clients that send them.
//!
//! **Invariant:** feedback of a goal may be dropped for a slow client. The end of a goal is never dropped, and follows all
//! feedback.

use std::sync::Arc;

use actix::prelude::*;
use serde::Serialize;

use super::completion::Working;
use super::registry::{ClientLink, FrameKind};
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
pub trait SentGoal: Sized + Send + 'static {
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
    pub working: Working,
}

/// Cancels the goal that the same client has sent under this id, or all goals of the action. From clients, by the action.
#[derive(Message)]
#[rtype(result = "()")]
pub struct CancelSent {
    /// The client. It gets an error status if the goal is not active.
    pub link: ClientLink,
    /// The goal's id, if it has one.
    pub id: Option<Payload>,
    /// Whether all goals are cancelled, also those of other clients.
    pub all: bool,
    /// Dropped when the goal has ended.
    pub working: Working,
}

/// The client that sent a goal.
pub struct ActionClient {
    /// The client.
    pub link: ClientLink,
    /// The action's name as the client spells it.
    pub action: Arc<str>,
    /// The goal's id, if it has one.
    pub id: Option<Payload>,
    /// Whether the client gets feedback.
    pub wants_feedback: bool,
}

impl CancelSent {
    /// Whether it is about the goal of this client.
    #[must_use]
    pub fn is_of(&self, client: &ActionClient) -> bool {
        self.all || (self.link.connection == client.link.connection && self.id == client.id)
    }

    /// Sends the reason why the goal was not cancelled.
    pub fn refuse(&self, why: &str) {
        if !self.all {
            self.link.status(Level::Error, why, self.id.as_ref());
        }
    }
}

impl ActionClient {
    /// Sends a status with the reason why the goal has no effect yet.
    pub fn warn(&self, why: &str) {
        self.link.status(Level::Warning, why, self.id.as_ref());
    }

    /// Sends feedback, if the client gets it.
    pub fn feed_back(&self, values: impl Serialize) {
        if self.wants_feedback {
            let frame = messages::action_feedback(&self.action, self.id.as_ref(), &values);
            self.link.send(FrameKind::Feedback, frame, None);
        }
    }

    /// Sends the result of the goal.
    pub fn conclude(&self, values: impl Serialize, status: GoalStatus) {
        self.end(values, status, true);
    }

    /// Sends the reason why the goal has no result. In this case clients expect a text in `values`.
    pub fn fail(&self, why: &str, status: GoalStatus) {
        self.end(why, status, false);
    }

    /// Sends the reason why the goal was not accepted.
    pub fn refuse(&self, why: &str) {
        self.fail(why, GoalStatus::Unknown);
    }

    fn end(&self, values: impl Serialize, status: GoalStatus, result: bool) {
        let (action, id) = (&self.action, self.id.as_ref());
        let frame = messages::action_result(action, id, &values, status as u8, result);
        self.link.send(FrameKind::End, frame, None);
    }
}
