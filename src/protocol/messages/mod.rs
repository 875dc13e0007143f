//! The messages that the runtime sends: their types, and encoders that end each frame with a newline.
//!
//! Numbers that are not finite are written as `null`, in the runtime's own messages (by `serde_json`) and in forwarded
//! payloads ([`Payload`]).
//!
//! **Invariant:** one frame is one line of valid JSON.

mod answers;
pub mod scene;
mod telemetry;

use bytes::Bytes;
use serde::Serialize;

pub use self::answers::{
    Empty, ErrorForm, Level, action_feedback, action_goal, action_result, call, cancellation,
    failure, publish, response, status,
};
pub use self::telemetry::{
    Clock, DiagnosticArray, DiagnosticStatus, ErrorEstimateMessage, Header, JointState, KeyValue,
    Stamp,
};
use crate::protocol::wire::json::Payload;
use crate::protocol::wire::lines;

/// Initial capacity of a frame. The state of a 3-link arm and every status fit.
const USUAL_FRAME: usize = 512;

/// A forwarded message of a client; `msg` is valid JSON.
#[must_use]
pub fn publish_raw(topic: &str, msg: &Payload) -> Bytes {
    Encoder::with_room("publish", msg)
        .value("topic", topic)
        .value("msg", msg)
        .end()
}

/// A frame of [`publish`] for `topic`, or a [series](lines) of them, rewritten for subscribers with another spelling of
/// the name.
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

/// A frame under construction. Its members are in the order of the calls.
struct Encoder {
    text: Vec<u8>,
}

impl Encoder {
    fn op(op: &str) -> Self {
        Self::after(Vec::with_capacity(USUAL_FRAME), op)
    }

    /// A frame that also has room for the payload, so it is not copied.
    fn with_room(op: &str, payload: &Payload) -> Self {
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

    fn end(mut self) -> Bytes {
        self.text.extend_from_slice(b"}\n");
        // The frame may wait for long, and only its bytes are counted, so its spare capacity is freed.
        self.text.shrink_to_fit();
        Bytes::from(self.text)
    }
}
