//! The topics: one row each.
//!
//! **Invariant:** a row has the whole type of its messages, so every topic has a definition.

use super::entry::{
    Constant, Direction, Field, TopicEntry, Type, byte, optional, published, required, subscribed,
};
use super::node::Node;
use super::table::{fields, table};
use crate::protocol::names;

table! {
    /// A topic of the runtime's own.
    pub enum Topic of TopicEntry {
        /// Setpoints for the controller: the last point is held.
        JointTrajectory = subscribed("/joint_trajectory", Node::ArmSim, "trajectory_msgs/msg/JointTrajectory", fields![
            optional("header", "std_msgs/msg/Header", ""),
            optional("joint_names", "string[]", ""),
            required("points", "trajectory_msgs/msg/JointTrajectoryPoint[]", "rad, rad/s"),
        ]),
        /// Efforts that are applied while the controller is off.
        EffortCommands =
            subscribed("/effort_controller/commands", Node::ArmSim, "std_msgs/msg/Float64MultiArray", fields![
            optional("layout", "std_msgs/msg/MultiArrayLayout", ""),
            required("data", "float64[]", "N m"),
        ]),
        /// The arm's state, 60 Hz.
        JointStates = published("/joint_states", Node::ArmSim, "sensor_msgs/msg/JointState", fields![
            required("header", "std_msgs/msg/Header", ""),
            required("name", "string[]", ""),
            required("position", "float64[]", "rad"),
            required("velocity", "float64[]", "rad/s"),
            required("effort", "float64[]", "N m"),
        ]),
        /// Simulation time, 60 Hz.
        Clock = published("/clock", Node::ArmSim, "rosgraph_msgs/msg/Clock", fields![
            required("clock", "builtin_interfaces/msg/Time", "s, ns"),
        ]),
        /// Health of the arm and of the gateway, 1 Hz and at every change.
        Diagnostics = published("/diagnostics", Node::ArmSim, "diagnostic_msgs/msg/DiagnosticArray", fields![
            required("header", "std_msgs/msg/Header", ""),
            required("status", "diagnostic_msgs/msg/DiagnosticStatus[]", ""),
        ]),
        /// Progress of the active goal.
        IkFeedback = published("/ik_action/feedback", Node::IkAction, "pendularm_interfaces/msg/IkFeedback", fields![
            required("goal_id", "string", ""),
            required("target", "pendularm_interfaces/msg/Target", "m, rad"),
            required("positions", "float64[]", "rad"),
            required("distance_remaining", "float64", "m"),
            required("elapsed", "float64", "s"),
        ]),
        /// The result of a goal.
        IkResult = published("/ik_action/result", Node::IkAction, "pendularm_interfaces/msg/IkResult", fields![
            required("goal_id", "string", ""),
            required("outcome", "string", ""),
            required("target", "pendularm_interfaces/msg/Target", "m, rad"),
            required("final_distance", "float64", "m"),
        ]),
        /// The timed trial, 10 Hz and at every change.
        TrialStatus = published("/ik_trial/status", Node::IkTrial, "pendularm_interfaces/msg/TrialStatus", fields![
            required("running", "bool", ""),
            required("elapsed", "float64", "s"),
            required("duration", "float64", "s"),
            required("targets_reached", "uint64", ""),
            required("target", "pendularm_interfaces/msg/Target", "m, rad"),
            required("error", "float64", "m"),
            required("desired_positions", "float64[]", "rad"),
            required("action_status", "string", ""),
        ]),
        /// Poses of the links, 60 Hz.
        Tf = published("/tf", Node::ArmSim, "tf2_msgs/msg/TFMessage", &TRANSFORMS),
        /// The end effector's pose on its link.
        TfStatic = published("/tf_static", Node::ArmSim, "tf2_msgs/msg/TFMessage", &TRANSFORMS)
            .latched(),
        /// Every frame relative to `world`, 30 Hz, for web viewers.
        TfWeb = published(
            "/tf2_web_republisher/frames", Node::TfRepublisher, "tf2_web_republisher/msg/TFArray", &TRANSFORMS),
        /// A viewer's request for frames, as roslib 1 sends it.
        TfWebGoal = subscribed("/tf2_web_republisher/goal", Node::TfRepublisher,
            "tf2_web_republisher/msg/TFSubscriptionActionGoal", fields![
            required("header", "std_msgs/msg/Header", ""),
            required("goal_id", "actionlib_msgs/msg/GoalID", ""),
            required("goal", "tf2_web_republisher/msg/TFSubscriptionGoal", ""),
        ]),
        /// The end of such a request.
        TfWebCancel = subscribed(
            "/tf2_web_republisher/cancel", Node::TfRepublisher, "actionlib_msgs/msg/GoalID", &GOAL_ID),
        /// The requested frames.
        TfWebFeedback = published("/tf2_web_republisher/feedback", Node::TfRepublisher,
            "tf2_web_republisher/msg/TFSubscriptionActionFeedback", fields![
            required("header", "std_msgs/msg/Header", ""),
            required("status", "actionlib_msgs/msg/GoalStatus", ""),
            required("feedback", "tf2_web_republisher/msg/TFSubscriptionFeedback", ""),
        ]),
        /// The arm as URDF.
        RobotDescription = published("/robot_description", Node::ArmSim, "std_msgs/msg/String", fields![
            required("data", "string", ""),
        ])
            .latched(),
        /// The arm as SRDF, for planners.
        RobotSemantics = published("/robot_description_semantic", Node::ArmSim, "std_msgs/msg/String", fields![
            required("data", "string", ""),
        ])
            .latched(),
        /// The runtime's warnings.
        Rosout = published("/rosout", Node::Gateway, "rcl_interfaces/msg/Log", fields![
            required("stamp", "builtin_interfaces/msg/Time", "s, ns"),
            required("level", "uint8", ""),
            required("name", "string", ""),
            required("msg", "string", ""),
            required("file", "string", ""),
            required("function", "string", ""),
            required("line", "uint32", ""),
        ])
        .constants(&LOG_LEVELS),
        /// The local error of the arm's steps, 10 Hz.
        ErrorEstimate =
            published("/arm_sim/error_estimate", Node::ArmSim, "pendularm_interfaces/msg/ErrorEstimate", fields![
            required("method", "string", ""),
            required("timestep", "float64", "s"),
            required("local_error", "float64", "rad"),
            required("velocity_error", "float64", "rad/s"),
            required("error_per_second", "float64", "rad/s"),
            required("predicted_limit", "float64", "s"),
        ]),
    }
}

