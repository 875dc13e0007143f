//! What the runtime sends: message types, and encoders that end each frame with a newline.
//!
//! Numbers that are not finite are written as `null`, in our own messages (`serde_json` does that) and in payloads that only
//! pass through ([`strict`](super::json::strict)).
//!
//! **Invariant:** one frame is one line of valid JSON.

use bytes::Bytes;
use serde::Serialize;
use serde_json::value::RawValue;

use super::{json, series};

/// Room for a frame before it grows: the state of a 3-link arm and any status of ours fit.
const USUAL_FRAME: usize = 512;
/// Above this size a frame's spare room is given back before it is queued.
const LARGE_FRAME: usize = 64 * 1024;
/// Nanoseconds in a second.
const NANOSECONDS: u32 = 1_000_000_000;

/// How serious a status is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Level {
    /// All is well.
    Info,
    /// Something was not as it should be, and was done all the same.
    Warning,
    /// Something was not done.
    Error,
}

impl Level {
    /// All levels, the least serious first.
    pub const ALL: [Self; 3] = [Self::Info, Self::Warning, Self::Error];

    /// The level's name on the wire.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Info => "info",
            Self::Warning => "warning",
            Self::Error => "error",
        }
    }
}

/// A time, seconds and nanoseconds. `0 <= nanosec < 1e9`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize)]
pub struct Stamp {
    /// Whole seconds.
    pub sec: i32,
    /// The rest, in nanoseconds.
    pub nanosec: u32,
}

impl Stamp {
    /// The last time that a stamp can hold.
    pub const MAX: Self = Self {
        sec: i32::MAX,
        nanosec: NANOSECONDS - 1,
    };

    /// `seconds` \[s\] to the nearest nanosecond. Saturates at [`Stamp::MAX`]; 0 for what is negative or no number.
    #[must_use]
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "both casts are of whole numbers within range; `as` saturates, and takes NaN to 0"
    )]
    pub fn from_seconds(seconds: f64) -> Self {
        let seconds = seconds.max(0.0);
        let whole = seconds.floor();
        if whole > f64::from(i32::MAX) {
            return Self::MAX;
        }
        let sec = whole as i32;
        let nanosec = ((seconds - whole) * f64::from(NANOSECONDS)).round() as u32;
        match (nanosec < NANOSECONDS, sec.checked_add(1)) {
            (true, _) => Self { sec, nanosec },
            (false, Some(sec)) => Self { sec, nanosec: 0 },
            (false, None) => Self::MAX,
        }
    }
}

/// `std_msgs/msg/Header`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Header<'a> {
    /// Simulation time.
    pub stamp: Stamp,
    /// `"world"` in what the arm publishes.
    pub frame_id: &'a str,
}

impl Header<'static> {
    /// A header in the world frame, at simulation time `time` \[s\].
    #[must_use]
    pub fn world(time: f64) -> Self {
        Self {
            stamp: Stamp::from_seconds(time),
            frame_id: "world",
        }
    }
}

/// `sensor_msgs/msg/JointState`; the four arrays have one entry per joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointState<'a> {
    /// Time and frame.
    pub header: Header<'a>,
    /// Joint names.
    pub name: &'a [&'a str],
    /// Positions \[rad\].
    pub position: &'a [f64],
    /// Velocities \[rad/s\].
    pub velocity: &'a [f64],
    /// Efforts \[N m\].
    pub effort: &'a [f64],
}

/// `trajectory_msgs/msg/JointTrajectory`, as sent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointTrajectory<'a> {
    /// Time and frame.
    pub header: Header<'a>,
    /// Joint names.
    pub joint_names: &'a [&'a str],
    /// The points; the last is held.
    pub points: &'a [JointTrajectoryPoint<'a>],
}

/// `trajectory_msgs/msg/JointTrajectoryPoint`, as sent.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointTrajectoryPoint<'a> {
    /// Positions \[rad\].
    pub positions: &'a [f64],
    /// Velocities \[rad/s\].
    pub velocities: &'a [f64],
    /// Accelerations \[rad/s²\]; empty: not prescribed.
    pub accelerations: &'a [f64],
    /// When to be there; 0: at once.
    pub time_from_start: Stamp,
}

