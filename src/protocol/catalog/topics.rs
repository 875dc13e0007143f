//! The topics: one entry each.
//!
//! **Invariant:** a topic without an entry does not compile.

use super::{Direction, Field, Node, optional, required};
use crate::protocol::names;

/// A topic of the runtime's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Topic {
    /// Setpoints for the controller: the last point is held.
    JointTrajectory,
    /// The arm's state, 60 Hz.
    JointStates,
    /// Simulation time, 60 Hz.
    Clock,
    /// Health of the arm and of the gateway, 1 Hz and at every change.
    Diagnostics,
    /// Progress of the active goal.
    IkFeedback,
    /// How a goal ended.
    IkResult,
    /// The timed trial, 10 Hz and at every change.
    TrialStatus,
    /// Where the links are, 60 Hz.
    Tf,
    /// Where the hand is on its link.
    TfStatic,
    /// The arm as URDF.
    RobotDescription,
    /// The runtime's warnings.
    Rosout,
    /// The local error of the arm's steps, 10 Hz.
    ErrorEstimate,
}

impl Topic {
    /// All topics, in the order in which they are documented.
    pub const ALL: [Self; 12] = [
        Self::JointTrajectory,
        Self::JointStates,
        Self::Clock,
        Self::Diagnostics,
        Self::IkFeedback,
        Self::IkResult,
        Self::TrialStatus,
        Self::Tf,
        Self::TfStatic,
        Self::RobotDescription,
        Self::Rosout,
        Self::ErrorEstimate,
    ];

    const fn entry(self) -> &'static TopicEntry {
        match self {
            Self::JointTrajectory => &JOINT_TRAJECTORY,
            Self::JointStates => &JOINT_STATES,
            Self::Clock => &CLOCK,
            Self::Diagnostics => &DIAGNOSTICS,
            Self::IkFeedback => &IK_FEEDBACK,
            Self::IkResult => &IK_RESULT,
            Self::TrialStatus => &TRIAL_STATUS,
            Self::Tf => &TF,
            Self::TfStatic => &TF_STATIC,
            Self::RobotDescription => &ROBOT_DESCRIPTION,
            Self::Rosout => &ROSOUT,
            Self::ErrorEstimate => &ERROR_ESTIMATE,
        }
    }

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

    /// The topic of that name, if it is the runtime's own; the leading slash may be left out.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let name = names::absolute(name);
        Self::ALL.into_iter().find(|topic| topic.name() == name)
    }

    /// The message type, as ROS writes it.
    #[must_use]
    pub const fn type_name(self) -> &'static str {
        self.entry().type_name
    }

    /// Whether the runtime sends or takes these messages.
    #[must_use]
    pub const fn direction(self) -> Direction {
        self.entry().direction
    }

    /// The node that publishes the topic, or that takes what is published there. Of `/diagnostics`, to which the gateway adds,
    /// the arm's.
    #[must_use]
    pub const fn owner(self) -> Node {
        self.entry().owner
    }

    /// Whether a new subscriber gets the last message.
    #[must_use]
    pub const fn is_latched(self) -> bool {
        matches!(self, Self::TfStatic | Self::RobotDescription)
    }

    /// The fields of a message.
    #[must_use]
    pub const fn fields(self) -> &'static [Field] {
        self.entry().fields
    }
}

struct TopicEntry {
    name: &'static str,
    type_name: &'static str,
    direction: Direction,
    owner: Node,
    fields: &'static [Field],
}

