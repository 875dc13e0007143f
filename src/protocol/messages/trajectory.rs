//! Reads messages on `/joint_trajectory`: the last point is the setpoint.
//!
//! **Invariant:** a returned setpoint has one finite position and one finite velocity for each joint of the arm.

use serde_json::value::RawValue;

use crate::protocol::wire::json;
use crate::protocol::wire::json::Entries;
use crate::protocol::wire::text;

/// A setpoint for an arm of n joints, in the arm's order.
#[derive(Debug, Clone, PartialEq)]
pub struct SetpointRequest {
    /// Positions \[rad\], length n, finite.
    pub position: Vec<f64>,
    /// Velocities \[rad/s\], length n, finite.
    pub velocity: Vec<f64>,
}

/// Why a trajectory is ignored.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TrajectoryError {
    /// A field is absent.
    #[error("{field} is required")]
    Missing {
        /// The field's path in the message.
        field: String,
    },
    /// A field has the wrong type or value.
    #[error("{field} must be {expected}, got {found}")]
    Mistyped {
        /// The field's path in the message.
        field: String,
        /// The expected kind of value.
        expected: &'static str,
        /// The received value, shortened.
        found: String,
    },
    /// There is no point.
    #[error("points must have at least one entry")]
    NoPoints,
    /// The number of positions differs from the number of joints.
    #[error("{field} must have {expected} entries, got {got}{}", lacking(.missing))]
    Length {
        /// The field's path in the message.
        field: String,
        /// Joints of the arm.
        expected: usize,
        /// Entries in the message.
        got: usize,
        /// Joints missing in `joint_names`, if all its names are joints of the arm.
        missing: Vec<String>,
    },
    /// A position is not finite.
    #[error("{field} must be a finite number")]
    NotFinite {
        /// The entry's path in the message.
        field: String,
    },
}

fn lacking(missing: &[String]) -> String {
    if missing.is_empty() {
        return String::new();
    }
    format!(": joint_names lacks {}", missing.join(", "))
}

/// Reads the setpoint in a `trajectory_msgs/msg/JointTrajectory` for an arm with these joints.
///
/// Only the last point counts. If `joint_names` is a permutation of `joints`, its values are matched by name, otherwise
/// by position. Velocities that are missing, too few, too many or not finite count as zeros.
///
/// # Errors
/// If there is no point, or the positions are not one finite number per joint.
pub fn joint_trajectory(
    msg: &RawValue,
    joints: &[&str],
) -> Result<SetpointRequest, TrajectoryError> {
    let [names, points] = json::members(msg.get(), &["joint_names", "points"])
        .map_err(|_| mistyped("msg".to_owned(), "an object", msg))?;
    let points = points.ok_or_else(|| TrajectoryError::Missing {
        field: "points".to_owned(),
    })?;
    let points = json::entries(points, 0)
        .ok_or_else(|| mistyped("points".to_owned(), "an array", points))?;
    let last = points.last.ok_or(TrajectoryError::NoPoints)?;
    let field = format!("points[{}]", points.count - 1);
    let [positions, velocities] = json::members(last.get(), &["positions", "velocities"])
        .map_err(|_| mistyped(field.clone(), "an object", last))?;

    let names = names.and_then(|names| json::entries(names, joints.len()));
    let position = read_positions(
        positions,
        format!("{field}.positions"),
        joints,
        names.as_ref(),
    )?;
    let velocity = velocities
        .and_then(|velocities| json::entries(velocities, joints.len()))
        .filter(|velocities| velocities.count == joints.len())
        .and_then(|velocities| velocities.first.into_iter().map(finite).collect())
        .unwrap_or_else(|| vec![0.0; joints.len()]);

    let order = names.and_then(|names| permutation(&names, joints));
    Ok(match order {
        Some(order) => SetpointRequest {
            position: by_name(&order, &position),
            velocity: by_name(&order, &velocity),
        },
        None => SetpointRequest { position, velocity },
    })
}

fn mistyped(field: String, expected: &'static str, raw: &RawValue) -> TrajectoryError {
    TrajectoryError::Mistyped {
        field,
        expected,
        found: text::found(raw),
    }
}

fn finite(raw: &RawValue) -> Option<f64> {
    json::number(raw).filter(|value| value.is_finite())
}

/// The positions in the order of the message.
fn read_positions(
    raw: Option<&RawValue>,
    field: String,
    joints: &[&str],
    names: Option<&Entries<'_>>,
) -> Result<Vec<f64>, TrajectoryError> {
    let Some(raw) = raw else {
        return Err(TrajectoryError::Missing { field });
    };
    let Some(positions) = json::entries(raw, joints.len()) else {
        return Err(mistyped(field, "an array of numbers", raw));
    };
    if positions.count != joints.len() {
        let missing = names.map_or_else(Vec::new, |names| left_out(names, joints));
        let (expected, got) = (joints.len(), positions.count);
        return Err(TrajectoryError::Length {
            field,
            expected,
            got,
            missing,
        });
    }
    let entries = positions.first.into_iter().enumerate();
    entries
        .map(|(index, entry)| {
            let field = format!("{field}[{index}]");
            let value =
                json::number(entry).ok_or_else(|| mistyped(field.clone(), "a number", entry))?;
            if value.is_finite() {
                Ok(value)
            } else {
                Err(TrajectoryError::NotFinite { field })
            }
        })
        .collect()
}

/// The joints missing in `names`, if all its names are joints.
fn left_out(names: &Entries<'_>, joints: &[&str]) -> Vec<String> {
    if names.count == 0 || names.count != names.first.len() {
        return Vec::new();
    }
    let named: Option<Vec<usize>> = names
        .first
        .iter()
        .map(|name| index_of(name, joints))
        .collect();
    let Some(named) = named else {
        return Vec::new();
    };
    let missing = joints
        .iter()
        .enumerate()
        .filter(|(index, _)| !named.contains(index));
    missing.map(|(_, joint)| (*joint).to_owned()).collect()
}

/// The index in the message of each joint of the arm; `None` unless `names` is a permutation of `joints`.
fn permutation(names: &Entries<'_>, joints: &[&str]) -> Option<Vec<usize>> {
    if names.count != joints.len() {
        return None;
    }
    let named: Vec<usize> = names
        .first
        .iter()
        .map(|name| index_of(name, joints))
        .collect::<Option<_>>()?;
    (0..joints.len())
        .map(|joint| named.iter().position(|&named| named == joint))
        .collect()
}

fn index_of(name: &RawValue, joints: &[&str]) -> Option<usize> {
    let name = json::text(name)?;
    joints.iter().position(|joint| *joint == name)
}

fn by_name(order: &[usize], values: &[f64]) -> Vec<f64> {
    order
        .iter()
        .filter_map(|&index| values.get(index))
        .copied()
        .collect()
}
