//! Reads `trajectory_msgs/msg/JointTrajectory`: the setpoint of a message on `/joint_trajectory`, and the goal of
//! `control_msgs/action/FollowJointTrajectory` with its tolerances.
//!
//! **Invariant:** every returned setpoint and point has a finite position of each joint, in the arm's order. Every
//! error names its field.

use serde_json::value::RawValue;

use super::Arguments;
use super::fields::{Bound, Fields, Reason, RejectedField, Rejections, finite};
use crate::protocol::catalog::Action;
use crate::protocol::wire::json::{self, Entries};
use crate::protocol::wire::text;

/// Most points of a path: more than a planner needs for a few joints. Each takes a hundred bytes while the goal is
/// active.
pub const MAX_POINTS: usize = 4096;
/// Most entries of a list of tolerances: enough for each joint several times over.
const MAX_TOLERANCES: usize = 16;

/// A setpoint for an arm of n joints, in the arm's order.
#[derive(Debug, Clone, PartialEq)]
pub struct SetpointRequest {
    /// Positions \[rad\], length n, finite.
    pub position: Vec<f64>,
    /// Velocities \[rad/s\], length n, finite.
    pub velocity: Vec<f64>,
}

/// Reads the setpoint in a message for an arm with these joints.
///
/// Only the last point counts. If `joint_names` is a permutation of `joints`, its values are matched by name, otherwise
/// by position. Velocities that are missing, too few, too many or not finite count as zeros.
///
/// # Errors
/// If there is no point, or the positions are not one finite number per joint.
pub fn joint_trajectory(msg: &RawValue, joints: &[&str]) -> Result<SetpointRequest, RejectedField> {
    let [names, points] = members(msg, "msg", &["joint_names", "points"])?;
    let points = required(points, "points")?;
    let points = json::entries(points, 0).ok_or_else(|| mistyped("points", "an array", points))?;
    let no_points = || RejectedField::refused("points", &"must have at least one entry");
    let last = points.last.ok_or_else(no_points)?;
    let field = format!("points[{}]", points.count - 1);
    let [positions, velocities] = members(last, &field, &["positions", "velocities"])?;
    let names = names.and_then(|names| json::entries(names, joints.len()));

    let position = required(positions, &format!("{field}.positions"))
        .and_then(|raw| numbers(raw, &format!("{field}.positions"), joints.len()))
        .map_err(|rejection| with_missing_joints(rejection, names.as_ref(), joints))?;
    let velocity = velocities.and_then(|raw| numbers(raw, "velocities", joints.len()).ok());
    let velocity = velocity.unwrap_or_else(|| vec![0.0; joints.len()]);
    let order = names.and_then(|names| order(&names, joints));
    let order = order.unwrap_or_else(|| (0..joints.len()).collect());
    Ok(SetpointRequest {
        position: by_joint(&order, &position),
        velocity: by_joint(&order, &velocity),
    })
}

/// The rejection of too few or too many positions, with the joints that `names` lacks, if all names are joints.
fn with_missing_joints(
    mut rejection: RejectedField,
    names: Option<&Entries<'_>>,
    joints: &[&str],
) -> RejectedField {
    let are_few = |names: &&Entries<'_>| names.count > 0 && names.count == names.first.len();
    let named = names.filter(are_few).and_then(|names| {
        let named = names.first.iter().map(|name| json::text(name));
        named.collect::<Option<Vec<_>>>()
    });
    if let (Reason::Length { .. }, Some(named)) = (&rejection.reason, named)
        && named.iter().all(|name| joints.contains(&&**name))
    {
        let is_missing = |joint: &&&str| !named.iter().any(|name| name == **joint);
        let missing: Vec<&str> = joints.iter().filter(is_missing).copied().collect();
        if !missing.is_empty() {
            let missing = missing.join(", ");
            let reason = format!("{}: joint_names lacks {missing}", rejection.reason);
            rejection.reason = Reason::Refused(reason);
        }
    }
    rejection
}

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
    /// Velocities \[rad/s\] of all joints, or none.
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

fn points(trajectory: &RawValue, joints: &[&str]) -> Result<Vec<FollowPoint>, RejectedField> {
    let [names, points] = members(trajectory, "trajectory", &["joint_names", "points"])?;
    let names = names.and_then(|names| json::entries(names, joints.len()));
    let order = names.and_then(|names| order(&names, joints));
    let order = order.ok_or_else(|| {
        let expected = format!("must name {}, each once", joints.join(", "));
        RejectedField::refused("trajectory.joint_names", &expected)
    })?;
    let field = "trajectory.points";
    let points = required(points, field)?;
    let entries =
        json::entries(points, MAX_POINTS).ok_or_else(|| mistyped(field, "an array", points))?;
    if entries.count > MAX_POINTS {
        let (limit, got) = (MAX_POINTS, entries.count);
        return Err(rejected(field, Reason::TooMany { limit, got }));
    }
    let indexed = entries.first.into_iter().enumerate();
    indexed
        .map(|(at, raw)| point(raw, &format!("{field}[{at}]"), &order))
        .collect()
}

