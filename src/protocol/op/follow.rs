//! Reads the goal of `control_msgs/action/FollowJointTrajectory`: points with times, and tolerances.
//!
//! **Invariant:** every point of a returned goal has a finite position of each joint, in the arm's order, and
//! velocities of all joints or none. Every error names its field.

use serde_json::value::RawValue;

use super::Arguments;
use super::fields::{Bound, Fields, RejectedField, Rejections};
use crate::protocol::catalog::Action;
use crate::protocol::wire::{json, text};

/// Most points of a path: more than a planner needs for a few joints. Each takes a hundred bytes while the goal is
/// active.
pub const MAX_POINTS: usize = 4096;
/// Most entries of a list of tolerances: enough for each joint several times over.
const MAX_TOLERANCES: usize = 16;

/// A goal.
#[derive(Debug, Clone, PartialEq)]
pub struct FollowGoal {
    /// The points, at least one.
    pub points: Vec<FollowPoint>,
    /// Tolerances on the way.
    pub path_tolerance: Vec<JointTolerance>,
    /// Tolerances at the end.
    pub goal_tolerance: Vec<JointTolerance>,
    /// Time after the end in which the joints must arrive \[s\]; 0 for the default, negative for no limit.
    pub goal_time_tolerance: f64,
}

/// A point.
#[derive(Debug, Clone, PartialEq)]
pub struct FollowPoint {
    /// Time from the start \[s\], not negative.
    pub time: f64,
    /// Positions \[rad\].
    pub position: Vec<f64>,
    /// Velocities \[rad/s\].
    pub velocity: Option<Vec<f64>>,
}

/// The tolerance of a joint: 0 for the default, negative for no limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointTolerance {
    /// Index of the joint.
    pub joint: usize,
    /// \[rad\].
    pub position: f64,
    /// \[rad/s\].
    pub velocity: f64,
}

impl FollowGoal {
    /// Reads a goal for an arm with these joints.
    ///
    /// # Errors
    /// All errors of the goal, or of the first invalid point.
    pub fn read(args: &Arguments, joints: &[&str]) -> Result<Self, Rejections> {
        let mut fields = Fields::of_goal(args, Action::FollowJointTrajectory)?;
        let trajectory = fields.raw("trajectory");
        let tolerances = ["path_tolerance", "goal_tolerance"].map(|name| {
            let entries = fields.entries(name, MAX_TOLERANCES);
            (name, entries.unwrap_or_default())
        });
        let patience = fields.raw("goal_time_tolerance");
        let Some(trajectory) = trajectory.filter(|_| fields.accepted()) else {
            return Err(fields.finish());
        };
        let [path_tolerance, goal_tolerance] = tolerances.map(|(name, entries)| {
            let indexed = entries.into_iter().enumerate();
            let read = indexed.map(|(at, raw)| tolerance(raw, &format!("{name}[{at}]"), joints));
            read.collect::<Result<Vec<_>, RejectedField>>()
        });
        Ok(Self {
            points: points(trajectory, joints)?,
            path_tolerance: path_tolerance?,
            goal_tolerance: goal_tolerance?,
            goal_time_tolerance: match patience {
                Some(raw) => seconds(raw, "goal_time_tolerance", Bound::Finite)?,
                None => 0.0,
            },
        })
    }
}

fn refused(field: &str, reason: &str) -> RejectedField {
    RejectedField::refused(field, &reason)
}

fn mistyped(field: &str, expected: &str, raw: &RawValue) -> RejectedField {
    refused(
        field,
        &format!("must be {expected}, got {}", text::found(raw)),
    )
}

fn points(trajectory: &RawValue, joints: &[&str]) -> Result<Vec<FollowPoint>, RejectedField> {
    let [names, points] = json::members(trajectory.get(), &["joint_names", "points"])
        .map_err(|_| mistyped("trajectory", "an object", trajectory))?;
    let order = order(names, joints)?;
    let field = "trajectory.points";
    let points = points.ok_or_else(|| refused(field, "is required"))?;
    let entries =
        json::entries(points, MAX_POINTS).ok_or_else(|| mistyped(field, "an array", points))?;
    if entries.count > MAX_POINTS {
        let got = entries.count;
        return Err(refused(
            field,
            &format!("must have at most {MAX_POINTS} entries, got {got}"),
        ));
    }
    let indexed = entries.first.into_iter().enumerate();
    indexed
        .map(|(at, raw)| point(raw, &format!("{field}[{at}]"), &order))
        .collect()
}

