//! The types of which ROS 2 builds services and actions, and the types inside a standard action that this arm does not
//! use.
//!
//! **Invariant:** fields are those of ROS 2's definitions.

use super::entry::{Type, message, required};

/// The types. A type follows the types that contain it.
pub(super) const TYPES: [Type; 9] = [
    message(
        "action_msgs/msg/GoalStatusArray",
        &[required("status_list", "action_msgs/msg/GoalStatus[]", "")],
    ),
    message(
        "action_msgs/msg/GoalStatus",
        &[
            required("goal_info", "action_msgs/msg/GoalInfo", ""),
            required("status", "int8", ""),
        ],
    ),
    message(
        "action_msgs/msg/GoalInfo",
        &[
            required("goal_id", "unique_identifier_msgs/msg/UUID", ""),
            required("stamp", "builtin_interfaces/msg/Time", "s, ns"),
        ],
    ),
    message(
        "unique_identifier_msgs/msg/UUID",
        &[required("uuid", "uint8[16]", "")],
    ),
    message(
        "service_msgs/msg/ServiceEventInfo",
        &[
            required("event_type", "uint8", ""),
            required("stamp", "builtin_interfaces/msg/Time", "s, ns"),
            required("client_gid", "uint8[16]", ""),
            required("sequence_number", "int64", ""),
        ],
    ),
    message(
        "control_msgs/msg/JointComponentTolerance",
        &[
            required("joint_name", "string", ""),
            required("component", "uint16", ""),
            required("position", "float64", ""),
            required("velocity", "float64", ""),
            required("acceleration", "float64", ""),
        ],
    ),
    message(
        "trajectory_msgs/msg/MultiDOFJointTrajectory",
        &[
            required("header", "std_msgs/msg/Header", ""),
            required("joint_names", "string[]", ""),
            required(
                "points",
                "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint[]",
                "",
            ),
        ],
    ),
    message(
        "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint",
        &[
            required("transforms", "geometry_msgs/msg/Transform[]", "m"),
            required("velocities", "geometry_msgs/msg/Twist[]", "m/s, rad/s"),
            required(
                "accelerations",
                "geometry_msgs/msg/Twist[]",
                "m/s^2, rad/s^2",
            ),
            required(
                "time_from_start",
                "builtin_interfaces/msg/Duration",
                "s, ns",
            ),
        ],
    ),
    message(
        "geometry_msgs/msg/Twist",
        &[
            required("linear", "geometry_msgs/msg/Vector3", "m/s"),
            required("angular", "geometry_msgs/msg/Vector3", "rad/s"),
        ],
    ),
];
