//! The topics: one row each.
//!
//! **Invariant:** a row has the whole type of its messages, so every topic has a definition.

use super::entry::{Direction, Field, TopicEntry, Type, fields, message, published, subscribed};
use super::node::Node;
use super::parts::TRANSFORMS;
use super::table::{named, table};

table! {
    /// A topic of the runtime's own.
    pub enum Topic of TopicEntry {
        /// Setpoints for the controller: the last point is held.
        JointTrajectory = subscribed("/joint_trajectory", Node::ArmSim, "trajectory_msgs/msg/JointTrajectory", fields![
            "std_msgs/msg/Header header?",
            "string[] joint_names?",
            "trajectory_msgs/msg/JointTrajectoryPoint[] points  # rad, rad/s",
        ]),
        /// Efforts that are applied while the controller is off.
        EffortCommands =
            subscribed("/effort_controller/commands", Node::ArmSim, "std_msgs/msg/Float64MultiArray", fields![
            "std_msgs/msg/MultiArrayLayout layout?",
            "float64[] data  # N m",
        ]),
        /// The arm's state, 60 Hz.
        JointStates = published("/joint_states", Node::ArmSim, "sensor_msgs/msg/JointState", JOINT_STATE),
        /// What the controller measures, 60 Hz.
        MeasuredStates = published("/joint_states_measured", Node::ArmSim, "sensor_msgs/msg/JointState", JOINT_STATE),
        /// Simulation time, 60 Hz.
        Clock = published("/clock", Node::ArmSim, "rosgraph_msgs/msg/Clock", fields![
            "builtin_interfaces/msg/Time clock  # s, ns",
        ]),
        /// Health of the arm and of the gateway, 1 Hz and at every change.
        Diagnostics = published("/diagnostics", Node::ArmSim, "diagnostic_msgs/msg/DiagnosticArray", fields![
            "std_msgs/msg/Header header",
            "diagnostic_msgs/msg/DiagnosticStatus[] status",
        ]),
        /// Progress of the active goal.
        IkFeedback = published("/ik_action/feedback", Node::IkAction, "pendularm_interfaces/msg/IkFeedback", fields![
            "string goal_id",
            "pendularm_interfaces/msg/Target target  # m, rad",
            "float64[] positions  # rad",
            "float64 distance_remaining  # m",
            "float64 elapsed  # s",
        ]),
        /// The result of a goal.
        IkResult = published("/ik_action/result", Node::IkAction, "pendularm_interfaces/msg/IkResult", fields![
            "string goal_id",
            "string outcome",
            "pendularm_interfaces/msg/Target target  # m, rad",
            "float64 final_distance  # m",
        ])
            .supersedes(&["/ik_action/feedback"]),
        /// The timed trial, 10 Hz and at every change.
        TrialStatus = published("/ik_trial/status", Node::IkTrial, "pendularm_interfaces/msg/TrialStatus", fields![
            "bool running",
            "float64 elapsed  # s",
            "float64 duration  # s",
            "uint64 targets_reached",
            "pendularm_interfaces/msg/Target target  # m, rad",
            "float64 error  # m",
            "float64[] desired_positions  # rad",
            "string action_status",
        ]),
        /// Poses of the links, 60 Hz.
        Tf = published("/tf", Node::ArmSim, "tf2_msgs/msg/TFMessage", TRANSFORMS),
        /// The end effector's pose on its link.
        TfStatic = published("/tf_static", Node::ArmSim, "tf2_msgs/msg/TFMessage", TRANSFORMS)
            .latched(),
        /// Every frame relative to `world`, 30 Hz, for web viewers.
        TfWeb = published(
            "/tf2_web_republisher/frames", Node::ArmSim, "tf2_web_republisher/msg/TFArray", TRANSFORMS),
        /// A viewer's request for frames, as roslib 1 sends it.
        TfWebGoal = subscribed("/tf2_web_republisher/goal", Node::TfRepublisher,
            "tf2_web_republisher/msg/TFSubscriptionActionGoal", fields![
            "std_msgs/msg/Header header",
            "actionlib_msgs/msg/GoalID goal_id",
            "tf2_web_republisher/msg/TFSubscriptionGoal goal",
        ]),
        /// The end of such a request.
        TfWebCancel = subscribed(
            "/tf2_web_republisher/cancel", Node::TfRepublisher, "actionlib_msgs/msg/GoalID", GOAL_ID),
        /// The requested frames.
        TfWebFeedback = published("/tf2_web_republisher/feedback", Node::TfRepublisher,
            "tf2_web_republisher/msg/TFSubscriptionActionFeedback", fields![
            "std_msgs/msg/Header header",
            "actionlib_msgs/msg/GoalStatus status",
            "tf2_web_republisher/msg/TFSubscriptionFeedback feedback",
        ]),
        /// The arm as URDF.
        RobotDescription = published("/robot_description", Node::ArmSim, "std_msgs/msg/String", fields![
            "string data",
        ])
            .latched(),
        /// The arm as SRDF, for planners.
        RobotSemantics = published("/robot_description_semantic", Node::ArmSim, "std_msgs/msg/String", fields![
            "string data",
        ])
            .latched(),
        /// The runtime's warnings.
        Rosout = published("/rosout", Node::Gateway, "rcl_interfaces/msg/Log", fields![
            "builtin_interfaces/msg/Time stamp  # s, ns",
            "uint8 level",
            "string name",
            "string msg",
            "string file",
            "string function",
            "uint32 line",
        ])
        .constants("uint8 DEBUG=10 INFO=20 WARN=30 ERROR=40 FATAL=50"),
        /// The local error of the arm's steps, 10 Hz.
        ErrorEstimate =
            published("/arm_sim/error_estimate", Node::ArmSim, "pendularm_interfaces/msg/ErrorEstimate", fields![
            "string method",
            "float64 timestep  # s",
            "float64 local_error  # rad",
            "float64 velocity_error  # rad/s",
            "float64 error_per_second  # rad/s",
            "float64 predicted_limit  # s",
        ]),
    }
}

