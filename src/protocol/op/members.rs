//! The members of a frame, each checked when it is read.
//!
//! **Invariant:** a member is read only for operations that have it. For all others only its syntax is checked.

use std::borrow::Cow;

use serde_json::value::RawValue;

use super::problems::Problem;
use crate::protocol::limits::MAX_NAME;
use crate::protocol::wire::json::{self, Payload};
use crate::protocol::wire::text;

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
pub(super) const A_NAME: &str = "a non-empty string";

/// The members of one frame.
pub(super) struct Members<'a> {
    /// The operation, which the errors name. It is empty until it is known.
    pub(super) op: &'static str,
    values: [Option<&'a RawValue>; KEYS.len()],
}

impl<'a> Members<'a> {
    /// The members of `frame`. If it is not valid JSON, the members before the fault, and the fault.
    pub(super) fn of(frame: &'a str) -> (Self, Result<(), serde_json::Error>) {
        let mut values = [None; KEYS.len()];
        let read = json::members_into(frame, &KEYS, &mut values);
        (Self { op: "", values }, read)
    }

    /// The member of that name, which must be one of [`KEYS`].
    pub(super) fn get(&self, field: &'static str) -> Option<&'a RawValue> {
        let index = KEYS.iter().position(|key| *key == field)?;
        self.values.get(index).copied().flatten()
    }

    /// The value of a field that is present and not `null`.
    pub(super) fn given(&self, field: &'static str) -> Option<&'a RawValue> {
        self.get(field).filter(|raw| raw.get() != "null")
    }

    /// Its operation, one of [`OPS`].
    pub(super) fn known_op(&self) -> Result<&'static str, Problem> {
        let raw = self.get("op").ok_or(Problem::NoOp)?;
        let op = json::text(raw).ok_or_else(|| Problem::OpNotText(text::found(raw)))?;
        OPS.into_iter()
            .find(|known| *known == op)
            .ok_or_else(|| Problem::UnknownOp(text::excerpt(&op)))
    }

    /// An optional member, read by `read`. If `read` returns `None`, the value is not the `expected` one.
    pub(super) fn optional<T>(
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
    pub(super) fn typed<T>(
        &self,
        field: &'static str,
        expected: &'static str,
        read: impl FnOnce(&'a RawValue) -> Option<T>,
    ) -> Result<T, Problem> {
        let value = self.optional(field, expected, read)?;
        value.ok_or(Problem::Missing { op: self.op, field })
    }

    /// A topic or service name.
    pub(super) fn name(&self, field: &'static str) -> Result<String, Problem> {
        let name = self.typed(field, A_NAME, |raw| {
            json::text(raw).filter(|name| !name.is_empty())
        })?;
        self.short(field, &name)?;
        Ok(name.into_owned())
    }

    /// Refuses a text that is longer than a name may be.
    pub(super) fn short(&self, field: &'static str, text: &str) -> Result<(), Problem> {
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
    pub(super) fn object(&self, field: &'static str) -> Result<Payload, Problem> {
        let object = self.typed(field, "an object", |raw| {
            raw.get().starts_with('{').then_some(raw)
        })?;
        Ok(object.into())
    }

    /// The arguments of a call or a goal.
    pub(super) fn args(&self) -> Payload {
        let args = self.given("args");
        args.map_or_else(Payload::empty_object, Payload::from)
    }

    pub(super) fn required(&self, field: &'static str) -> Result<&'a RawValue, Problem> {
        self.typed(field, "", Some)
    }

    pub(super) fn optional_text(&self, field: &'static str) -> Result<Option<String>, Problem> {
        let text = self.optional(field, "a string", json::text)?;
        self.short(field, text.as_deref().unwrap_or_default())?;
        Ok(text.map(Cow::into_owned))
    }

    pub(super) fn boolean(&self, field: &'static str) -> Result<bool, Problem> {
        self.typed(field, "true or false", json::boolean)
    }
}