/// `rosgraph_msgs/msg/Clock`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Clock {
    /// Simulation time.
    pub clock: Stamp,
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DiagnosticArray<'a> {
    /// Time and frame.
    pub header: Header<'a>,
    /// One status per part of the runtime.
    pub status: Vec<DiagnosticStatus<'a>>,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DiagnosticStatus<'a> {
    /// 0 all is well, 1 warning, 2 error.
    pub level: u8,
    /// The part of the runtime.
    pub name: &'a str,
    /// Its state in words.
    pub message: String,
    /// Empty: there is no hardware.
    pub hardware_id: &'a str,
    /// Details, by key.
    pub values: Vec<KeyValue<'a>>,
}

/// `diagnostic_msgs/msg/KeyValue`: both are strings.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct KeyValue<'a> {
    /// What it is.
    pub key: &'a str,
    /// Its value, printed.
    pub value: String,
}

/// `pendularm_interfaces/msg/ErrorEstimate`; what is not finite is written as `null`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorEstimate<'a> {
    /// The method that takes the steps.
    pub method: &'a str,
    /// Length of a step \[s\].
    pub timestep: f64,
    /// Largest error of a joint position after the next step \[rad\].
    pub local_error: f64,
    /// The same per timestep \[rad/s\].
    pub error_per_second: f64,
    /// The largest stable timestep at the present setpoint \[s\].
    pub predicted_limit: f64,
}

/// A message on a topic.
#[must_use]
pub fn publish(topic: &str, msg: &impl Serialize) -> Bytes {
    Line::op("publish")
        .text("topic", topic)
        .value("msg", msg)
        .end()
}

/// A message that a client sent, which only passes through; `msg` is valid JSON.
#[must_use]
pub fn publish_raw(topic: &str, msg: &RawValue) -> Bytes {
    // Exact: slow subscribers' outboxes keep these by the ten thousand, and count their text alone.
    let head = "{\"op\":\"publish\",\"topic\":\"\",\"msg\":}\n".len();
    Line::with_room("publish", head + topic.len() + msg.get().len())
        .text("topic", topic)
        .raw("msg", msg)
        .end()
}

/// A frame that [`publish`] has made for `topic`, or a [series] of them, for those who know it by another spelling.
#[must_use]
pub fn respelled(topic: &str, spelling: &str, frames: &Bytes) -> Bytes {
    if topic == spelling {
        return frames.clone();
    }
    let mut text = Vec::with_capacity(frames.len());
    for frame in series::messages(frames.clone()) {
        let mut line = Line::after(text, "publish").text("topic", spelling);
        line.key("msg");
        line.text.extend_from_slice(message_text(topic, &frame));
        line.text.extend_from_slice(b"}\n");
        text = line.text;
    }
    Bytes::from(text)
}

/// The message within a frame that [`publish`] has made for `topic`, as JSON.
#[must_use]
pub fn message_text<'a>(topic: &str, frame: &'a [u8]) -> &'a [u8] {
    let quoted = serde_json::to_string(topic).map_or(0, |quoted| quoted.len());
    let head = "{\"op\":\"publish\",\"topic\":,\"msg\":".len() + quoted;
    let msg = frame.get(head..frame.len().saturating_sub("}\n".len()));
    debug_assert!(msg.is_some(), "{topic} is not what this frame is about");
    msg.unwrap_or(b"null")
}

/// The answer to a service call; `values` is an object, `status` empty on success.
#[must_use]
pub fn response(
    service: &str,
    id: Option<&RawValue>,
    values: &impl Serialize,
    result: bool,
    status: &str,
) -> Bytes {
    Line::op("service_response")
        .text("service", service)
        .optional_raw("id", id)
        .value("values", values)
        .value("result", &result)
        .text("status", status)
        .end()
}

