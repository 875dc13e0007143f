//! Every rosbridge operation that a client may send, read from a frame.
//!
//! Payloads (`msg`, `args`, `values`) stay raw. Only the syntax of a forwarded payload is parsed.
//!
//! **Invariant:** every frame gives exactly one operation or exactly one error that names the fault, and its `id` in
//! both cases. A member is read only for operations that have it. For all others only its syntax is checked.

pub mod fields;
mod problems;
mod rejections;
#[cfg(feature = "runtime")]
pub mod token;

use std::borrow::Cow;
use std::time::Duration;

use serde_json::value::RawValue;

use super::messages::{ErrorForm, Level};
pub use crate::protocol::limits::MAX_NAME;
use crate::protocol::wire::fragments::Piece;
use crate::protocol::wire::json::Payload;
use crate::protocol::wire::series::Series;
use crate::protocol::wire::{json, text};
pub use problems::{OpError, Problem};

/// Longest `throttle_rate`: a year; beyond it, a delivery is never due in a connection's lifetime.
pub const MAX_THROTTLE: Duration = Duration::from_secs(365 * 24 * 3600);
/// Largest `queue_length`. The [outbox](super::outbox) bounds held messages by bytes, and no message has fewer than 40.
pub const MAX_QUEUE_LENGTH: usize = 100_000;
/// Longest `timeout` of a forwarded call: a day.
pub const MAX_TIMEOUT: Duration = Duration::from_secs(24 * 3600);
/// The value that a name must have.
const A_NAME: &str = "a non-empty string";
/// Longest part of the JSON parser's message in an answer, in characters. It may quote the client.
const MAX_PARSER_MESSAGE: usize = 160;

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

/// Reads a frame. Unknown members are ignored. Of a repeated member the last one counts.
#[must_use]
pub fn read(frame: &str) -> Incoming {
    let mut members = [None; KEYS.len()];
    let read = json::members_into(frame, &KEYS, &mut members);
    let reader = OpReader { op: "", members };
    if let Err(error) = read {
        let message = text::shortened(&error.to_string(), MAX_PARSER_MESSAGE);
        return reader.refused(Problem::NotJson(message));
    }
    let id = reader.get("id").map(Payload::from);
    let op = match reader.known_op() {
        Ok(op @ "call_service") => OpReader { op, ..reader }.call(),
        Ok(op @ "send_action_goal") => OpReader { op, ..reader }.goal(),
        Ok(op) => {
            let reader = OpReader { op, ..reader };
            reader.or_bad_answer(reader.other())
        }
        Err(problem) => Err(OpError::Status(problem)),
    };
    Incoming { id, op }
}

/// Reads the members of one frame.
struct OpReader<'a> {
    op: &'static str,
    members: [Option<&'a RawValue>; KEYS.len()],
}

