//! Every rosbridge operation that a client may send, read from a frame.
//!
//! Payloads (`msg`, `args`, `values`) stay raw. Only the syntax of a forwarded payload is parsed.
//!
//! **Invariant:** every frame gives exactly one operation or exactly one error that names the fault, and its `id` in
//! both cases.

pub mod fields;
mod reader;
mod rejections;
#[cfg(feature = "runtime")]
pub mod token;

use std::time::Duration;

use super::messages::{ErrorForm, Level};
pub use crate::protocol::limits::MAX_NAME;
use crate::protocol::wire::fragments::Piece;
use crate::protocol::wire::json::Payload;
use crate::protocol::wire::series::Series;
pub use reader::{OPS, read, read_start};

/// Longest `throttle_rate`: a year; beyond it, a delivery is never due in a connection's lifetime.
pub const MAX_THROTTLE: Duration = Duration::from_secs(365 * 24 * 3600);
/// Largest `queue_length`. The [outbox](super::outbox) bounds held messages by bytes, and no message has fewer than 40.
pub const MAX_QUEUE_LENGTH: usize = 100_000;
/// Longest `timeout` of a forwarded call: a day.
pub const MAX_TIMEOUT: Duration = Duration::from_secs(24 * 3600);

/// A parsed frame.
#[derive(Debug)]
pub struct Incoming {
    /// The sender's `id`, unchanged, also if the operation has an error.
    pub id: Option<Payload>,
    /// The operation.
    pub op: Result<Op, OpError>,
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

/// The lowest severity of statuses that a client gets; `None` for no status at all.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Verbosity(pub Option<Level>);

impl Verbosity {
    /// Every status: the default over raw TCP.
    pub const ALL: Self = Self(Some(Level::Info));
    /// No status: the default over WebSocket.
    pub const NONE: Self = Self(None);

    /// Whether the client gets a status of that level.
    #[must_use]
    pub fn wants(self, level: Level) -> bool {
        self.0.is_some_and(|least| level >= least)
    }
}

/// A subscription.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Subscribe {
    /// Topic name.
    pub topic: String,
    /// Message type, if given.
    pub type_name: Option<String>,
    /// Least time between deliveries; zero for no throttling; at most [`MAX_THROTTLE`].
    pub throttle: Duration,
    /// Most messages that may wait or be held by throttling; 0 if it is not given; at most [`MAX_QUEUE_LENGTH`].
    pub queue_length: usize,
    /// The form of its messages.
    pub encoding: Encoding,
}

/// The form of a subscriber's messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Encoding {
    /// The encoding.
    pub compression: Compression,
    /// Longest piece of a message in JSON, in bytes, a power of two. Longer messages are sent in fragments. Without
    /// it, and for binary messages, a message is one piece.
    pub fragment_size: Option<usize>,
    /// Whether stamps also have the names of ROS 1. The registry sets it by the topic's type.
    pub ros1_stamps: bool,
}

impl Encoding {
    /// Combines two subscriptions of one client: the denser encoding, the smaller pieces, and all names of stamps.
    #[must_use]
    pub fn merged(self, other: Self) -> Self {
        let compression = self.compression.max(other.compression);
        let sizes = self.fragment_size.into_iter().chain(other.fragment_size);
        Self {
            compression,
            fragment_size: sizes.min().filter(|_| compression == Compression::None),
            ros1_stamps: self.ros1_stamps || other.ros1_stamps,
        }
    }
}

/// The encoding of a message. If a client requests several, the last one in this order applies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub enum Compression {
    /// JSON. It is also used for `png`, which saves nothing on short messages.
    #[default]
    None,
    /// CBOR, with typed arrays.
    Cbor,
    /// CDR in CBOR.
    CborRaw,
}

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

/// A goal.
#[derive(Debug, Clone)]
pub struct ActionGoal {
    /// Action name.
    pub action: String,
    /// Action type, if given.
    pub type_name: Option<String>,
    /// Its fields.
    pub args: Arguments,
    /// Whether the client gets feedback.
    pub feedback: bool,
}