/// The index in the message of each joint of the arm.
fn order(names: Option<&RawValue>, joints: &[&str]) -> Result<Vec<usize>, RejectedField> {
    let field = "trajectory.joint_names";
    let expected = format!("must name {}, each once", joints.join(", "));
    let wrong = || refused(field, &expected);
    let names = names.and_then(|names| json::entries(names, joints.len()));
    let names = names
        .filter(|names| names.count == joints.len())
        .ok_or_else(wrong)?;
    let names: Vec<_> = names.first.into_iter().filter_map(json::text).collect();
    let places = joints
        .iter()
        .map(|joint| names.iter().position(|name| name == joint));
    places.collect::<Option<_>>().ok_or_else(wrong)
}

fn point(raw: &RawValue, field: &str, order: &[usize]) -> Result<FollowPoint, RejectedField> {
    let names = ["positions", "velocities", "time_from_start"];
    let [positions, velocities, time] =
        json::members(raw.get(), &names).map_err(|_| mistyped(field, "an object", raw))?;
    let named = |name: &str| format!("{field}.{name}");
    let missing = |name: &str| refused(&named(name), "is required");
    let positions = positions.ok_or_else(|| missing("positions"))?;
    let time = time.ok_or_else(|| missing("time_from_start"))?;
    Ok(FollowPoint {
        time: seconds(time, &named("time_from_start"), Bound::NonNegative)?,
        position: by_joint(positions, &named("positions"), order)?,
        velocity: match velocities.filter(|raw| !is_empty(raw)) {
            Some(raw) => Some(by_joint(raw, &named("velocities"), order)?),
            None => None,
        },
    })
}

/// Whether it is an empty array, which counts as missing in a ROS message.
fn is_empty(raw: &RawValue) -> bool {
    json::entries(raw, 0).is_some_and(|entries| entries.count == 0)
}

/// A finite number for each joint, in the arm's order.
fn by_joint(raw: &RawValue, field: &str, order: &[usize]) -> Result<Vec<f64>, RejectedField> {
    let expected = order.len();
    let entries =
        json::entries(raw, expected).ok_or_else(|| mistyped(field, "an array of numbers", raw))?;
    if entries.count != expected {
        let got = entries.count;
        return Err(refused(
            field,
            &format!("must have {expected} entries, got {got}"),
        ));
    }
    let numbers = entries.first.into_iter().enumerate();
    let numbers: Vec<f64> = numbers
        .map(|(at, raw)| finite(raw, &format!("{field}[{at}]"), Bound::Finite))
        .collect::<Result<_, _>>()?;
    Ok(order
        .iter()
        .filter_map(|at| numbers.get(*at))
        .copied()
        .collect())
}

fn finite(raw: &RawValue, field: &str, bound: Bound) -> Result<f64, RejectedField> {
    let value = json::number(raw).ok_or_else(|| mistyped(field, "a number", raw))?;
    if !value.is_finite() {
        return Err(refused(field, "must be a finite number"));
    }
    if !bound.holds(value) {
        return Err(refused(
            field,
            &format!("must be {bound}, got {}", text::excerpt(raw.get())),
        ));
    }
    Ok(value)
}

/// A duration in seconds, under the names of ROS 2 or of ROS 1: the sum of its parts, each within `bound`.
///
/// # Errors
/// If it is not a duration. The reason names `field`.
pub fn seconds(raw: &RawValue, field: &str, bound: Bound) -> Result<f64, RejectedField> {
    let names = ["sec", "nanosec", "secs", "nsecs"];
    let [sec, nanosec, secs, nsecs] = json::members(raw.get(), &names)
        .map_err(|_| mistyped(field, "an object with sec and nanosec", raw))?;
    let part = |raw: Option<&RawValue>, name: &str| match raw {
        Some(raw) => finite(raw, &format!("{field}.{name}"), bound),
        None => Ok(0.0),
    };
    let sum = part(sec.or(secs), "sec")? + 1e-9 * part(nanosec.or(nsecs), "nanosec")?;
    if !sum.is_finite() {
        return Err(refused(field, "must be a finite number of seconds"));
    }
    Ok(sum)
}

fn tolerance(
    raw: &RawValue,
    field: &str,
    joints: &[&str],
) -> Result<JointTolerance, RejectedField> {
    let [name, position, velocity] = json::members(raw.get(), &["name", "position", "velocity"])
        .map_err(|_| mistyped(field, "an object", raw))?;
    let number = |raw: Option<&RawValue>, name: &str| match raw {
        Some(raw) => finite(raw, &format!("{field}.{name}"), Bound::Finite),
        None => Ok(0.0),
    };
    let name = name.and_then(json::text).unwrap_or_default();
    let joint = joints.iter().position(|joint| *joint == name);
    Ok(JointTolerance {
        joint: joint.ok_or_else(|| refused(&format!("{field}.name"), "must be that of a joint"))?,
        position: number(position, "position")?,
        velocity: number(velocity, "velocity")?,
    })
}
