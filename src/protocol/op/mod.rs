//! Every rosbridge operation that a client may send, read from a frame.
//!
//! Payloads (`msg`, `args`, `values`) stay raw. Only the syntax of a forwarded payload is parsed.
//!
//! **Invariant:** every frame gives exactly one operation or exactly one error that names the fault. Both have the `id`
//! of a frame that is valid JSON. A member is read only for operations that have it. For all others only its syntax is
//! checked.

mod control;
pub mod fields;
mod problems;
mod providers;
mod rejections;
#[cfg(feature = "runtime")]
pub mod token;
mod types;

use std::time::Duration;

use serde_json::value::RawValue;

pub use self::problems::{OpError, Problem};
use self::types::duration;
pub use self::types::{
    ActionGoal, Compression, Encoding, GoalStatus, MAX_QUEUE_LENGTH, MAX_THROTTLE, MAX_TIMEOUT,
    ProviderOp, Served, Subscribe, Verbosity,
};
use super::messages::ErrorForm;
pub use crate::protocol::limits::MAX_NAME;
use crate::protocol::wire::fragments::Piece;
use crate::protocol::wire::frame::RawFrame;
use crate::protocol::wire::json::{self, Payload};
use crate::protocol::wire::series::Series;
use crate::protocol::wire::text;

/// A parsed frame.
#[derive(Debug)]
pub struct Incoming {
    /// The sender's `id`, also if the operation has an error. A frame that is not valid JSON has none.
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

// ---- reading --------------------------------------------------------------------------------------------------------

/// The members of a frame that the runtime reads.
const KEYS: [&str; 25] = [
    "op",
    "id",
    "topic",
    "type",
    "msg",
    "throttle_rate",
    "queue_length",
    "service",
    "args",
    "timeout",
    "values",
    "result",
    "status",
    "level",
    "errors",
    "token",
    "command",
    "compression",
    "fragment_size",
    "data",
    "num",
    "total",
    "action",
    "action_type",
    "feedback",
];

/// The known operations, by their names on the wire.
pub const OPS: [&str; 18] = [
    "advertise",
    "unadvertise",
    "publish",
    "subscribe",
    "unsubscribe",
    "advertise_service",
    "unadvertise_service",
    "call_service",
    "service_response",
    "set_level",
    "auth",
    "fragment",
    "send_action_goal",
    "cancel_action_goal",
    "advertise_action",
    "unadvertise_action",
    "action_feedback",
    "action_result",
];

/// The value that a name must have.
const A_NAME: &str = "a non-empty string";

/// Decodes a frame, and reads its op or its error. `None` for a message that has only white space.
#[must_use]
pub fn read_raw(frame: RawFrame) -> Option<Incoming> {
    Some(match frame.decode()? {
        Ok(text) => read(&text),
        Err((error, start)) => Incoming::of_start(&start, &error),
    })
}

/// Reads a frame. Unknown members are ignored. Of a repeated member the last one counts.
#[must_use]
pub fn read(frame: &str) -> Incoming {
    let (mut members, read) = Members::of(frame);
    if let Err(error) = read {
        return members.refused(Problem::not_json(&error));
    }
    let id = members.get("id").map(Payload::from);
    let op = match members.known_op() {
        Ok(op) => {
            members.op = op;
            members.operation()
        }
        Err(problem) => Err(OpError::Status(problem)),
    };
    Incoming { id, op }
}

/// The members of one frame.
struct Members<'a> {
    /// The operation, which the errors name. It is empty until it is known.
    op: &'static str,
    values: [Option<&'a RawValue>; KEYS.len()],
}

impl<'a> Members<'a> {
    /// The members of `frame`. If it is not valid JSON, the members before the fault, and the fault.
    fn of(frame: &'a str) -> (Self, Result<(), serde_json::Error>) {
        let mut values = [None; KEYS.len()];
        let read = json::members_into(frame, &KEYS, &mut values);
        (Self { op: "", values }, read)
    }