const JOINT_TRAJECTORY: TopicEntry = TopicEntry {
    name: "/joint_trajectory",
    type_name: "trajectory_msgs/msg/JointTrajectory",
    direction: Direction::Subscribed,
    owner: Node::ArmSim,
    fields: &[
        optional("header", "std_msgs/msg/Header", ""),
        optional("joint_names", "string[]", ""),
        required(
            "points",
            "trajectory_msgs/msg/JointTrajectoryPoint[]",
            "rad, rad/s",
        ),
    ],
};
const JOINT_STATES: TopicEntry = TopicEntry {
    name: "/joint_states",
    type_name: "sensor_msgs/msg/JointState",
    direction: Direction::Published,
    owner: Node::ArmSim,
    fields: &[
        required("header", "std_msgs/msg/Header", ""),
        required("name", "string[]", ""),
        required("position", "float64[]", "rad"),
        required("velocity", "float64[]", "rad/s"),
        required("effort", "float64[]", "N m"),
    ],
};
const CLOCK: TopicEntry = TopicEntry {
    name: "/clock",
    type_name: "rosgraph_msgs/msg/Clock",
    direction: Direction::Published,
    owner: Node::ArmSim,
    fields: &[required("clock", "builtin_interfaces/msg/Time", "s, ns")],
};
const DIAGNOSTICS: TopicEntry = TopicEntry {
    name: "/diagnostics",
    type_name: "diagnostic_msgs/msg/DiagnosticArray",
    direction: Direction::Published,
    owner: Node::ArmSim,
    fields: &[
        required("header", "std_msgs/msg/Header", ""),
        required("status", "diagnostic_msgs/msg/DiagnosticStatus[]", ""),
    ],
};
const IK_FEEDBACK: TopicEntry = TopicEntry {
    name: "/ik_action/feedback",
    type_name: "pendularm_interfaces/msg/IkFeedback",
    direction: Direction::Published,
    owner: Node::IkAction,
    fields: &[
        required("goal_id", "string", ""),
        required("target", "pendularm_interfaces/msg/Target", "m, rad"),
        required("positions", "float64[]", "rad"),
        required("distance_remaining", "float64", "m"),
        required("elapsed", "float64", "s"),
    ],
};
const IK_RESULT: TopicEntry = TopicEntry {
    name: "/ik_action/result",
    type_name: "pendularm_interfaces/msg/IkResult",
    direction: Direction::Published,
    owner: Node::IkAction,
    fields: &[
        required("goal_id", "string", ""),
        required("outcome", "string", ""),
        required("target", "pendularm_interfaces/msg/Target", "m, rad"),
        required("final_distance", "float64", "m"),
    ],
};
const TRIAL_STATUS: TopicEntry = TopicEntry {
    name: "/ik_trial/status",
    type_name: "pendularm_interfaces/msg/TrialStatus",
    direction: Direction::Published,
    owner: Node::IkTrial,
    fields: &[
        required("running", "bool", ""),
        required("elapsed", "float64", "s"),
        required("duration", "float64", "s"),
        required("targets_reached", "uint64", ""),
        required("target", "pendularm_interfaces/msg/Target", "m, rad"),
        required("error", "float64", "m"),
        required("desired_positions", "float64[]", "rad"),
        required("action_status", "string", ""),
    ],
};
const TF: TopicEntry = TopicEntry {
    name: "/tf",
    type_name: "tf2_msgs/msg/TFMessage",
    direction: Direction::Published,
    owner: Node::ArmSim,
    fields: &TRANSFORMS,
};
const TF_STATIC: TopicEntry = TopicEntry {
    name: "/tf_static",
    type_name: "tf2_msgs/msg/TFMessage",
    direction: Direction::Published,
    owner: Node::ArmSim,
    fields: &TRANSFORMS,
};
const TRANSFORMS: [Field; 1] = [required(
    "transforms",
    "geometry_msgs/msg/TransformStamped[]",
    "",
)];
const ROBOT_DESCRIPTION: TopicEntry = TopicEntry {
    name: "/robot_description",
    type_name: "std_msgs/msg/String",
    direction: Direction::Published,
    owner: Node::ArmSim,
    fields: &[required("data", "string", "")],
};
const ROSOUT: TopicEntry = TopicEntry {
    name: "/rosout",
    type_name: "rcl_interfaces/msg/Log",
    direction: Direction::Published,
    owner: Node::Gateway,
    fields: &[
        required("stamp", "builtin_interfaces/msg/Time", "s, ns"),
        required("level", "uint8", ""),
        required("name", "string", ""),
        required("msg", "string", ""),
        required("file", "string", ""),
        required("function", "string", ""),
        required("line", "uint32", ""),
    ],
};
const ERROR_ESTIMATE: TopicEntry = TopicEntry {
    name: "/arm_sim/error_estimate",
    type_name: "pendularm_interfaces/msg/ErrorEstimate",
    direction: Direction::Published,
    owner: Node::ArmSim,
    fields: &[
        required("method", "string", ""),
        required("timestep", "float64", "s"),
        required("local_error", "float64", "rad"),
        required("error_per_second", "float64", "rad/s"),
        required("predicted_limit", "float64", "s"),
    ],
};