/// The answer of an external provider, whose `values` only pass through.
#[must_use]
pub fn response_raw(
    service: &str,
    id: Option<&RawValue>,
    values: &RawValue,
    result: bool,
    status: &str,
) -> Bytes {
    Line::with_room("service_response", values.get().len() + USUAL_FRAME)
        .text("service", service)
        .optional_raw("id", id)
        .raw("values", values)
        .value("result", &result)
        .text("status", status)
        .end()
}

/// The answer to a call that failed: `values` is `{}`, `status` says why.
#[must_use]
pub fn failure(service: &str, id: Option<&RawValue>, status: &str) -> Bytes {
    response(service, id, &Empty {}, false, status)
}

/// Progress of a goal.
#[must_use]
pub fn action_feedback(action: &str, id: Option<&RawValue>, values: &impl Serialize) -> Bytes {
    Line::op("action_feedback")
        .text("action", action)
        .optional_raw("id", id)
        .value("values", values)
        .end()
}

/// The end of a goal; `status` as `action_msgs/msg/GoalStatus` counts. Where `result` is false, `values` says why.
#[must_use]
pub fn action_result(
    action: &str,
    id: Option<&RawValue>,
    values: &impl Serialize,
    status: u8,
    result: bool,
) -> Bytes {
    Line::op("action_result")
        .text("action", action)
        .optional_raw("id", id)
        .value("values", values)
        .value("status", &status)
        .value("result", &result)
        .end()
}

/// A status.
#[must_use]
pub fn status(level: Level, msg: &str, id: Option<&RawValue>) -> Bytes {
    Line::op("status")
        .text("level", level.name())
        .text("msg", msg)
        .optional_raw("id", id)
        .end()
}

/// A call that goes on to an external provider under an id of the runtime's own; `args` only pass through.
#[must_use]
pub fn call(service: &str, id: &str, args: &RawValue) -> Bytes {
    Line::with_room("call_service", args.get().len() + USUAL_FRAME)
        .text("service", service)
        .text("id", id)
        .raw("args", args)
        .end()
}

/// `{}`, the `values` of a response that has none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Empty {}

/// A frame under construction; members come in the order in which they are written.
struct Line {
    text: Vec<u8>,
}

impl Line {
    fn op(op: &str) -> Self {
        Self::with_room(op, USUAL_FRAME)
    }

    fn with_room(op: &str, bytes: usize) -> Self {
        Self::after(Vec::with_capacity(bytes), op)
    }

    /// A frame behind what is there.
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

    fn text(self, key: &str, text: &str) -> Self {
        self.value(key, text)
    }

    fn value<T: Serialize + ?Sized>(mut self, key: &str, value: &T) -> Self {
        self.key(key);
        let start = self.text.len();
        if serde_json::to_writer(&mut self.text, value).is_err() {
            // A `Vec` takes every byte, and none of our types fails to serialise; should one, the frame stays valid.
            debug_assert!(false, "{key} can't be written as JSON");
            self.text.truncate(start);
            self.text.extend_from_slice(b"null");
        }
        self
    }

    fn raw(mut self, key: &str, raw: &RawValue) -> Self {
        self.key(key);
        let strict = json::strict(raw.get());
        let start = self.text.len();
        self.text.extend_from_slice(strict.as_bytes());
        // Valid JSON has a carriage return between tokens only. Some readers take one for the end of a line: then what
        // another client has put between two of them would be a frame to them.
        if strict.as_bytes().contains(&b'\r') {
            for byte in self.text.iter_mut().skip(start) {
                if *byte == b'\r' {
                    *byte = b' ';
                }
            }
        }
        self
    }

    fn optional_raw(self, key: &str, raw: Option<&RawValue>) -> Self {
        match raw {
            Some(raw) => self.raw(key, raw),
            None => self,
        }
    }

    fn end(mut self) -> Bytes {
        self.text.extend_from_slice(b"}\n");
        if self.text.len() > LARGE_FRAME {
            self.text.shrink_to_fit();
        }
        Bytes::from(self.text)
    }
}