impl<'a> OpReader<'a> {
    fn known_op(&self) -> Result<&'static str, Problem> {
        let raw = self.get("op").ok_or(Problem::NoOp)?;
        let op = json::text(raw).ok_or_else(|| Problem::OpNotText(text::found(raw)))?;
        OPS.into_iter()
            .find(|known| *known == op)
            .ok_or_else(|| Problem::UnknownOp(text::excerpt(&op)))
    }

    /// A call. If its service is a text, every fault gets a `service_response`.
    fn call(&self) -> Result<Op, OpError> {
        self.valid_call().map(Op::CallService).map_err(|problem| {
            let answer = |service, problem| OpError::Call { service, problem };
            self.fault("service", problem, answer)
        })
    }

    fn valid_call(&self) -> Result<CallService, Problem> {
        Ok(CallService {
            service: self.name("service")?,
            timeout: self.timeout()?,
            args: self.args(),
        })
    }

    /// A fault of a call or a goal. Its `answer` needs the name in this field, which may be empty or too long. Without a
    /// text there, the fault is that.
    fn fault(
        &self,
        field: &'static str,
        problem: Problem,
        answer: impl FnOnce(String, Problem) -> OpError,
    ) -> OpError {
        match self.typed(field, A_NAME, json::text) {
            Ok(name) => answer(name.into_owned(), problem),
            Err(no_text) => OpError::Status(no_text),
        }
    }

    /// Any other operation.
    fn other(&self) -> Result<Op, Problem> {
        Ok(match self.op {
            "advertise" => Op::Advertise {
                topic: self.name("topic")?,
                type_name: self.optional_text("type")?,
            },
            "unadvertise" => Op::Unadvertise {
                topic: self.name("topic")?,
            },
            "publish" => Op::Publish {
                topic: self.name("topic")?,
                msg: self.object("msg")?,
            },
            "subscribe" => Op::Subscribe(self.subscription()?),
            "unsubscribe" => Op::Unsubscribe {
                topic: self.name("topic")?,
            },
            "cancel_action_goal" => Op::CancelActionGoal {
                action: self.name("action")?,
            },
            "fragment" => Op::Fragment(self.piece()?),
            "set_level" => Op::SetLevel {
                verbosity: self.verbosity()?,
                errors: self.error_form()?,
            },
            "auth" => self.auth()?,
            op if op.contains("action") => self.serve(Served::Action)?,
            _ => self.serve(Served::Service)?,
        })
    }

    fn subscription(&self) -> Result<Subscribe, Problem> {
        if let Some(id) = self.get("id") {
            self.short("id", id.get())?;
        }
        Ok(Subscribe {
            topic: self.name("topic")?,
            type_name: self.optional_text("type")?,
            throttle: self.throttle()?,
            queue_length: self.queue_length()?,
            // Merging with the default removes the fragment size of a binary encoding, which is never split.
            encoding: Encoding::default().merged(Encoding {
                compression: self.compression()?,
                fragment_size: self.fragment_size()?,
                ros1_stamps: false,
            }),
        })
    }

    fn compression(&self) -> Result<Compression, Problem> {
        let expected = "none, png, cbor or cbor-raw";
        let compression = self.optional("compression", expected, |raw| {
            match json::text(raw)?.as_ref() {
                "none" | "png" => Some(Compression::None),
                "cbor" => Some(Compression::Cbor),
                "cbor-raw" => Some(Compression::CborRaw),
                _ => None,
            }
        })?;
        Ok(compression.unwrap_or_default())
    }

    fn fragment_size(&self) -> Result<Option<usize>, Problem> {
        let size = self.optional("fragment_size", "an integer, at least 1", |raw| {
            match raw.get() {
                "null" => Some(None),
                _ => json::integer(raw).filter(|size| *size > 0).map(Some),
            }
        })?;
        // With only powers of two, a message is split in few ways, for any number of subscribers.
        let size = size.flatten().map(|size| 1 << size.ilog2());
        Ok(size.and_then(|size: u64| usize::try_from(size).ok()))
    }

    fn piece(&self) -> Result<Piece, Problem> {
        let id = self.required("id")?;
        self.short("id", id.get())?;
        // A number that does not fit is refused as too large below.
        let index = |field| {
            let number = self.typed(field, "an integer, at least 0", json::integer)?;
            Ok(usize::try_from(number).unwrap_or(usize::MAX))
        };
        Ok(Piece {
            id: id.get().to_owned(),
            data: self.typed("data", "a string", json::text)?.into_owned(),
            num: index("num")?,
            total: index("total")?,
        })
    }

    fn verbosity(&self) -> Result<Verbosity, Problem> {
        let expected = "info, warning, error or none";
        self.typed("level", expected, |raw| {
            let name = json::text(raw)?;
            let mut levels = Level::ALL.into_iter();
            let level = levels.find(|level| level.name() == name);
            (level.is_some() || name == "none").then_some(Verbosity(level))
        })
    }

    fn error_form(&self) -> Result<Option<ErrorForm>, Problem> {
        self.optional("errors", "object or text", |raw| {
            let name = json::text(raw)?;
            let mut forms = ErrorForm::ALL.into_iter();
            forms.find(|form| form.name() == name)
        })
    }

    /// Reads a client's token, if there is one. A command of this program marks itself.
    fn auth(&self) -> Result<Op, Problem> {
        let is_command = self.get("command").is_some() && self.boolean("command")?;
        let token = self.get("token").map(|raw| self.secret(raw)).transpose()?;
        Ok(Op::Auth { token, is_command })
    }

    /// A token. An error does not repeat it.
    fn secret(&self, raw: &RawValue) -> Result<String, Problem> {
        let token = json::text(raw).ok_or(Problem::Mistyped {
            op: self.op,
            field: "token",
            expected: "a string",
            found: "something else".to_owned(),
        })?;
        self.short("token", &token)?;
        Ok(token.into_owned())
    }

    /// The member of that name, which must be one of [`KEYS`].
    fn get(&self, field: &'static str) -> Option<&'a RawValue> {
        let index = KEYS.iter().position(|key| *key == field)?;
        self.members.get(index).copied().flatten()
    }

    fn required(&self, field: &'static str) -> Result<&'a RawValue, Problem> {
        self.typed(field, "", Some)
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

    fn optional_text(&self, field: &'static str) -> Result<Option<String>, Problem> {
        let text = self.optional(field, "a string", json::text)?;
        self.short(field, text.as_deref().unwrap_or_default())?;
        Ok(text.map(Cow::into_owned))
    }

    fn boolean(&self, field: &'static str) -> Result<bool, Problem> {
        self.typed(field, "true or false", json::boolean)
    }

    /// A ROS message, which is an object.
    fn object(&self, field: &'static str) -> Result<Payload, Problem> {
        let object = self.typed(field, "an object", |raw| {
            raw.get().starts_with('{').then_some(raw)
        })?;
        Ok(object.into())
    }

    fn throttle(&self) -> Result<Duration, Problem> {
        let expected = "a number of ms, at least 0";
        let rate = self.optional("throttle_rate", expected, |raw| {
            json::number(raw).filter(|rate| rate.is_finite() && *rate >= 0.0)
        })?;
        Ok(duration(rate.unwrap_or_default() / 1000.0, MAX_THROTTLE))
    }

    fn queue_length(&self) -> Result<usize, Problem> {
        let length = self.optional("queue_length", "an integer, at least 0", json::integer)?;
        let length = usize::try_from(length.unwrap_or_default());
        Ok(length.unwrap_or(MAX_QUEUE_LENGTH).min(MAX_QUEUE_LENGTH))
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
        Ok(timeout.map(|timeout| {
            if timeout > 0.0 {
                duration(timeout, MAX_TIMEOUT)
            } else {
                MAX_TIMEOUT
            }
        }))
    }
}

/// A finite number of seconds, 0 or more, as a duration of at most `longest`.
fn duration(seconds: f64, longest: Duration) -> Duration {
    Duration::try_from_secs_f64(seconds).map_or(longest, |duration| duration.min(longest))
}

// ---- goals and cancellations, and the ops of clients that serve -----------------------------------------------------

impl OpReader<'_> {
    /// A goal. If its action is a text, every fault gets an `action_result`.
    fn goal(&self) -> Result<Op, OpError> {
        self.valid_goal()
            .map(Op::SendActionGoal)
            .map_err(|problem| {
                let answer = |action, problem| OpError::Goal { action, problem };
                self.fault("action", problem, answer)
            })
    }

    fn valid_goal(&self) -> Result<ActionGoal, Problem> {
        if let Some(id) = self.get("id") {
            self.short("id", id.get())?;
        }
        Ok(ActionGoal {
            type_name: self.optional_text("action_type")?,
            args: self.args(),
            feedback: match self.get("feedback") {
                Some(_) => self.boolean("feedback")?,
                None => false,
            },
            action: self.name("action")?,
        })
    }

    /// An operation of a client that serves.
    fn serve(&self, kind: Served) -> Result<Op, Problem> {
        if matches!(
            self.op,
            "service_response" | "action_feedback" | "action_result"
        ) {
            self.required("id")?;
        }
        let name = self.name(kind.noun())?;
        let op = match self.op {
            "advertise_service" | "advertise_action" => ProviderOp::Advertise {
                type_name: self.optional_text("type")?,
            },
            "unadvertise_service" | "unadvertise_action" => ProviderOp::Unadvertise,
            "service_response" => {
                let result = self.boolean("result")?;
                ProviderOp::Respond {
                    // The values of a failure may be a text with the reason.
                    values: match result {
                        true => self.object("values")?,
                        false => self.required("values")?.into(),
                    },
                    result,
                    status: self
                        .optional("status", "a string", json::text)?
                        .map(Cow::into_owned),
                }
            }
            "action_feedback" => ProviderOp::Feedback {
                values: self.object("values")?,
            },
            _ => {
                let is_good = self.boolean("result")?;
                ProviderOp::End {
                    // Here they may be missing: a result without fields, or a failure without a reason.
                    values: match self.get("values") {
                        Some(_) if is_good => self.object("values")?,
                        None if is_good => Payload::empty_object(),
                        values => Payload::from(values.unwrap_or(RawValue::NULL)),
                    },
                    status: self.goal_status(is_good)?,
                    result: is_good,
                }
            }
        };
        Ok(Op::Serve { kind, name, op })
    }

    fn goal_status(&self, is_good: bool) -> Result<u8, Problem> {
        let status = self.optional("status", "an integer from 0 to 6", |raw| {
            let status = u8::try_from(json::integer(raw)?).ok();
            status.filter(|status| *status <= GoalStatus::Aborted as u8)
        })?;
        let usual = if is_good {
            GoalStatus::Succeeded
        } else {
            GoalStatus::Aborted
        };
        Ok(status.unwrap_or(usual as u8))
    }
}

// ---- answers: where one is bad, the op says which call or goal it is for --------------------------------------------

/// Reads the start of a frame that is refused for the reason `why`. It may be the answer to a call, which then fails.
#[must_use]
pub fn read_start(start: &[u8], why: &impl ToString) -> Incoming {
    let text = start.utf8_chunks().next();
    let mut members = [None; KEYS.len()];
    // The members before its end or its fault count.
    let _ = json::members_into(text.map_or("", |one| one.valid()), &KEYS, &mut members);
    OpReader { op: "", members }.refused(Problem::NotAFrame(why.to_string()))
}

impl OpReader<'_> {
    /// A frame that cannot be read to its end. Members before the fault count only for an answer.
    fn refused(self, problem: Problem) -> Incoming {
        let op = self.known_op().unwrap_or_default();
        let reader = OpReader { op, ..self };
        let op = reader.or_bad_answer(Err(problem));
        let id = reader.get("id").filter(|_| op.is_ok()).map(Payload::from);
        Incoming { id, op }
    }

    /// Converts a fault in the answer to a call or goal to an op that ends this call or goal.
    fn or_bad_answer(&self, read: Result<Op, Problem>) -> Result<Op, OpError> {
        let kind = match self.op {
            "service_response" => Served::Service,
            "action_result" => Served::Action,
            _ => return read.map_err(OpError::Status),
        };
        Ok(read.unwrap_or_else(|problem| Op::BadAnswer {
            kind,
            name: self.name(kind.noun()).ok(),
            problem,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_subscription_with_stamps_of_ros_1_suffices_for_a_client() {
        let plain = Encoding::default();
        let old = Encoding {
            ros1_stamps: true,
            ..plain
        };
        for (one, other, merged) in [(plain, old, old), (old, plain, old), (plain, plain, plain)] {
            assert_eq!(one.merged(other), merged);
        }
    }
}
