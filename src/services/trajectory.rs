//! Trajectories: the setpoint of a message on `/joint_trajectory`, and the goal of
//! `control_msgs/action/FollowJointTrajectory` with its tolerances, its feedback and its result.
//!
//! **Invariant:** every setpoint and point has a finite position of each joint, in the arm's order. Every error names
//! its field.

use serde::Serialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::arm::joint_names;
use crate::math::arm::State;
use crate::math::pid::Setpoint;
use crate::math::trajectory::{Tolerance, Waypoint};
use crate::protocol::catalog::Action;
use crate::protocol::messages::{Header, Stamp};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{
    self, Bound, Fields, MISSING, RejectedField, Rejections, finite, too_many, wrong_length,
};
use crate::protocol::wire::json::{self, Entries, Payload};

/// Most points of a path: more than a planner needs for a few joints. Each takes a hundred bytes while the goal is
/// active.
pub const MAX_POINTS: usize = 4096;
/// Most entries of a list of tolerances: enough for each joint several times over.
const MAX_TOLERANCES: usize = 16;
/// Default position tolerance of each joint at the end \[rad\].
const GOAL_TOLERANCE: f64 = 0.05;
/// Default velocity tolerance of each joint at the end \[rad/s\]: the default of `ros2_control`.
const STOPPED_VELOCITY: f64 = 0.01;
/// Default time after the end in which the joints must arrive \[s\].
const GOAL_TIME: f64 = 5.0;

/// Reads the setpoint of a message.
///
/// Only the last point counts. If `joint_names` is a permutation of the arm's, its values are matched by name, otherwise
/// by position. Velocities that are missing, too few, too many or not finite count as zeros.
///
/// # Errors
/// If there is no point, or the positions are not one finite number per joint.
pub fn read_setpoint<const N: usize>(msg: &Payload) -> Result<Setpoint<N>, RejectedField> {
    let [names, points] = members(msg.raw(), "msg", &["joint_names", "points"])?;
    let points = required(points, "points")?;
    let points = json::entries(points, 0).ok_or_else(|| mistyped("points", "an array", points))?;
    let no_points = || RejectedField::refused("points", &"must have at least one entry");
    let last = points.last.ok_or_else(no_points)?;
    let field = format!("points[{}]", points.count - 1);
    let [positions, velocities] = members(last, &field, &["positions", "velocities"])?;
    let names = names.and_then(|names| json::entries(names, N));

    let field = format!("{field}.positions");
    let position = required(positions, &field)
        .and_then(|raw| numbers(raw, &field))
        .map_err(|rejection| {
            let count = positions.and_then(|raw| Some(json::entries(raw, 0)?.count));
            let is_another = count.is_some_and(|count| count != N);
            let names = names.as_ref().filter(|_| is_another);
            with_missing_joints(rejection, names, &joint_names::<N>())
        })?;
    let velocity = velocities.and_then(|raw| numbers(raw, "velocities").ok());
    let order = names.and_then(|names| order(&names));
    let order = order.unwrap_or_else(|| std::array::from_fn(|joint| joint));
    Ok(Setpoint {
        position: by_joint(order, &position),
        velocity: by_joint(order, &velocity.unwrap_or([0.0; N])),
    })
}

/// The rejection of too few or too many positions, with the joints that `names` lacks, if all names are joints.
fn with_missing_joints(
    mut rejection: RejectedField,
    names: Option<&Entries<'_>>,
    joints: &[&str],
) -> RejectedField {
    let are_few = |names: &&Entries<'_>| (1..=joints.len()).contains(&names.count);
    let named = names.filter(are_few).and_then(|names| {
        let named = names.first.iter().map(|name| json::text(name));
        named.collect::<Option<Vec<_>>>()
    });
    if let Some(named) = named
        && named.iter().all(|name| joints.contains(&&**name))
    {
        let is_missing = |joint: &&&str| !named.iter().any(|name| name == **joint);
        let missing: Vec<&str> = joints.iter().filter(is_missing).copied().collect();
        if !missing.is_empty() {
            let missing = missing.join(", ");
            rejection.reason += &format!(": joint_names lacks {missing}");
        }
    }
    rejection
}

/// A path to follow.
#[derive(Debug, Clone, PartialEq)]
pub struct FollowPath<const N: usize> {
    /// The points after the present pose.
    pub points: Vec<Waypoint<N>>,
    /// Tolerance on the way.
    pub on_the_way: Tolerance<N>,
    /// Tolerance at the end.
    pub at_the_end: Tolerance<N>,
    /// Time after the end in which the joints must arrive \[s\]; infinite for no limit.
    pub patience: f64,
}

