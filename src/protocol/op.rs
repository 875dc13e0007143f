//! Every rosbridge operation that a client may send, read from a frame.
//!
//! Payloads (`msg`, `args`, `values`) stay raw: what only passes through is never parsed further than its syntax.
//!
//! **Invariant:** every frame gives exactly one operation or exactly one error that names what is wrong with it, and its `id`
//! either way.

use std::borrow::Cow;
use std::time::Duration;

use serde_json::value::RawValue;

use super::json;
use super::text;

/// Longest topic or service name, and subscription id, in bytes: the registry keeps them for as long as a connection lives.
pub const MAX_NAME: usize = 1024;
/// Longest `throttle_rate`: a year; beyond it, a delivery is never due in a connection's lifetime.
pub const MAX_THROTTLE: Duration = Duration::from_secs(365 * 24 * 3600);
/// Largest `queue_length`: the [outbox](super::outbox) bounds what is held back by bytes, and no message is shorter than 40.
pub const MAX_QUEUE_LENGTH: usize = 100_000;
/// Longest `timeout` of a forwarded call: a day.
pub const MAX_TIMEOUT: Duration = Duration::from_secs(24 * 3600);
/// Characters of the JSON parser's complaint that go into a message: it may quote the client.
const MAX_COMPLAINT: usize = 160;

/// A frame, read.
#[derive(Debug)]
pub struct Incoming {
    /// The sender's `id`, as it came; there also where the operation is in error.
    pub id: Option<Box<RawValue>>,
    /// What is asked for.
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
    /// Withdraws that.
    Unadvertise {
        /// Topic name.
        topic: String,
    },
    /// Delivers a message to the topic's subscribers.
    Publish {
        /// Topic name.
        topic: String,
        /// The message, an object.
        msg: Box<RawValue>,
    },
    /// Registers the sender as a subscriber.
    Subscribe(Subscribe),
    /// Withdraws one subscription (the frame's id) or all.
    Unsubscribe {
        /// Topic name.
        topic: String,
    },
    /// Makes the sender the provider of a service.
    AdvertiseService {
        /// Service name.
        service: String,
        /// Service type, if given.
        type_name: Option<String>,
    },
    /// Withdraws that.
    UnadvertiseService {
        /// Service name.
        service: String,
    },
    /// Calls a service.
    CallService(CallService),
    /// A provider's answer to a forwarded call.
    ServiceResponse {
        /// Service name.
        service: String,
        /// Any value.
        values: Box<RawValue>,
        /// Whether the call succeeded.
        result: bool,
        /// The provider's own `status`, if it is a string.
        status: Option<String>,
    },
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
    /// How many messages throttling may hold back; 1 to [`MAX_QUEUE_LENGTH`].
    pub queue_length: usize,
}

/// A service call.
#[derive(Debug, Clone)]
pub struct CallService {
    /// Service name.
    pub service: String,
    /// Its arguments.
    pub args: Arguments,
    /// How long an external provider may take, if given; at most [`MAX_TIMEOUT`].
    pub timeout: Option<Duration>,
}

/// The arguments of a call.
#[derive(Debug, Clone)]
pub enum Arguments {
    /// Fields by name; `{}` where `args` was absent or `null`.
    Object(Box<RawValue>),
    /// Fields in documented order.
    Positional(Box<RawValue>),
}

impl Arguments {
    /// No arguments: `{}`.
    #[must_use]
    pub fn none() -> Self {
        Self::Object(RawValue::from_string("{}".to_owned()).unwrap_or_default())
    }

    /// The arguments as they came.
    #[must_use]
    pub fn raw(&self) -> &RawValue {
        match self {
            Self::Object(raw) | Self::Positional(raw) => raw,
        }
    }
}

/// Why a frame is no operation, and how its sender hears of it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum OpError {
    /// Answered by an error `status`.
    #[error("{0}")]
    Status(Problem),
    /// A call that can be told apart from others by its service and id: answered by `service_response` with `result: false`.
    #[error("{problem}")]
    Call {
        /// The service that was called.
        service: String,
        /// What is wrong.
        problem: Problem,
    },
}

