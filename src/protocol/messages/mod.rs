//! The messages that the runtime sends: their types, and encoders that end each frame with a newline.
//!
//! Numbers that are not finite are written as `null`, in the runtime's own messages (by `serde_json`) and in forwarded
//! payloads ([`Payload`]).
//!
//! **Invariant:** one frame is one line of valid JSON.

pub mod scene;
mod telemetry;

use bytes::Bytes;
use serde::Serialize;

pub use self::telemetry::{
    Clock, DiagnosticArray, DiagnosticStatus, ErrorEstimateMessage, Header, JointState, KeyValue,
    Stamp,
};
use crate::protocol::catalog::table;
use crate::protocol::wire::json::Payload;
use crate::protocol::wire::lines;

/// Initial capacity of a frame. The state of a 3-link arm and every status fit.
const USUAL_FRAME: usize = 512;

table! {
    /// The severity of a status, the lowest first.
    pub enum Level of name {
        /// Information.
        Info = "info",
        /// Something was unexpected, but the operation was done.
        Warning = "warning",
        /// The operation was not done.
        Error = "error",
    }
}

table! {
    /// The form in which `values` of a response with `result: false` gives the reason.
    #[derive(Default)]
    pub enum ErrorForm of name {
        /// An object, as in any other response. This is the default over raw TCP.
        #[default]
        Object = "object",
        /// The text of `status`, as in `rosbridge_suite`. This is the default over WebSocket.
        Text = "text",
    }
}

/// A forwarded message of a client; `msg` is valid JSON.
#[must_use]
pub fn publish_raw(topic: &str, msg: &Payload) -> Bytes {
    Encoder::with_payload("publish", msg)
        .value("topic", topic)
        .value("msg", msg)
        .end()
}

/// The answer to a service call. `values` is an object. `reason` becomes its `status`, and is empty on success. `values`
/// of another client are forwarded.
#[must_use]
pub fn response(
    service: &str,
    id: Option<&Payload>,
    values: &impl Serialize,
    result: bool,
    reason: &str,
) -> Bytes {
    Encoder::op("service_response")
        .value("service", service)
        .optional("id", id)
        .value("values", values)
        .value("result", &result)
        .value("status", reason)
        .end()
}

/// A message of a node on a topic.
#[must_use]
pub fn publish(topic: &str, msg: &impl Serialize) -> Bytes {
    Encoder::op("publish")
        .value("topic", topic)
        .value("msg", msg)
        .end()
}

/// A frame of [`publish`] for `topic`, or a [series](crate::protocol::wire::series) of them, rewritten for subscribers
/// with another spelling of the name.
#[must_use]
pub fn respelled(topic: &str, spelling: &str, frames: &Bytes) -> Bytes {
    if topic == spelling {
        return frames.clone();
    }
    let mut text = Vec::with_capacity(frames.len());
    for frame in lines::messages(frames.clone()) {
        let mut line = Encoder::after(text, "publish").value("topic", spelling);
        line.key("msg");
        line.text.extend_from_slice(message_text(topic, &frame));
        line.text.extend_from_slice(b"}\n");
        text = line.text;
    }
    text.shrink_to_fit();
    Bytes::from(text)
}

/// The message in a frame of [`publish`] for `topic`, as JSON.
#[must_use]
pub fn message_text<'a>(topic: &str, frame: &'a [u8]) -> &'a [u8] {
    let quoted = serde_json::to_string(topic).map_or(0, |quoted| quoted.len());
    let head = "{\"op\":\"publish\",\"topic\":,\"msg\":".len() + quoted;
    let msg = frame.get(head..frame.len().saturating_sub("}\n".len()));
    debug_assert!(msg.is_some(), "{topic} is not what this frame is about");
    msg.unwrap_or(b"null")
}

/// The answer to a failed call. `status` has the reason; `values` is `{}` or has the reason.
#[must_use]
pub fn failure(service: &str, id: Option<&Payload>, status: &str, form: ErrorForm) -> Bytes {
    match form {
        ErrorForm::Object => response(service, id, &Empty {}, false, status),
        ErrorForm::Text => response(service, id, &status, false, status),
    }
}