/// The final status of a goal, as in `action_msgs/msg/GoalStatus`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GoalStatus {
    /// Never accepted.
    Unknown = 0,
    /// Reached.
    Succeeded = 4,
    /// Cancelled by a client.
    Canceled = 5,
    /// Replaced by another goal or ended by a reset.
    Aborted = 6,
}

/// The kinds of names that a client can serve to others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Served {
    /// Its calls are answered.
    Service,
    /// Its goals are executed.
    Action,
}

impl Served {
    /// The word for it, which is also the member with its name.
    #[must_use]
    pub const fn noun(self) -> &'static str {
        match self {
            Self::Service => "service",
            Self::Action => "action",
        }
    }
}

/// An operation of a client that serves. If it concerns one call or goal, the frame's id identifies that.
#[derive(Debug, Clone)]
pub enum ProviderOp {
    /// The sender serves the name from now on.
    Advertise {
        /// Its type, if given.
        type_name: Option<String>,
    },
    /// Ends this registration.
    Unadvertise,
    /// Answers a call.
    Respond {
        /// Any value.
        values: Payload,
        /// Whether the call succeeded.
        result: bool,
        /// The provider's own `status`, if given.
        status: Option<String>,
    },
    /// Forwards feedback of a goal.
    Feedback {
        /// Any value.
        values: Payload,
    },
    /// Forwards the result of a goal.
    End {
        /// Any value.
        values: Payload,
        /// The status, a value of `action_msgs/msg/GoalStatus`.
        status: u8,
        /// Whether the goal has a result.
        result: bool,
    },
}

/// The arguments of a call: fields by name, or in documented order in an array; `{}` if they are absent or `null`. The
/// node that serves the call refuses any other value, because some services echo their values even then.
pub type Arguments = Payload;

/// Why a frame is not a valid operation, and the form of the answer.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OpError {
    /// A fault that gets an error `status`.
    #[error(transparent)]
    Status(#[from] Problem),
    /// A faulty call of a known service. It gets a `service_response` with `result: false`.
    #[error("{problem}")]
    Call {
        /// The service that was called.
        service: String,
        /// The fault.
        problem: Problem,
    },
    /// A faulty goal of a named action. It gets an `action_result` with `result: false`.
    #[error("{problem}")]
    Goal {
        /// The action of the goal.
        action: String,
        /// The fault.
        problem: Problem,
    },
}

/// A fault of an operation.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    /// Not a frame; holds the reason.
    #[error("{0}")]
    NotAFrame(String),
    /// Not a JSON object; holds the parser's message, shortened.
    #[error("malformed frame: {0}")]
    NotJson(String),
    /// There is no `op`.
    #[error("malformed frame: op is required")]
    NoOp,
    /// `op` is not a string; holds its value.
    #[error("malformed frame: op must be a string, got {0}")]
    OpNotText(String),
    /// An unknown operation; holds its name, shortened.
    #[error("unknown op \"{0}\"")]
    UnknownOp(String),
    /// A required field is absent.
    #[error("{op}: {field} is required")]
    Missing {
        /// The operation.
        op: &'static str,
        /// The field.
        field: &'static str,
    },
    /// A field is rejected.
    #[error("{op}: {field} must be {expected}, got {found}")]
    Mistyped {
        /// The operation.
        op: &'static str,
        /// The field.
        field: &'static str,
        /// The expected kind of value.
        expected: &'static str,
        /// The received value, shortened.
        found: String,
    },
    /// A name is longer than it may be: [`MAX_NAME`].
    #[error("{op}: {field} must be at most {limit} bytes long, got {length}")]
    TooLong {
        /// The operation.
        op: &'static str,
        /// The field.
        field: &'static str,
        /// Its limit in bytes.
        limit: usize,
        /// Its length in bytes.
        length: usize,
    },
}