fn point(raw: &RawValue, field: &str, order: &[usize]) -> Result<FollowPoint, RejectedField> {
    let names = ["positions", "velocities", "time_from_start"];
    let [positions, velocities, time] = members(raw, field, &names)?;
    let named = |name: &str| format!("{field}.{name}");
    let positions = required(positions, &named("positions"))?;
    let time = required(time, &named("time_from_start"))?;
    let values = |raw: &RawValue, name: &str| {
        let values = numbers(raw, &named(name), order.len())?;
        Ok(by_joint(order, &values))
    };
    Ok(FollowPoint {
        time: seconds(time, &named("time_from_start"), Bound::NonNegative)?,
        position: values(positions, "positions")?,
        velocity: velocities
            .filter(|raw| !is_empty(raw))
            .map(|raw| values(raw, "velocities"))
            .transpose()?,
    })
}

/// Whether it is an empty array, which counts as missing in a ROS message.
fn is_empty(raw: &RawValue) -> bool {
    json::entries(raw, 0).is_some_and(|entries| entries.count == 0)
}

/// A duration in seconds, under the names of ROS 2 or of ROS 1: the sum of its parts, each within `bound`.
fn seconds(raw: &RawValue, field: &str, bound: Bound) -> Result<f64, RejectedField> {
    let [sec, nanosec, secs, nsecs] =
        json::members(raw.get(), &["sec", "nanosec", "secs", "nsecs"])
            .map_err(|_| mistyped(field, "an object with sec and nanosec", raw))?;
    let seconds = number_or_zero(sec.or(secs), &format!("{field}.sec"), bound)?;
    let nanoseconds = number_or_zero(nanosec.or(nsecs), &format!("{field}.nanosec"), bound)?;
    let sum = seconds + 1e-9 * nanoseconds;
    if !sum.is_finite() {
        let why = "must be a finite number of seconds";
        return Err(RejectedField::refused(field, &why));
    }
    Ok(sum)
}

fn tolerance(
    raw: &RawValue,
    field: &str,
    joints: &[&str],
) -> Result<JointTolerance, RejectedField> {
    let [name, position, velocity] = members(raw, field, &["name", "position", "velocity"])?;
    let name = name.and_then(json::text).unwrap_or_default();
    let joint = joints.iter().position(|joint| *joint == name);
    let unknown = || RejectedField::refused(&format!("{field}.name"), &"must be that of a joint");
    Ok(JointTolerance {
        joint: joint.ok_or_else(unknown)?,
        position: number_or_zero(position, &format!("{field}.position"), Bound::Finite)?,
        velocity: number_or_zero(velocity, &format!("{field}.velocity"), Bound::Finite)?,
    })
}

// ---- parts ----------------------------------------------------------------------------------------------------------

fn rejected(field: &str, reason: Reason) -> RejectedField {
    let field = field.to_owned();
    RejectedField { field, reason }
}

fn mistyped(field: &str, expected: &'static str, raw: &RawValue) -> RejectedField {
    let (expected, found) = (expected.into(), text::found(raw));
    rejected(field, Reason::Mistyped { expected, found })
}

fn required<'a>(raw: Option<&'a RawValue>, field: &str) -> Result<&'a RawValue, RejectedField> {
    raw.ok_or_else(|| rejected(field, Reason::Missing))
}

/// The members of these names in an object.
fn members<'a, const M: usize>(
    raw: &'a RawValue,
    field: &str,
    names: &[&str; M],
) -> Result<[Option<&'a RawValue>; M], RejectedField> {
    json::members(raw.get(), names).map_err(|_| mistyped(field, "an object", raw))
}

fn number_or_zero(raw: Option<&RawValue>, field: &str, bound: Bound) -> Result<f64, RejectedField> {
    raw.map_or(Ok(0.0), |raw| finite(raw, bound))
        .map_err(|reason| rejected(field, reason))
}

/// An array of `expected` finite numbers.
fn numbers(raw: &RawValue, field: &str, expected: usize) -> Result<Vec<f64>, RejectedField> {
    let entries =
        json::entries(raw, expected).ok_or_else(|| mistyped(field, "an array of numbers", raw))?;
    if entries.count != expected {
        let got = entries.count;
        return Err(rejected(field, Reason::Length { expected, got }));
    }
    let number = |(at, raw): (usize, &RawValue)| {
        finite(raw, Bound::Finite).map_err(|reason| rejected(&format!("{field}[{at}]"), reason))
    };
    entries.first.into_iter().enumerate().map(number).collect()
}

/// The index in the message of each joint of the arm; `None` unless `names` is a permutation of `joints`.
fn order(names: &Entries<'_>, joints: &[&str]) -> Option<Vec<usize>> {
    let spelled: Vec<_> = names
        .first
        .iter()
        .filter_map(|name| json::text(name))
        .collect();
    let places = joints
        .iter()
        .map(|joint| spelled.iter().position(|name| name == joint));
    places
        .collect::<Option<_>>()
        .filter(|_| names.count == joints.len())
}

/// The values in the arm's order.
fn by_joint(order: &[usize], values: &[f64]) -> Vec<f64> {
    let places = order.iter().filter_map(|place| values.get(*place));
    places.copied().collect()
}