/// Feedback of a goal.
#[must_use]
pub fn action_feedback(action: &str, id: Option<&Payload>, values: &impl Serialize) -> Bytes {
    Encoder::op("action_feedback")
        .value("action", action)
        .optional("id", id)
        .value("values", values)
        .end()
}

/// The end of a goal. `status` is a value of `action_msgs/msg/GoalStatus`. If `result` is false, `values` has the
/// reason.
#[must_use]
pub fn action_result(
    action: &str,
    id: Option<&Payload>,
    values: &impl Serialize,
    status: u8,
    result: bool,
) -> Bytes {
    Encoder::op("action_result")
        .value("action", action)
        .optional("id", id)
        .value("values", values)
        .value("status", &status)
        .value("result", &result)
        .end()
}

/// A goal for an action server that is a client, under an id of the runtime. `args` are forwarded.
#[must_use]
pub fn action_goal(
    action: &str,
    id: &str,
    type_name: Option<&str>,
    args: &Payload,
    feedback: bool,
) -> Bytes {
    Encoder::with_payload("send_action_goal", args)
        .value("action", action)
        .value("id", id)
        .optional("action_type", type_name)
        .value("args", args)
        .value("feedback", &feedback)
        .end()
}

/// Asks the action server of a client to cancel a goal.
#[must_use]
pub fn cancellation(action: &str, id: &str) -> Bytes {
    Encoder::op("cancel_action_goal")
        .value("action", action)
        .value("id", id)
        .end()
}

/// A status.
#[must_use]
pub fn status(level: Level, msg: &str, id: Option<&Payload>) -> Bytes {
    Encoder::op("status")
        .value("level", level.name())
        .value("msg", msg)
        .optional("id", id)
        .end()
}

/// A call for a provider that is a client, under an id of the runtime. `args` are forwarded.
#[must_use]
pub fn call(service: &str, id: &str, args: &Payload) -> Bytes {
    Encoder::with_payload("call_service", args)
        .value("service", service)
        .value("id", id)
        .value("args", args)
        .end()
}

/// `{}`, the `values` of a response that has none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Empty {}

/// A frame under construction. Its members are in the order of the calls.
struct Encoder {
    text: Vec<u8>,
}

impl Encoder {
    fn op(op: &str) -> Self {
        Self::after(Vec::with_capacity(USUAL_FRAME), op)
    }

    /// A frame that also has capacity for the payload, so it is not copied.
    fn with_payload(op: &str, payload: &Payload) -> Self {
        let bytes = USUAL_FRAME + payload.line().len();
        Self::after(Vec::with_capacity(bytes), op)
    }

    /// Appends a frame to the bytes.
    fn after(mut text: Vec<u8>, op: &str) -> Self {
        text.extend_from_slice(b"{\"op\":\"");
        text.extend_from_slice(op.as_bytes());
        text.push(b'"');
        Self { text }
    }

    fn key(&mut self, key: &str) {
        self.text.extend_from_slice(b",\"");
        self.text.extend_from_slice(key.as_bytes());
        self.text.extend_from_slice(b"\":");
    }

    fn value<T: Serialize + ?Sized>(mut self, key: &str, value: &T) -> Self {
        self.key(key);
        let start = self.text.len();
        if serde_json::to_writer(&mut self.text, value).is_err() {
            // Writing to a `Vec` cannot fail, and all types here can be serialised. Otherwise the frame would still
            // be valid.
            debug_assert!(false, "{key} can't be written as JSON");
            self.text.truncate(start);
            self.text.extend_from_slice(b"null");
        }
        self
    }

    fn optional<T: Serialize + ?Sized>(self, key: &str, value: Option<&T>) -> Self {
        match value {
            Some(value) => self.value(key, value),
            None => self,
        }
    }

    fn end(mut self) -> Bytes {
        self.text.extend_from_slice(b"}\n");
        // The frame may wait for long, and only its bytes are counted, so its spare capacity is freed.
        self.text.shrink_to_fit();
        Bytes::from(self.text)
    }
}
