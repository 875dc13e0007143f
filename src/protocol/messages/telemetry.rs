//! The arm over time: stamps, joint states, setpoints, diagnostics, error estimates.
//!
//! **Invariant:** the fields of a type are those that the catalog lists, in that order.

use serde::Serialize;

/// The fixed frame.
pub const WORLD: &str = "world";
/// Nanoseconds in a second.
const NANOSECONDS: u32 = 1_000_000_000;

/// A time, seconds and nanoseconds. `0 <= nanosec < 1e9`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize)]
pub struct Stamp {
    /// Whole seconds.
    pub sec: i32,
    /// The rest, in nanoseconds.
    pub nanosec: u32,
}

impl Stamp {
    /// The largest stamp.
    pub const MAX: Self = Self {
        sec: i32::MAX,
        nanosec: NANOSECONDS - 1,
    };

    /// `seconds` \[s\] to the nearest nanosecond. Saturates at [`Stamp::MAX`]; 0 for negative numbers and NaN.
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
pub struct Header<S = &'static str> {
    /// Simulation time.
    pub stamp: Stamp,
    /// [`WORLD`] in all messages of the arm; the parent's frame in a transform.
    pub frame_id: S,
}

impl Header {
    /// A header in the world frame, at simulation time `time` \[s\].
    #[must_use]
    pub fn world(time: f64) -> Self {
        Self {
            stamp: Stamp::from_seconds(time),
            frame_id: WORLD,
        }
    }
}

/// `sensor_msgs/msg/JointState`; the four arrays have one entry per joint.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointState<'a> {
    /// Time and frame.
    pub header: Header,
    /// Joint names.
    pub name: &'a [&'a str],
    /// Positions \[rad\].
    pub position: &'a [f64],
    /// Velocities \[rad/s\].
    pub velocity: &'a [f64],
    /// Efforts \[N m\].
    pub effort: &'a [f64],
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
    pub header: Header,
    /// One status per part of the runtime.
    pub status: Vec<DiagnosticStatus<'a>>,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DiagnosticStatus<'a> {
    /// 0 is OK, 1 a warning, 2 an error.
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
    /// The detail's name.
    pub key: &'a str,
    /// Its value, printed.
    pub value: String,
}

/// `pendularm_interfaces/msg/ErrorEstimate`; a value that is not finite is written as `null`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorEstimateMessage<'a> {
    /// The method that takes the steps.
    pub method: &'a str,
    /// Length of a step \[s\].
    pub timestep: f64,
    /// Largest error of a joint position after the next step \[rad\].
    pub local_error: f64,
    /// Largest error of a joint velocity after the next step \[rad/s\].
    pub velocity_error: f64,
    /// The error of the position per timestep \[rad/s\].
    pub error_per_second: f64,
    /// The largest stable timestep at the present setpoint \[s\].
    pub predicted_limit: f64,
}