impl<const N: usize> FollowPath<N> {
    /// Reads a goal.
    ///
    /// # Errors
    /// All errors of the goal, or of the first invalid point.
    pub fn read(args: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::of_goal(args, Action::FollowJointTrajectory)?;
        let trajectory = fields.raw("trajectory");
        let mut entries = |name| fields.entries(name, MAX_TOLERANCES).unwrap_or_default();
        let (on_the_way, at_the_end) = (entries("path_tolerance"), entries("goal_tolerance"));
        let patience = fields.raw("goal_time_tolerance");
        let Some(trajectory) = trajectory.filter(|_| fields.accepted()) else {
            return Err(fields.finish());
        };
        let default = [Some(GOAL_TOLERANCE), Some(STOPPED_VELOCITY)];
        Ok(Self {
            points: points(trajectory)?,
            on_the_way: tolerance(&on_the_way, "path_tolerance", [None; 2])?,
            at_the_end: tolerance(&at_the_end, "goal_tolerance", default)?,
            patience: match patience {
                Some(raw) => match seconds(raw, "goal_time_tolerance")? {
                    0.0 => GOAL_TIME,
                    none if none < 0.0 => f64::INFINITY,
                    patience => patience,
                },
                None => GOAL_TIME,
            },
        })
    }
}

/// Feedback or result of the action, in JSON.
#[derive(Debug, Serialize)]
pub struct PathMessage(Value);

/// The result codes of the action.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResultCode {
    /// Arrived, or cancelled.
    Successful = 0,
    /// Refused or replaced.
    InvalidGoal = -1,
    /// Off the path.
    PathToleranceViolated = -4,
    /// Not at the end in time.
    GoalToleranceViolated = -5,
}

/// `control_msgs/action/FollowJointTrajectory_Result`.
#[must_use]
pub fn path_result(code: ResultCode, why: &str) -> PathMessage {
    PathMessage(json!({"error_code": code as i32, "error_string": why}))
}

/// `control_msgs/action/FollowJointTrajectory_Feedback` at simulation time `now`, `time` after the start \[s\].
#[must_use]
pub fn path_feedback<const N: usize>(
    now: f64,
    time: f64,
    desired: &Setpoint<N>,
    actual: &State<N>,
) -> PathMessage {
    let time_from_start = Stamp::from_seconds(time);
    let point = |positions: [f64; N], velocities: [f64; N]| {
        json!({
            "positions": positions.as_slice(),
            "velocities": velocities.as_slice(),
            "accelerations": [],
            "effort": [],
            "time_from_start": time_from_start,
        })
    };
    let off = |wanted: [f64; N], is: [f64; N]| {
        let mut off = wanted;
        off.iter_mut().zip(is).for_each(|(off, is)| *off -= is);
        off
    };
    PathMessage(json!({
        "header": Header::world(now),
        "joint_names": joint_names::<N>().as_slice(),
        "desired": point(desired.position, desired.velocity),
        "actual": point(actual.position, actual.velocity),
        "error": point(
            off(desired.position, actual.position),
            off(desired.velocity, actual.velocity),
        ),
    }))
}

fn points<const N: usize>(trajectory: &RawValue) -> Result<Vec<Waypoint<N>>, RejectedField> {
    let [names, points] = members(trajectory, "trajectory", &["joint_names", "points"])?;
    let names = names.and_then(|names| json::entries(names, N));
    let order = names.and_then(|names| order(&names)).ok_or_else(|| {
        let expected = format!("must name {}, each once", joint_names::<N>().join(", "));
        RejectedField::refused("trajectory.joint_names", &expected)
    })?;
    let field = "trajectory.points";
    let points = required(points, field)?;
    let entries =
        json::entries(points, MAX_POINTS).ok_or_else(|| mistyped(field, "an array", points))?;
    if entries.count > MAX_POINTS {
        let reason = too_many(MAX_POINTS, entries.count);
        return Err(RejectedField::refused(field, &reason));
    }
    let indexed = entries.first.into_iter().enumerate();
    indexed
        .map(|(at, raw)| point(raw, &format!("{field}[{at}]"), order))
        .collect()
}

fn point<const N: usize>(
    raw: &RawValue,
    field: &str,
    order: [usize; N],
) -> Result<Waypoint<N>, RejectedField> {
    let names = ["positions", "velocities", "time_from_start"];
    let [positions, velocities, time] = members(raw, field, &names)?;
    let named = |name: &str| format!("{field}.{name}");
    let positions = required(positions, &named("positions"))?;
    let of_time = named("time_from_start");
    let time = seconds(required(time, &of_time)?, &of_time)?;
    if time < 0.0 {
        return Err(RejectedField::refused(&of_time, &"must be at least 0 s"));
    }
    let values = |raw: &RawValue, name: &str| {
        let values = numbers(raw, &named(name))?;
        Ok(by_joint(order, &values))
    };
    Ok(Waypoint {
        time,
        position: values(positions, "positions")?,
        // An empty array counts as missing in a ROS message.
        velocity: velocities
            .filter(|raw| json::entries(raw, 0).is_none_or(|entries| entries.count > 0))
            .map(|raw| values(raw, "velocities"))
            .transpose()?,
    })
}