/// A state of all joints.
const JOINT_STATE: &[Field] = fields![
    "std_msgs/msg/Header header",
    "string[] name",
    "float64[] position  # rad",
    "float64[] velocity  # rad/s",
    "float64[] effort  # N m",
];
/// A goal's name in ROS 1.
const GOAL_ID: &[Field] = fields!["builtin_interfaces/msg/Time stamp  # s, ns", "string id?",];

/// The names of topics, in both spellings.
macro_rules! spellings {
    ($($topic:ident),*) => { &[$(Topic::$topic.name(), Topic::$topic.short_name()),*] };
}

/// Topics of the arm's state. `/diagnostics` is not among them: its message about a change is sent before the answer,
/// and stays valid.
pub(super) const ARM_STATE: &[&str] = spellings![JointStates, MeasuredStates, Clock, Tf];
/// The same, and the feedback of a goal: after a pause and a reset none is due.
pub(super) const ARM_STATE_AND_FEEDBACK: &[&str] =
    spellings![JointStates, MeasuredStates, Clock, Tf, IkFeedback];

named!(Topic, |_: &str| None);

impl Topic {
    /// The name without its leading slash, as some clients spell it.
    #[must_use]
    pub const fn short_name(self) -> &'static str {
        self.entry().name.split_at(1).1
    }

    /// Whether the runtime publishes or subscribes to these messages.
    #[must_use]
    pub const fn direction(self) -> Direction {
        self.entry().direction
    }

    /// Whether the runtime subscribes to these messages.
    #[must_use]
    pub const fn is_subscribed(self) -> bool {
        matches!(self.direction(), Direction::Subscribed)
    }

    /// Whether a new subscriber gets the last message.
    #[must_use]
    pub const fn is_latched(self) -> bool {
        self.entry().latched
    }

    /// Topics, by their names. No earlier message of them may follow a message of this topic, or what is sent after it.
    #[must_use]
    pub const fn supersedes(self) -> &'static [&'static str] {
        self.entry().supersedes
    }

    /// The type of its messages.
    pub(super) const fn message(self) -> Type {
        let row = self.entry();
        message(row.type_name, row.fields).with_constants(row.constants)
    }

    /// The fields of a message.
    #[must_use]
    pub const fn fields(self) -> &'static [Field] {
        self.entry().fields
    }
}

#[cfg(test)]
mod tests {
    use super::ARM_STATE;
    use crate::protocol::catalog::{Rosapi, Service};

    /// A query, a listing or a computation does not change the arm, so waiting messages stay valid.
    #[test]
    fn the_arms_state_becomes_outdated_only_by_changes_of_the_arm() {
        let questions = Rosapi::ALL.into_iter().map(Service::Rosapi);
        let changes = Service::ALL
            .into_iter()
            .chain(questions)
            .filter(|service| !service.supersedes().is_empty());
        let mut changes: Vec<&str> = changes
            .inspect(|service| assert!(service.supersedes().starts_with(ARM_STATE)))
            .map(Service::name)
            .collect();
        changes.sort_unstable();
        assert_eq!(
            changes,
            [
                "/arm_sim/disturb",
                "/arm_sim/pause",
                "/arm_sim/reset",
                "/arm_sim/set_friction",
                "/arm_sim/set_integrator",
                "/arm_sim/set_parameters",
                "/arm_sim/set_params",
                "/arm_sim/set_state",
                "/arm_sim/step",
                "/pid_controller/enable",
                "/pid_controller/set_gains",
                "/pid_controller/set_limits",
                "/pid_controller/set_period",
                "/pid_controller/set_sensors",
                "/rosapi/set_param",
            ]
        );
    }
}
