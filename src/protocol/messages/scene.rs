//! Messages for 3D tools: frames, and the arm's description. Web viewers that do not combine chains of frames get them
//! relative to another frame.
//!
//! **Invariant:** frames and their parents are those of the [description](crate::protocol::ros::urdf). A frame is found
//! with and without a leading slash, and is sent under the requested name.

use serde::Serialize;

pub use crate::protocol::messages::telemetry::WORLD;
use crate::protocol::messages::{Header, Stamp};

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
    pub header: Header<String>,
    /// The frame.
    pub child_frame_id: String,
    /// Its pose.
    pub transform: Transform,
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

/// Pose of a frame in the plane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct FramePose {
    /// \[m\].
    x: f64,
    /// \[m\].
    y: f64,
    /// Against the x axis \[rad\].
    angle: f64,
}

impl FramePose {
    /// This pose relative to `other`.
    fn seen_from(self, other: Self) -> Self {
        let (sin, cos) = other.angle.sin_cos();
        let (x, y) = (self.x - other.x, self.y - other.y);
        Self {
            x: cos * x + sin * y,
            y: cos * y - sin * x,
            angle: self.angle - other.angle,
        }
    }

    /// The frame `child` with this pose relative to `parent`.
    fn of(self, stamp: Stamp, parent: &str, child: &str) -> TransformStamped {
        let (sin, cos) = (self.angle / 2.0).sin_cos();
        TransformStamped {
            header: Header {
                stamp,
                frame_id: parent.to_owned(),
            },
            child_frame_id: child.to_owned(),
            transform: Transform {
                translation: Vector3 {
                    x: self.x,
                    y: self.y,
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
}

/// The links' frames at joint positions \[rad\], each at the end of the link before (lengths in m).
#[must_use]
pub fn moving_frames(stamp: Stamp, lengths: &[f64], positions: &[f64]) -> TfMessage {
    let before = std::iter::once(&0.0).chain(lengths);
    let mut parent = WORLD.to_owned();
    let transforms = positions.iter().zip(before).enumerate();
    let frame = |(index, (&angle, &x))| {
        let child = link_name(index);
        let frame = FramePose { x, y: 0.0, angle }.of(stamp, &parent, &child);
        parent = child;
        frame
    };
    TfMessage {
        transforms: transforms.map(frame).collect(),
    }
}

/// The frame of the end effector, fixed to the last link.
#[must_use]
pub fn fixed_frames(stamp: Stamp, lengths: &[f64]) -> TfMessage {
    let parent = link_name(lengths.len().saturating_sub(1));
    let pose = FramePose {
        x: lengths.last().copied().unwrap_or_default(),
        ..FramePose::default()
    };
    TfMessage {
        transforms: vec![pose.of(stamp, &parent, END_EFFECTOR)],
    }
}

/// Every frame of an arm with these lengths \[m\] at these joint positions \[rad\], with its pose in the world.
fn poses(lengths: &[f64], positions: &[f64]) -> Vec<(String, FramePose)> {
    let mut at = FramePose::default();
    let mut poses = vec![(WORLD.to_owned(), at)];
    for (index, (length, position)) in lengths.iter().zip(positions).enumerate() {
        at.angle += position;
        poses.push((link_name(index), at));
        let (sin, cos) = at.angle.sin_cos();
        at.x += length * cos;
        at.y += length * sin;
    }
    poses.push((END_EFFECTOR.to_owned(), at));
    poses
}

/// Whether an arm of `links` links has a frame of that name.
#[must_use]
pub fn is_frame(name: &str, links: usize) -> bool {
    let name = without_slash(name);
    name == WORLD || name == END_EFFECTOR || (0..links).any(|index| name == link_name(index))
}

fn without_slash(name: &str) -> &str {
    name.strip_prefix('/').unwrap_or(name)
}

/// The frames `sources` relative to `target`. Unknown frames are omitted.
#[must_use]
pub fn seen_from<'a>(
    stamp: Stamp,
    target: &str,
    sources: impl Iterator<Item = &'a str>,
    lengths: &[f64],
    positions: &[f64],
) -> TfMessage {
    let poses = poses(lengths, positions);
    let find = |name: &str| {
        let mut poses = poses.iter();
        let found = poses.find(|(one, _)| one == without_slash(name));
        found.map(|(_, pose)| *pose)
    };
    let transforms = sources.filter_map(|source| {
        let pose = find(source)?.seen_from(find(target)?);
        Some(pose.of(stamp, target, source))
    });
    TfMessage {
        transforms: transforms.collect(),
    }
}

/// The names of all frames that an arm of `links` links has besides the world.
#[must_use]
pub fn frames(links: usize) -> Vec<String> {
    let names = (0..links).map(link_name);
    names.chain([END_EFFECTOR.to_owned()]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENGTHS: [f64; 2] = [1.0, 0.5];

    fn seen(target: &str, source: &str, positions: [f64; 2]) -> Transform {
        let stamp = Stamp::default();
        let message = seen_from(stamp, target, [source].into_iter(), &LENGTHS, &positions);
        let [only] = &message.transforms[..] else {
            panic!("{source} is a frame");
        };
        assert_eq!(
            (only.header.frame_id.as_str(), only.child_frame_id.as_str()),
            (target, source)
        );
        only.transform
    }

    #[test]
    fn a_frame_is_where_the_links_put_it() {
        let right = std::f64::consts::FRAC_PI_2;
        let end_effector = seen("world", "/hand", [right, -right]);
        // A sine and a cosine, each accurate to one ulp.
        assert!(
            (end_effector.translation.x - 0.5).abs() < 1e-15
                && (end_effector.translation.y - 1.0).abs() < 1e-15
        );
        assert!((end_effector.rotation.w - 1.0).abs() < 1e-15);
        let back = seen("hand", "world", [0.3, 0.0]);
        assert!((back.translation.x + 1.5).abs() < 1e-15 && back.translation.y.abs() < 1e-15);
        // From one link to the next: the length of the first, in every pose.
        let next = seen("link1", "link2", [0.3, 0.7]);
        assert!((next.translation.x - 1.0).abs() < 1e-15 && next.translation.y.abs() < 1e-15);
        assert!((next.rotation.z - 0.35_f64.sin()).abs() < 1e-15);
    }

    #[test]
    fn frames_that_the_arm_does_not_have_are_left_out() {
        let sources = ["link3", "link1", "nose"].into_iter();
        let message = seen_from(Stamp::default(), "world", sources, &LENGTHS, &[0.0; 2]);
        assert_eq!(message.transforms.len(), 1);
        assert!(is_frame("/world", 2) && is_frame("link2", 2) && !is_frame("link3", 2));
        assert_eq!(frames(2), ["link1", "link2", "hand"]);
    }
}