/// What is wrong with an operation.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Problem {
    /// Not a JSON object; holds the parser's complaint, shortened.
    #[error("malformed frame: {0}")]
    NotJson(String),
    /// There is no `op`.
    #[error("malformed frame: op is required")]
    NoOp,
    /// `op` is no string; holds what it is.
    #[error("malformed frame: op must be a string, got {0}")]
    OpNotText(String),
    /// No operation of ours; holds its name, shortened.
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
    /// A field is not what it has to be.
    #[error("{op}: {field} must be {expected}, got {found}")]
    Mistyped {
        /// The operation.
        op: &'static str,
        /// The field.
        field: &'static str,
        /// What it has to be.
        expected: &'static str,
        /// What it is, shortened.
        found: String,
    },
    /// A name or id is longer than [`MAX_NAME`] bytes.
    #[error("{op}: {field} must be at most {MAX_NAME} bytes long, got {length}")]
    TooLong {
        /// The operation.
        op: &'static str,
        /// The field.
        field: &'static str,
        /// How long it is, in bytes.
        length: usize,
    },
}

/// The members of a frame that mean something to us.
const KEYS: [&str; 13] = [
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
];

/// The operations that we know.
const OPS: [&str; 9] = [
    "advertise",
    "unadvertise",
    "publish",
    "subscribe",
    "unsubscribe",
    "advertise_service",
    "unadvertise_service",
    "call_service",
    "service_response",
];

/// Reads a frame. Members that we do not know are ignored; of a repeated one the last counts.
#[must_use]
pub fn read(frame: &str) -> Incoming {
    let members = match json::members(frame, &KEYS) {
        Ok(members) => members,
        Err(error) => {
            let complaint = text::shortened(&error.to_string(), MAX_COMPLAINT);
            return Incoming {
                id: None,
                op: Err(OpError::Status(Problem::NotJson(complaint))),
            };
        }
    };
    let reader = Reader { op: "", members };
    let id = reader.get("id").map(ToOwned::to_owned);
    let op = match reader.known_op() {
        Ok(op @ "call_service") => Reader { op, ..reader }.call(),
        Ok(op) => Reader { op, ..reader }.other().map_err(OpError::Status),
        Err(problem) => Err(OpError::Status(problem)),
    };
    Incoming { id, op }
}

/// Reads the members of one frame.
struct Reader<'a> {
    op: &'static str,
    members: [Option<&'a RawValue>; KEYS.len()],
}