    /// The member of that name, which must be one of [`KEYS`].
    fn get(&self, field: &'static str) -> Option<&'a RawValue> {
        let index = KEYS.iter().position(|key| *key == field)?;
        self.values.get(index).copied().flatten()
    }

    /// The value of a field that is present and not `null`.
    fn given(&self, field: &'static str) -> Option<&'a RawValue> {
        self.get(field).filter(|raw| raw.get() != "null")
    }

    /// Its operation, one of [`OPS`].
    fn known_op(&self) -> Result<&'static str, Problem> {
        let raw = self.get("op").ok_or(Problem::NoOp)?;
        let op = json::text(raw).ok_or_else(|| Problem::OpNotText(text::found(raw)))?;
        OPS.into_iter()
            .find(|known| *known == op)
            .ok_or_else(|| Problem::UnknownOp(text::excerpt(&op)))
    }

    /// An optional member, read by `read`. If `read` returns `None`, the value is not the `expected` one.
    fn optional<T>(
        &self,
        field: &'static str,
        expected: &'static str,
        read: impl FnOnce(&'a RawValue) -> Option<T>,
    ) -> Result<Option<T>, Problem> {
        let Some(raw) = self.get(field) else {
            return Ok(None);
        };
        let mistyped = || Problem::Mistyped {
            op: self.op,
            field,
            expected,
            found: text::found(raw),
        };
        read(raw).map(Some).ok_or_else(mistyped)
    }

    /// The same for a required member.
    fn typed<T>(
        &self,
        field: &'static str,
        expected: &'static str,
        read: impl FnOnce(&'a RawValue) -> Option<T>,
    ) -> Result<T, Problem> {
        let value = self.optional(field, expected, read)?;
        value.ok_or(Problem::Missing { op: self.op, field })
    }

    /// A topic or service name.
    fn name(&self, field: &'static str) -> Result<String, Problem> {
        let name = self.typed(field, A_NAME, |raw| {
            json::text(raw).filter(|name| !name.is_empty())
        })?;
        self.short(field, &name)?;
        Ok(name.into_owned())
    }

    /// Refuses a text that is longer than a name may be.
    fn short(&self, field: &'static str, text: &str) -> Result<(), Problem> {
        let limit = MAX_NAME;
        if text.len() <= limit {
            return Ok(());
        }
        Err(Problem::TooLong {
            op: self.op,
            field,
            limit,
            length: text.len(),
        })
    }

    /// A ROS message, which is an object.
    fn object(&self, field: &'static str) -> Result<Payload, Problem> {
        let object = self.typed(field, "an object", |raw| {
            raw.get().starts_with('{').then_some(raw)
        })?;
        Ok(object.into())
    }

    fn call(&self) -> Result<CallService, Problem> {
        Ok(CallService {
            service: self.name("service")?,
            timeout: self.timeout()?,
            args: self.args(),
        })
    }

    fn args(&self) -> Arguments {
        let args = self.get("args").filter(|args| args.get() != "null");
        args.map_or_else(Payload::empty_object, Payload::from)
    }

    /// As in rosbridge, 0 or less means no timeout, which here is the longest one.
    fn timeout(&self) -> Result<Option<Duration>, Problem> {
        let timeout = self.optional("timeout", "a finite number of seconds", |raw| {
            json::number(raw).filter(|timeout| timeout.is_finite())
        })?;
        Ok(timeout.map(|timeout| match timeout {
            0.0 => MAX_TIMEOUT,
            _ => duration(timeout, MAX_TIMEOUT),
        }))
    }

    fn operation(&self) -> Result<Op, OpError> {
        let (kind, read) = match self.op {
            "publish" => {
                return Ok(Op::Publish {
                    topic: self.name("topic")?,
                    msg: self.object("msg")?,
                });
            }
            "call_service" => (Served::Service, self.call().map(Op::CallService)),
            "send_action_goal" => (Served::Action, self.goal().map(Op::SendActionGoal)),
            _ => return self.or_bad_answer(self.other()),
        };
        read.map_err(|problem| self.fault(kind, problem))
    }
}
