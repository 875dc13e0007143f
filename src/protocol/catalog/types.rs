//! The message types of the runtime's own topics, and the types inside them.
//!
//! **Invariant:** the type of every field of a known type is known too, so every definition is complete.

use std::collections::HashMap;
use std::sync::LazyLock;

pub use super::entry::{Constant, Count, Type};
use super::entry::{Field, byte, message, required};
use super::services::WISH;
use super::topics::{TRANSFORMS, Topic};
use super::{Action, nested, parameter_types, ros2_types};
use crate::protocol::names;

/// The separator between the definitions of a type and of the types in it: a line of 80.
const SEPARATOR: &str = "=";

/// All message types: first those of the topics, then the types inside them.
pub fn all() -> impl Iterator<Item = Type> {
    let topics = Topic::ALL.into_iter().map(Topic::message);
    topics
        .chain(PARTS)
        .chain(nested::TYPES)
        .chain(parameter_types::TYPES)
        .chain(ros2_types::TYPES)
}

/// The types by name, and by name without the middle part. One query about types looks up hundreds.
static BY_NAME: LazyLock<HashMap<String, Type>> = LazyLock::new(|| {
    let parts = || Action::ALL.into_iter().flat_map(Action::parts);
    let mut by_name = HashMap::new();
    for one in all().chain(parts()) {
        by_name.entry(one.name.to_owned()).or_insert(one);
    }
    for one in all().chain(parts()) {
        by_name.entry(names::short_type(one.name)).or_insert(one);
    }
    by_name
});

/// The type of that name, including the types of an action's goal, result and feedback. The middle part of the name
/// is optional.
#[must_use]
pub fn find(name: &str) -> Option<Type> {
    let found = BY_NAME.get(name);
    let found = found.or_else(|| BY_NAME.get(&names::short_type(name)));
    found
        .copied()
        .filter(|one| names::same_type(one.name, name))
}

/// `first` and every type inside it, each once, in the order of first use.
#[must_use]
pub fn with_parts(first: Type) -> Vec<Type> {
    let mut found = vec![first];
    let mut at = 0;
    while let Some(one) = found.get(at).copied() {
        for field in one.fields {
            let (kind, _) = field.element();
            if let Some(part) = find(kind)
                && !found.iter().any(|known| known.name == part.name)
            {
                found.push(part);
            }
        }
        at += 1;
    }
    found
}

/// The text that defines a type and all types in it, in the format of `.msg` files, with units in comments.
#[must_use]
pub fn full_text(name: &str) -> Option<String> {
    find(name).map(definition)
}

/// The same for a type that may be outside the catalog.
#[must_use]
pub fn definition(first: Type) -> String {
    let mut text = String::new();
    for (index, one) in with_parts(first).into_iter().enumerate() {
        if index > 0 {
            text.push_str(&SEPARATOR.repeat(80));
            text.push_str("\nMSG: ");
            text.push_str(&names::short_type(one.name));
            text.push('\n');
        }
        text.push_str(&own_text(one));
    }
    text
}

fn own_text(one: Type) -> String {
    let constants = one
        .constants
        .iter()
        .map(|one| format!("{} {}={}\n", one.kind, one.name, one.value));
    let fields = one.fields.iter().map(|field| {
        let kind = names::short_type(field.kind);
        match field.unit {
            "" => format!("{kind} {}\n", field.name),
            unit => format!("{kind} {}  # {unit}\n", field.name),
        }
    });
    constants.chain(fields).collect()
}

const TIME: [Field; 2] = [
    required("sec", "int32", "s"),
    required("nanosec", "uint32", "ns"),
];