/// A duration in seconds: the sum of its parts, each under its name of ROS 2 or of ROS 1.
fn seconds(raw: &RawValue, field: &str) -> Result<f64, RejectedField> {
    let [sec, nanosec, secs, nsecs] =
        json::members(raw.get(), &["sec", "nanosec", "secs", "nsecs"])
            .map_err(|_| mistyped(field, "an object with sec and nanosec", raw))?;
    let part = |one: (Option<&RawValue>, &str), of_ros_1: (Option<&RawValue>, &str)| {
        let (value, name) = if one.0.is_some() { one } else { of_ros_1 };
        number_or_zero(value, &format!("{field}.{name}"))
    };
    let nanoseconds = part((nanosec, "nanosec"), (nsecs, "nsecs"));
    let sum = part((sec, "sec"), (secs, "secs"))? + 1e-9 * nanoseconds?;
    if !sum.is_finite() {
        let why = "must be a finite number of seconds";
        return Err(RejectedField::refused(field, &why));
    }
    Ok(sum)
}

/// The tolerance of each joint, with the default ones of position and velocity for a missing value and for 0. A negative
/// value means no limit.
fn tolerance<const N: usize>(
    entries: &[&RawValue],
    name: &str,
    [position, velocity]: [Option<f64>; 2],
) -> Result<Tolerance<N>, RejectedField> {
    let mut tolerance = Tolerance {
        position: [position; N],
        velocity: [velocity; N],
    };
    let limit = |value: f64, default: Option<f64>| match value {
        0.0 => default,
        value => Some(value).filter(|value| *value > 0.0),
    };
    for (at, raw) in entries.iter().enumerate() {
        let field = format!("{name}[{at}]");
        let names = ["name", "position", "velocity"];
        let [joint, of_position, of_velocity] = members(raw, &field, &names)?;
        let joint = joint.and_then(json::text).unwrap_or_default();
        let joint = joint_names::<N>().iter().position(|one| *one == joint);
        let unknown =
            || RejectedField::refused(&format!("{field}.name"), &"must be that of a joint");
        let joint = joint.ok_or_else(unknown)?;
        for (raw, name, limits, default) in [
            (of_position, "position", &mut tolerance.position, position),
            (of_velocity, "velocity", &mut tolerance.velocity, velocity),
        ] {
            let value = number_or_zero(raw, &format!("{field}.{name}"))?;
            if let Some(one) = limits.get_mut(joint) {
                *one = limit(value, default);
            }
        }
    }
    Ok(tolerance)
}

// ---- parts ----------------------------------------------------------------------------------------------------------

fn mistyped(field: &str, expected: &str, raw: &RawValue) -> RejectedField {
    RejectedField::refused(field, &fields::mistyped(expected, raw))
}

fn required<'a>(raw: Option<&'a RawValue>, field: &str) -> Result<&'a RawValue, RejectedField> {
    raw.ok_or_else(|| RejectedField::refused(field, &MISSING))
}

/// The members of these names in an object.
fn members<'a, const M: usize>(
    raw: &'a RawValue,
    field: &str,
    names: &[&str; M],
) -> Result<[Option<&'a RawValue>; M], RejectedField> {
    json::members(raw.get(), names).map_err(|_| mistyped(field, "an object", raw))
}

fn number_or_zero(raw: Option<&RawValue>, field: &str) -> Result<f64, RejectedField> {
    raw.map_or(Ok(0.0), |raw| finite(raw, Bound::Finite))
        .map_err(|reason| RejectedField::refused(field, &reason))
}

/// An array of `N` finite numbers.
fn numbers<const N: usize>(raw: &RawValue, field: &str) -> Result<[f64; N], RejectedField> {
    let entries =
        json::entries(raw, N).ok_or_else(|| mistyped(field, "an array of numbers", raw))?;
    let number = |(at, raw): (usize, &RawValue)| {
        let refused = |reason| RejectedField::refused(&format!("{field}[{at}]"), &reason);
        finite(raw, Bound::Finite).map_err(refused)
    };
    let length = || RejectedField::refused(field, &wrong_length(N, entries.count));
    if entries.count != N {
        return Err(length());
    }
    let numbers = entries.first.iter().copied().enumerate().map(number);
    let numbers = numbers.collect::<Result<Vec<_>, _>>()?;
    numbers.try_into().map_err(|_| length())
}

/// The index in the message of each joint of the arm; `None` unless `names` has each joint once.
fn order<const N: usize>(names: &Entries<'_>) -> Option<[usize; N]> {
    let spelled = names.first.iter().filter_map(|name| json::text(name));
    let spelled: Vec<_> = spelled.collect();
    let index = |joint: &str| spelled.iter().position(|name| name == joint);
    let indices: Option<Vec<usize>> = joint_names::<N>().into_iter().map(index).collect();
    indices?.try_into().ok().filter(|_| names.count == N)
}

/// The values in the arm's order.
fn by_joint<const N: usize>(order: [usize; N], values: &[f64; N]) -> [f64; N] {
    order.map(|index| values.get(index).copied().unwrap_or_default())
}
