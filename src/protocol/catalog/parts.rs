//! The types inside other types: parts of messages, of requests and responses, of parameters, and the types of which
//! ROS 2 builds services and actions.
//!
//! **Invariant:** the fields and constants of a type of ROS are those of its definition in Jazzy.

use super::entry::{Field, Type, fields, message};

/// The members of `params` in a request are the fields of `/arm_sim/set_params`.
pub(super) const PARAMS: &[Field] = fields![
    "float64 gravity?  # m/s^2",
    "float64[] masses?  # kg",
    "float64[] lengths?  # m",
];
/// The members of `gains` in a request are the fields of `/pid_controller/set_gains`.
pub(super) const GAINS: &[Field] = fields![
    "float64[] kp?  # N m/rad",
    "float64[] ki?  # N m/(rad s)",
    "float64[] kd?  # N m s/rad",
];
/// The members of `limits` in a request are the fields of `/pid_controller/set_limits`.
pub(super) const LIMITS: &[Field] = fields![
    "float64[] effort?  # N m",
    "string anti_windup?",
    "float64 tracking_time?  # s",
];
/// The members of `sensors` in a request are the fields of `/pid_controller/set_sensors`.
pub(super) const SENSORS: &[Field] = fields![
    "float64[] encoder_step?  # rad",
    "string velocity?",
    "uint64 delay?",
];

/// The members of `tableau` in a request: a method by its name, or by its coefficients, numbers or fractions.
pub(super) const TABLEAU: &[Field] = fields![
    "string name?",
    "float64[] a?",
    "float64[] b?",
    "float64[] c?",
    "float64[] b_hat?",
    "float64[] a_q?",
    "float64[] b_q?",
];

/// A viewer's request: frames relative to another frame.
pub(super) const FRAME_GOAL: &[Field] = fields![
    "string[] source_frames",
    "string target_frame",
    "float32 angular_thres?",
    "float32 trans_thres?",
    "float32 rate?  # Hz",
];
/// Frames.
pub(super) const TRANSFORMS: &[Field] = fields!["geometry_msgs/msg/TransformStamped[] transforms"];

/// Defines a list of types, one row each: the name, and the fields or a constant with them.
macro_rules! types {
    (@fields [$($field:literal),* $(,)?]) => { fields![$($field),*] };
    (@fields $fields:ident) => { $fields };
    ($($name:literal: $fields:tt $(with $constants:literal)?,)*) => {
        &[$(message($name, types!(@fields $fields))$(.with_constants($constants))?),*]
    };
}