/// The types inside other types.
const PARTS: [Type; 18] = [
    message(
        "std_msgs/msg/MultiArrayLayout",
        &[
            required("dim", "std_msgs/msg/MultiArrayDimension[]", ""),
            required("data_offset", "uint32", ""),
        ],
    ),
    message(
        "std_msgs/msg/MultiArrayDimension",
        &[
            required("label", "string", ""),
            required("size", "uint32", ""),
            required("stride", "uint32", ""),
        ],
    ),
    message(
        "std_msgs/msg/Header",
        &[
            required("stamp", "builtin_interfaces/msg/Time", "s, ns"),
            required("frame_id", "string", ""),
        ],
    ),
    message("builtin_interfaces/msg/Time", &TIME),
    message("builtin_interfaces/msg/Duration", &TIME),
    message(
        "trajectory_msgs/msg/JointTrajectoryPoint",
        &[
            required("positions", "float64[]", "rad"),
            required("velocities", "float64[]", "rad/s"),
            required("accelerations", "float64[]", "rad/s^2"),
            required("effort", "float64[]", "N m"),
            required(
                "time_from_start",
                "builtin_interfaces/msg/Duration",
                "s, ns",
            ),
        ],
    ),
    message(
        "control_msgs/msg/JointTolerance",
        &[
            required("name", "string", ""),
            required("position", "float64", "rad"),
            required("velocity", "float64", "rad/s"),
            required("acceleration", "float64", "rad/s^2"),
        ],
    ),
    message(
        "actionlib_msgs/msg/GoalStatus",
        &[
            required("goal_id", "actionlib_msgs/msg/GoalID", ""),
            required("status", "uint8", ""),
            required("text", "string", ""),
        ],
    ),
    message("tf2_web_republisher/msg/TFSubscriptionGoal", &WISH),
    message(
        "tf2_web_republisher/msg/TFSubscriptionFeedback",
        &TRANSFORMS,
    ),
    message(
        "diagnostic_msgs/msg/DiagnosticStatus",
        &[
            required("level", "byte", ""),
            required("name", "string", ""),
            required("message", "string", ""),
            required("hardware_id", "string", ""),
            required("values", "diagnostic_msgs/msg/KeyValue[]", ""),
        ],
    )
    .constants(&HEALTH),
    message(
        "diagnostic_msgs/msg/KeyValue",
        &[
            required("key", "string", ""),
            required("value", "string", ""),
        ],
    ),
    message(
        "pendularm_interfaces/msg/Target",
        &[
            required("x", "float64", "m"),
            required("y", "float64", "m"),
            required("phi", "float64", "rad"),
        ],
    ),
    message(
        "geometry_msgs/msg/TransformStamped",
        &[
            required("header", "std_msgs/msg/Header", ""),
            required("child_frame_id", "string", ""),
            required("transform", "geometry_msgs/msg/Transform", "m"),
        ],
    ),
    message(
        "geometry_msgs/msg/Transform",
        &[
            required("translation", "geometry_msgs/msg/Vector3", "m"),
            required("rotation", "geometry_msgs/msg/Quaternion", ""),
        ],
    ),
    message("geometry_msgs/msg/Vector3", &XYZ),
    message(
        "geometry_msgs/msg/Quaternion",
        &[
            required("x", "float64", "1"),
            required("y", "float64", "1"),
            required("z", "float64", "1"),
            required("w", "float64", "1"),
        ],
    ),
    message(
        "rosapi_msgs/msg/TypeDef",
        &[
            required("type", "string", ""),
            required("fieldnames", "string[]", ""),
            required("fieldtypes", "string[]", ""),
            required("fieldarraylen", "int32[]", ""),
            required("examples", "string[]", ""),
            required("constnames", "string[]", ""),
            required("constvalues", "string[]", ""),
        ],
    ),
];

const XYZ: [Field; 3] = [
    required("x", "float64", "m"),
    required("y", "float64", "m"),
    required("z", "float64", "m"),
];

const HEALTH: [Constant; 4] = [
    byte("OK", "0"),
    byte("WARN", "1"),
    byte("ERROR", "2"),
    byte("STALE", "3"),
];
