//! Messages for 3D tools and log viewers: frames, the arm's description, warnings.
//!
//! **Invariant:** frames and their parents are those of the [description](crate::protocol::ros::urdf).

use serde::Serialize;

use crate::protocol::messages::Stamp;
pub use crate::protocol::messages::telemetry::WORLD;

/// The frame of the end effector, at the end of the last link.
pub const END_EFFECTOR: &str = "hand";

/// The frame of link `index`, from 0.
#[must_use]
pub fn link_name(index: usize) -> String {
    format!("link{}", index + 1)
}

/// `std_msgs/msg/String`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct StringMessage {
    /// The text.
    pub data: String,
}

/// `tf2_msgs/msg/TFMessage`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TfMessage {
    /// The frames, each in its parent.
    pub transforms: Vec<TransformStamped>,
}

/// `geometry_msgs/msg/TransformStamped`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TransformStamped {
    /// Time, and the parent's frame.
    pub header: OwnedHeader,
    /// The frame.
    pub child_frame_id: String,
    /// Its pose.
    pub transform: Transform,
}

/// `std_msgs/msg/Header` with its own frame name.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct OwnedHeader {
    /// Simulation time.
    pub stamp: Stamp,
    /// The parent's frame.
    pub frame_id: String,
}

/// `geometry_msgs/msg/Transform`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Transform {
    /// \[m\].
    pub translation: Vector3,
    /// A unit quaternion.
    pub rotation: Quaternion,
}

/// `geometry_msgs/msg/Vector3`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Vector3 {
    /// \[m\].
    pub x: f64,
    /// \[m\].
    pub y: f64,
    /// \[m\].
    pub z: f64,
}

/// `geometry_msgs/msg/Quaternion`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quaternion {
    /// Along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Along z.
    pub z: f64,
    /// The scalar part.
    pub w: f64,
}

/// `rcl_interfaces/msg/Log`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LogMessage {
    /// Simulation time.
    pub stamp: Stamp,
    /// 30 is a warning, 40 an error.
    pub level: u8,
    /// The node.
    pub name: &'static str,
    /// The event, in words.
    pub msg: String,
    /// File of the source.
    pub file: &'static str,
    /// Empty.
    pub function: &'static str,
    /// Line in the file.
    pub line: u32,
}

/// `parent` → `child`: `along` the parent's x \[m\], turned about z by `angle` \[rad\].
fn frame(stamp: Stamp, parent: String, child: String, along: f64, angle: f64) -> TransformStamped {
    let (sin, cos) = (angle / 2.0).sin_cos();
    TransformStamped {
        header: OwnedHeader {
            stamp,
            frame_id: parent,
        },
        child_frame_id: child,
        transform: Transform {
            translation: Vector3 {
                x: along,
                y: 0.0,
                z: 0.0,
            },
            rotation: Quaternion {
                x: 0.0,
                y: 0.0,
                z: sin,
                w: cos,
            },
        },
    }
}

/// The links' frames at joint positions \[rad\], each at the end of the link before (lengths in m).
#[must_use]
pub fn moving_frames(stamp: Stamp, lengths: &[f64], positions: &[f64]) -> TfMessage {
    let before = std::iter::once(&0.0).chain(lengths);
    let transforms = positions.iter().zip(before).enumerate();
    TfMessage {
        transforms: transforms
            .map(|(index, (&angle, &along))| {
                let parent = match index {
                    0 => WORLD.to_owned(),
                    index => link_name(index - 1),
                };
                frame(stamp, parent, link_name(index), along, angle)
            })
            .collect(),
    }
}

/// The frame of the end effector, fixed to the last link.
#[must_use]
pub fn fixed_frames(stamp: Stamp, lengths: &[f64]) -> TfMessage {
    let last = lengths.len().saturating_sub(1);
    let along = lengths.last().copied().unwrap_or_default();
    TfMessage {
        transforms: vec![frame(
            stamp,
            link_name(last),
            END_EFFECTOR.to_owned(),
            along,
            0.0,
        )],
    }
}
