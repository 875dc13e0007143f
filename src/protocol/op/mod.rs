//! Every rosbridge operation that a client may send, read from a frame.
//!
//! Payloads (`msg`, `args`, `values`) stay raw. Only the syntax of a forwarded payload is parsed.
//!
//! **Invariant:** every frame gives exactly one operation or exactly one error that names the fault. Both have the `id`
//! of a frame that is valid JSON. A member is read only for operations that have it. For all others only its syntax is
//! checked.

mod control;
pub mod fields;
mod members;
mod parse;
mod problems;
mod providers;
#[cfg(feature = "runtime")]
pub mod token;
mod types;

use std::time::Duration;

pub use self::members::OPS;
pub use self::parse::{read, read_raw, read_start};
pub use self::problems::{OpError, Problem};
pub use self::types::{
    ActionGoal, Compression, Encoding, GoalStatus, MAX_QUEUE_LENGTH, MAX_THROTTLE, MAX_TIMEOUT,
    ProviderOp, Served, Subscribe, Verbosity,
};
use super::messages::ErrorForm;
pub use crate::protocol::limits::MAX_NAME;
use crate::protocol::wire::fragments::Piece;
use crate::protocol::wire::json::Payload;
use crate::protocol::wire::series::Series;

/// A parsed frame.
#[derive(Debug)]
pub struct Incoming {
    /// The sender's `id`, also if the operation has an error. A frame that is not valid JSON has none.
    pub id: Option<Payload>,
    /// The operation.
    pub op: Result<Op, OpError>,
}

impl Incoming {
    /// Gives an error the id of the pieces of its frame. An op, such as a bad answer, keeps its own id.
    #[must_use]
    pub fn under_id(self, id: Option<Payload>) -> Self {
        match self.op {
            Err(_) => Self { id, ..self },
            Ok(_) => self,
        }
    }

    /// Whether it is from a command of this program.
    #[must_use]
    pub const fn is_command(&self) -> bool {
        matches!(self.op, Ok(Op::Auth { is_command, .. }) if is_command)
    }
}

/// An operation.
#[derive(Debug, Clone)]
pub enum Op {
    /// Registers the sender as a publisher.
    Advertise {
        /// Topic name.
        topic: String,
        /// Message type, if given.
        type_name: Option<String>,
    },
    /// Ends this registration.
    Unadvertise {
        /// Topic name.
        topic: String,
    },
    /// Delivers a message to the topic's subscribers.
    Publish {
        /// Topic name.
        topic: String,
        /// The message, an object.
        msg: Payload,
    },
    /// Delivers messages that are forwarded unchanged.
    PublishLines(Series),
    /// Registers the sender as a subscriber.
    Subscribe(Subscribe),
    /// Withdraws one subscription (the frame's id) or all.
    Unsubscribe {
        /// Topic name.
        topic: String,
    },
    /// Calls a service.
    CallService(CallService),
    /// A goal for an action.
    SendActionGoal(ActionGoal),
    /// Cancels the goal that has the frame's id.
    CancelActionGoal {
        /// Action name.
        action: String,
    },
    /// An operation of a client that serves a service or an action.
    Serve {
        /// Its kind.
        kind: Served,
        /// Name of the service or action.
        name: String,
        /// The op.
        op: ProviderOp,
    },
    /// A piece of a longer frame.
    Fragment(Piece),
    /// Sets the level of the sender's statuses, and the form of the reason of a failed call.
    SetLevel {
        /// The statuses.
        verbosity: Verbosity,
        /// The form of errors, if it is to change.
        errors: Option<ErrorForm>,
    },
    /// Authenticates the sender, if the runtime requires it.
    Auth {
        /// The token, if given. It may be missing if none is required.
        token: Option<String>,
        /// Whether the sender is a command of this program, which may use a kept place.
        is_command: bool,
    },
    /// An answer that cannot be forwarded. Its call or goal fails. Without an id, it is the only one that its
    /// sender has.
    BadAnswer {
        /// What its sender serves.
        kind: Served,
        /// The service or action, if the frame names one.
        name: Option<String>,
        /// The fault.
        problem: Problem,
    },
}

/// The arguments of a call: fields by name, or in documented order in an array; `{}` if they are absent or `null`. The
/// node that serves the call refuses any other value, because some services echo their values even then.
pub type Arguments = Payload;

/// A service call.
#[derive(Debug, Clone)]
pub struct CallService {
    /// Service name.
    pub service: String,
    /// Its arguments.
    pub args: Arguments,
    /// The timeout for a provider that is a client, if given; at most [`MAX_TIMEOUT`].
    pub timeout: Option<Duration>,
}