/// The types inside other types.
pub(super) const TYPES: &[Type] = types! {
    "std_msgs/msg/MultiArrayLayout": ["std_msgs/msg/MultiArrayDimension[] dim", "uint32 data_offset"],
    "std_msgs/msg/MultiArrayDimension": ["string label", "uint32 size", "uint32 stride"],
    "std_msgs/msg/Header": ["builtin_interfaces/msg/Time stamp  # s, ns", "string frame_id"],
    "builtin_interfaces/msg/Time": ["int32 sec  # s", "uint32 nanosec  # ns"],
    "builtin_interfaces/msg/Duration": ["int32 sec  # s", "uint32 nanosec  # ns"],
    "trajectory_msgs/msg/JointTrajectoryPoint": [
        "float64[] positions  # rad",
        "float64[] velocities  # rad/s",
        "float64[] accelerations  # rad/s^2",
        "float64[] effort  # N m",
        "builtin_interfaces/msg/Duration time_from_start  # s, ns",
    ],
    "control_msgs/msg/JointTolerance": [
        "string name",
        "float64 position  # rad",
        "float64 velocity  # rad/s",
        "float64 acceleration  # rad/s^2",
    ],
    "actionlib_msgs/msg/GoalStatus": [
        "actionlib_msgs/msg/GoalID goal_id",
        "uint8 status",
        "string text",
    ] with "uint8 PENDING=0 ACTIVE=1 PREEMPTED=2 SUCCEEDED=3 ABORTED=4 REJECTED=5 PREEMPTING=6 RECALLING=7 RECALLED=8 LOST=9",
    "tf2_web_republisher/msg/TFSubscriptionGoal": FRAME_GOAL,
    "tf2_web_republisher/msg/TFSubscriptionFeedback": TRANSFORMS,
    "diagnostic_msgs/msg/DiagnosticStatus": [
        "byte level",
        "string name",
        "string message",
        "string hardware_id",
        "diagnostic_msgs/msg/KeyValue[] values",
    ] with "byte OK=0 WARN=1 ERROR=2 STALE=3",
    "diagnostic_msgs/msg/KeyValue": ["string key", "string value"],
    "pendularm_interfaces/msg/Target": ["float64 x  # m", "float64 y  # m", "float64 phi  # rad"],
    "geometry_msgs/msg/TransformStamped": [
        "std_msgs/msg/Header header",
        "string child_frame_id",
        "geometry_msgs/msg/Transform transform  # m",
    ],
    "geometry_msgs/msg/Transform": [
        "geometry_msgs/msg/Vector3 translation  # m",
        "geometry_msgs/msg/Quaternion rotation",
    ],
    "geometry_msgs/msg/Vector3": ["float64 x  # m", "float64 y  # m", "float64 z  # m"],
    "geometry_msgs/msg/Quaternion": [
        "float64 x  # 1",
        "float64 y  # 1",
        "float64 z  # 1",
        "float64 w  # 1",
    ],
    "rosapi_msgs/msg/TypeDef": [
        "string type",
        "string[] fieldnames",
        "string[] fieldtypes",
        "int32[] fieldarraylen",
        "string[] examples",
        "string[] constnames",
        "string[] constvalues",
    ],
    "pendularm_interfaces/msg/Gains": GAINS,
    "pendularm_interfaces/msg/Params": PARAMS,
    "pendularm_interfaces/msg/Limits": LIMITS,
    "pendularm_interfaces/msg/Sensors": SENSORS,
    "pendularm_interfaces/msg/Tableau": TABLEAU,
    "pendularm_interfaces/msg/OwnPlan": ["float64 timestep  # s", "uint64 evaluations", "float64 error  # m"],
    "pendularm_interfaces/msg/CriticalMode": [
        "float64 growth_per_step",
        "float64 frequency  # Hz",
        "int64 joint",
    ],
    "pendularm_interfaces/msg/Divergence": ["uint64 step", "float64 time  # s"],
    "pendularm_interfaces/msg/HeldMode": [
        "float64 growth_per_period",
        "float64 frequency  # Hz",
        "int64 joint",
        "float64[] mode  # 1",
        "bool reverses",
    ],
    "rcl_interfaces/msg/Parameter": ["string name", "rcl_interfaces/msg/ParameterValue value"],
    "rcl_interfaces/msg/ParameterValue": [
        "uint8 type",
        "bool bool_value",
        "int64 integer_value",
        "float64 double_value",
        "string string_value",
        "byte[] byte_array_value",
        "bool[] bool_array_value",
        "int64[] integer_array_value",
        "float64[] double_array_value",
        "string[] string_array_value",
    ],
    "rcl_interfaces/msg/ParameterDescriptor": [
        "string name",
        "uint8 type",
        "string description",
        "string additional_constraints",
        "bool read_only",
        "bool dynamic_typing",
        "rcl_interfaces/msg/FloatingPointRange[<=1] floating_point_range",
        "rcl_interfaces/msg/IntegerRange[<=1] integer_range",
    ],
    "rcl_interfaces/msg/FloatingPointRange": [
        "float64 from_value",
        "float64 to_value",
        "float64 step",
    ],
    "rcl_interfaces/msg/IntegerRange": ["int64 from_value", "int64 to_value", "uint64 step"],
    "rcl_interfaces/msg/ListParametersResult": ["string[] names", "string[] prefixes"],
    "rcl_interfaces/msg/SetParametersResult": ["bool successful", "string reason"],
    "action_msgs/msg/GoalStatusArray": ["action_msgs/msg/GoalStatus[] status_list"],
    "action_msgs/msg/GoalStatus": ["action_msgs/msg/GoalInfo goal_info", "int8 status"]
        with "int8 STATUS_UNKNOWN=0 STATUS_ACCEPTED=1 STATUS_EXECUTING=2 STATUS_CANCELING=3 STATUS_SUCCEEDED=4 STATUS_CANCELED=5 STATUS_ABORTED=6",
    "action_msgs/msg/GoalInfo": [
        "unique_identifier_msgs/msg/UUID goal_id",
        "builtin_interfaces/msg/Time stamp  # s, ns",
    ],
    "unique_identifier_msgs/msg/UUID": ["uint8[16] uuid"],
    "service_msgs/msg/ServiceEventInfo": [
        "uint8 event_type",
        "builtin_interfaces/msg/Time stamp  # s, ns",
        "uint8[16] client_gid",
        "int64 sequence_number",
    ] with "uint8 REQUEST_SENT=0 REQUEST_RECEIVED=1 RESPONSE_SENT=2 RESPONSE_RECEIVED=3",
    "control_msgs/msg/JointComponentTolerance": [
        "string joint_name",
        "uint16 component",
        "float64 position",
        "float64 velocity",
        "float64 acceleration",
    ],
    "trajectory_msgs/msg/MultiDOFJointTrajectory": [
        "std_msgs/msg/Header header",
        "string[] joint_names",
        "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint[] points",
    ],
    "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint": [
        "geometry_msgs/msg/Transform[] transforms  # m",
        "geometry_msgs/msg/Twist[] velocities  # m/s, rad/s",
        "geometry_msgs/msg/Twist[] accelerations  # m/s^2, rad/s^2",
        "builtin_interfaces/msg/Duration time_from_start  # s, ns",
    ],
    "geometry_msgs/msg/Twist": [
        "geometry_msgs/msg/Vector3 linear  # m/s",
        "geometry_msgs/msg/Vector3 angular  # rad/s",
    ],
};