impl<'a> Reader<'a> {
    fn known_op(&self) -> Result<&'static str, Problem> {
        let raw = self.get("op").ok_or(Problem::NoOp)?;
        let op = json::text(raw).ok_or_else(|| Problem::OpNotText(text::found(raw)))?;
        OPS.into_iter()
            .find(|known| *known == op)
            .ok_or_else(|| Problem::UnknownOp(text::excerpt(&op)))
    }

    /// A call. As soon as its service is known it can be answered as a call, whatever else is wrong.
    fn call(&self) -> Result<Op, OpError> {
        let service = self.name("service").map_err(OpError::Status)?;
        let rest = self.args().and_then(|args| Ok((args, self.timeout()?)));
        match rest {
            Ok((args, timeout)) => Ok(Op::CallService(CallService {
                service,
                args,
                timeout,
            })),
            Err(problem) => Err(OpError::Call { service, problem }),
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
                msg: self.message()?,
            },
            "subscribe" => Op::Subscribe(self.subscription()?),
            "unsubscribe" => Op::Unsubscribe {
                topic: self.name("topic")?,
            },
            "advertise_service" => Op::AdvertiseService {
                service: self.name("service")?,
                type_name: self.optional_text("type")?,
            },
            "unadvertise_service" => Op::UnadvertiseService {
                service: self.name("service")?,
            },
            _ => self.response()?,
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
        })
    }

    fn response(&self) -> Result<Op, Problem> {
        self.required("id")?;
        Ok(Op::ServiceResponse {
            service: self.name("service")?,
            values: self.required("values")?.to_owned(),
            result: self.boolean("result")?,
            status: self.get("status").and_then(json::text).map(Cow::into_owned),
        })
    }

    /// The member of that name; it is one of [`KEYS`].
    fn get(&self, field: &'static str) -> Option<&'a RawValue> {
        let index = KEYS.iter().position(|key| *key == field)?;
        self.members.get(index).copied().flatten()
    }

    fn required(&self, field: &'static str) -> Result<&'a RawValue, Problem> {
        self.get(field)
            .ok_or(Problem::Missing { op: self.op, field })
    }

    fn mistyped(&self, field: &'static str, expected: &'static str, raw: &RawValue) -> Problem {
        Problem::Mistyped {
            op: self.op,
            field,
            expected,
            found: text::found(raw),
        }
    }

    /// A topic or service name.
    fn name(&self, field: &'static str) -> Result<String, Problem> {
        let raw = self.required(field)?;
        let name = json::text(raw).filter(|name| !name.is_empty());
        let name = name.ok_or_else(|| self.mistyped(field, "a non-empty string", raw))?;
        self.short(field, &name)?;
        Ok(name.into_owned())
    }

    fn short(&self, field: &'static str, text: &str) -> Result<(), Problem> {
        if text.len() <= MAX_NAME {
            return Ok(());
        }
        Err(Problem::TooLong {
            op: self.op,
            field,
            length: text.len(),
        })
    }

    fn optional_text(&self, field: &'static str) -> Result<Option<String>, Problem> {
        let Some(raw) = self.get(field) else {
            return Ok(None);
        };
        let text = json::text(raw).ok_or_else(|| self.mistyped(field, "a string", raw))?;
        self.short(field, &text)?;
        Ok(Some(text.into_owned()))
    }

    fn boolean(&self, field: &'static str) -> Result<bool, Problem> {
        let raw = self.required(field)?;
        json::boolean(raw).ok_or_else(|| self.mistyped(field, "true or false", raw))
    }

    /// A ROS message is an object.
    fn message(&self) -> Result<Box<RawValue>, Problem> {
        let raw = self.required("msg")?;
        if raw.get().starts_with('{') {
            return Ok(raw.to_owned());
        }
        Err(self.mistyped("msg", "an object", raw))
    }

    fn throttle(&self) -> Result<Duration, Problem> {
        let Some(raw) = self.get("throttle_rate") else {
            return Ok(Duration::ZERO);
        };
        let throttle_ms = json::number(raw)
            .filter(|rate| rate.is_finite() && *rate >= 0.0)
            .ok_or_else(|| self.mistyped("throttle_rate", "a number of ms, at least 0", raw))?;
        Ok(duration(throttle_ms / 1000.0, MAX_THROTTLE))
    }

    fn queue_length(&self) -> Result<usize, Problem> {
        let Some(raw) = self.get("queue_length") else {
            return Ok(1);
        };
        let length = json::integer(raw)
            .ok_or_else(|| self.mistyped("queue_length", "an integer, at least 0", raw))?;
        Ok(usize::try_from(length)
            .unwrap_or(MAX_QUEUE_LENGTH)
            .clamp(1, MAX_QUEUE_LENGTH))
    }

    fn args(&self) -> Result<Arguments, Problem> {
        let Some(raw) = self.get("args") else {
            return Ok(Arguments::none());
        };
        match raw.get().as_bytes().first() {
            Some(b'{') => Ok(Arguments::Object(raw.to_owned())),
            Some(b'[') => Ok(Arguments::Positional(raw.to_owned())),
            Some(b'n') => Ok(Arguments::none()),
            _ => Err(self.mistyped("args", "an object or an array", raw)),
        }
    }

    fn timeout(&self) -> Result<Option<Duration>, Problem> {
        let Some(raw) = self.get("timeout") else {
            return Ok(None);
        };
        let timeout = json::number(raw)
            .filter(|timeout| timeout.is_finite() && *timeout > 0.0)
            .ok_or_else(|| self.mistyped("timeout", "a number of seconds greater than 0", raw))?;
        Ok(Some(duration(timeout, MAX_TIMEOUT)))
    }
}

/// A finite number of seconds, 0 or more, as a duration of at most `longest`.
fn duration(seconds: f64, longest: Duration) -> Duration {
    Duration::try_from_secs_f64(seconds).map_or(longest, |duration| duration.min(longest))
}