const LOG_LEVELS: [Constant; 5] = [
    byte("DEBUG", "10"),
    byte("INFO", "20"),
    byte("WARN", "30"),
    byte("ERROR", "40"),
    byte("FATAL", "50"),
];

/// A goal's name in ROS 1.
const GOAL_ID: [Field; 2] = [
    required("stamp", "builtin_interfaces/msg/Time", "s, ns"),
    required("id", "string", ""),
];

pub(super) const TRANSFORMS: [Field; 1] = [required(
    "transforms",
    "geometry_msgs/msg/TransformStamped[]",
    "",
)];

/// The names of topics, in both spellings.
macro_rules! spellings {
    ($($topic:ident),*) => { &[$(Topic::$topic.name(), Topic::$topic.short_name()),*] };
}

/// Topics of the arm's state. `/diagnostics` is not among them: its message about a change is sent before the answer,
/// and stays valid.
pub(super) const ARM_STATE: &[&str] = spellings![JointStates, Clock, Tf];
/// The same, and the feedback of a goal: after a pause and a reset none is due.
pub(super) const ARM_STATE_AND_FEEDBACK: &[&str] = spellings![JointStates, Clock, Tf, IkFeedback];

impl Topic {
    /// The topic's name on the wire.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.entry().name
    }

    /// The same without its leading slash, as some clients spell it.
    #[must_use]
    pub const fn short_name(self) -> &'static str {
        self.entry().name.split_at(1).1
    }

    /// The topic of that name, if it is the runtime's own. The leading slash is optional.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let name = names::absolute(name);
        Self::ALL.into_iter().find(|topic| topic.name() == name)
    }

    /// The message type in ROS notation.
    #[must_use]
    pub const fn type_name(self) -> &'static str {
        self.entry().message.name
    }

    /// Whether the runtime publishes or subscribes to these messages.
    #[must_use]
    pub const fn direction(self) -> Direction {
        self.entry().direction
    }

    /// The node that publishes the topic or subscribes to it. The arm owns `/diagnostics`; the gateway adds a status.
    #[must_use]
    pub const fn owner(self) -> Node {
        self.entry().owner
    }

    /// Whether a new subscriber gets the last message.
    #[must_use]
    pub const fn is_latched(self) -> bool {
        self.entry().latched
    }

    /// The type of its messages.
    pub(super) const fn message(self) -> Type {
        self.entry().message
    }

    /// The fields of a message.
    #[must_use]
    pub const fn fields(self) -> &'static [Field] {
        self.entry().message.fields
    }
}

#[cfg(test)]
mod tests {
    use super::ARM_STATE;
    use crate::protocol::catalog::{Rosapi, Service};

    /// A query, a listing or a computation does not change the arm, so waiting messages stay valid.
    #[test]
    fn the_arms_state_grows_old_by_what_changes_the_arm_and_by_nothing_else() {
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
                "/arm_sim/set_integrator",
                "/arm_sim/set_parameters",
                "/arm_sim/set_params",
                "/arm_sim/set_state",
                "/arm_sim/step",
                "/pid_controller/enable",
                "/pid_controller/set_gains",
                "/pid_controller/set_period",
                "/rosapi/set_param",
            ]
        );
    }
}
