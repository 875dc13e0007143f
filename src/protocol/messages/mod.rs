//! The messages that the runtime sends: their types, and encoders that end each frame with a newline.
//!
//! Numbers that are not finite are written as `null`, in the runtime's own messages (by `serde_json`) and in forwarded
//! payloads ([`Payload`]).
//!
//! **Invariant:** one frame is one line of valid JSON.

mod frames;
pub mod scene;
mod telemetry;

use bytes::Bytes;
use serde::Serialize;

pub use self::frames::{
    Empty, ErrorForm, Level, action_feedback, action_goal, action_result, call, cancellation,
    failure, message_text, publish, respelled, status,
};
pub use self::telemetry::{
    Clock, DiagnosticArray, DiagnosticStatus, ErrorEstimateMessage, Header, JointState, KeyValue,
    Stamp,
};
use crate::protocol::wire::json::Payload;

/// Initial capacity of a frame. The state of a 3-link arm and every status fit.
const USUAL_FRAME: usize = 512;

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
