//! The actions, one row each: goals with feedback and a result, as in rosbridge.
//!
//! **Invariant:** an action has the fields of the services and topics with the same effect. Without such services, it
//! has those of ROS 2.

use super::entry::{Field, Type, message, optional, required};
use super::node::Node;
use super::services::{Service, WISH};
use super::table::{fields, table};
use super::topics::{TRANSFORMS, Topic};
use crate::protocol::names;

table! {
    /// An action of the runtime's own.
    pub enum Action of ActionEntry {
        /// Drives the arm to an end effector position.
        MoveTo = ActionEntry {
            name: "/ik_action",
            type_name: "pendularm_interfaces/action/MoveTo",
            owner: Node::IkAction,
            goal: message("pendularm_interfaces/action/MoveTo_Goal", Service::SendGoal.fields()),
            result: message("pendularm_interfaces/action/MoveTo_Result", Topic::IkResult.fields()),
            feedback: message("pendularm_interfaces/action/MoveTo_Feedback", Topic::IkFeedback.fields()),
        },
        /// Frames for web viewers, as feedback.
        TfSubscription = ActionEntry {
            name: "/tf2_web_republisher",
            type_name: "tf2_web_republisher_interfaces/action/TFSubscription",
            owner: Node::TfRepublisher,
            goal: message("tf2_web_republisher_interfaces/action/TFSubscription_Goal", &WISH),
            result: message("tf2_web_republisher_interfaces/action/TFSubscription_Result", &[]),
            feedback: message("tf2_web_republisher_interfaces/action/TFSubscription_Feedback", &TRANSFORMS),
        },
        /// Moves the arm along a path.
        FollowJointTrajectory = ActionEntry {
            name: "/joint_trajectory_controller/follow_joint_trajectory",
            type_name: "control_msgs/action/FollowJointTrajectory",
            owner: Node::JointTrajectoryController,
            goal: message("control_msgs/action/FollowJointTrajectory_Goal", fields![
                required("trajectory", "trajectory_msgs/msg/JointTrajectory", ""),
                optional("multi_dof_trajectory", "trajectory_msgs/msg/MultiDOFJointTrajectory", ""),
                optional("path_tolerance", "control_msgs/msg/JointTolerance[]", ""),
                optional("component_path_tolerance", "control_msgs/msg/JointComponentTolerance[]", ""),
                optional("goal_tolerance", "control_msgs/msg/JointTolerance[]", ""),
                optional("component_goal_tolerance", "control_msgs/msg/JointComponentTolerance[]", ""),
                optional("goal_time_tolerance", "builtin_interfaces/msg/Duration", "s, ns"),
            ]),
            result: message("control_msgs/action/FollowJointTrajectory_Result", fields![
                required("error_code", "int32", ""),
                required("error_string", "string", ""),
            ]),
            feedback: message("control_msgs/action/FollowJointTrajectory_Feedback", fields![
                required("header", "std_msgs/msg/Header", ""),
                required("joint_names", "string[]", ""),
                required("desired", "trajectory_msgs/msg/JointTrajectoryPoint", "rad, rad/s"),
                required("actual", "trajectory_msgs/msg/JointTrajectoryPoint", "rad, rad/s"),
                required("error", "trajectory_msgs/msg/JointTrajectoryPoint", "rad, rad/s"),
                // These are in ROS 2's definition. JSON omits them, because compas_fab rejects unknown fields.
                optional("multi_dof_joint_names", "string[]", ""),
                optional("multi_dof_desired", "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint", ""),
                optional("multi_dof_actual", "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint", ""),
                optional("multi_dof_error", "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint", ""),
            ]),
        },
    }
}

pub(super) struct ActionEntry {
    name: &'static str,
    type_name: &'static str,
    owner: Node,
    goal: Type,
    result: Type,
    feedback: Type,
}

impl Action {
    /// The action's name on the wire.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.entry().name
    }

    /// The action of that name; the leading slash may be left out.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let name = names::absolute(name);
        Self::ALL.into_iter().find(|action| action.name() == name)
    }

    /// The action's type, as ROS writes it.
    #[must_use]
    pub const fn type_name(self) -> &'static str {
        self.entry().type_name
    }

    /// The node that serves the action.
    #[must_use]
    pub const fn owner(self) -> Node {
        self.entry().owner
    }

    /// The types of a goal, a result and feedback.
    #[must_use]
    pub const fn parts(self) -> [Type; 3] {
        let entry = self.entry();
        [entry.goal, entry.result, entry.feedback]
    }

    /// The fields of a goal.
    #[must_use]
    pub const fn goal_fields(self) -> &'static [Field] {
        self.entry().goal.fields
    }

    /// The fields of a result.
    #[must_use]
    pub const fn result_fields(self) -> &'static [Field] {
        self.entry().result.fields
    }

    /// The fields of feedback.
    #[must_use]
    pub const fn feedback_fields(self) -> &'static [Field] {
        self.entry().feedback.fields
    }
}
