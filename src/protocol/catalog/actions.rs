//! The actions, one row each: goals with feedback and a result, as in rosbridge.
//!
//! **Invariant:** an action has the fields of the services and topics with the same effect. Without such services, it
//! has those of ROS 2.

use super::entry::{Field, Type, fields, message};
use super::node::Node;
use super::parts::{FRAME_GOAL, TRANSFORMS};
use super::services::Service;
use super::table::{named, table};
use super::topics::Topic;

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
            goal: message("tf2_web_republisher_interfaces/action/TFSubscription_Goal", FRAME_GOAL),
            result: message("tf2_web_republisher_interfaces/action/TFSubscription_Result", &[]),
            feedback: message("tf2_web_republisher_interfaces/action/TFSubscription_Feedback", TRANSFORMS),
        },
        /// Moves the arm along a path.
        FollowJointTrajectory = ActionEntry {
            name: "/joint_trajectory_controller/follow_joint_trajectory",
            type_name: "control_msgs/action/FollowJointTrajectory",
            owner: Node::JointTrajectoryController,
            goal: message("control_msgs/action/FollowJointTrajectory_Goal", fields![
                "trajectory_msgs/msg/JointTrajectory trajectory",
                "trajectory_msgs/msg/MultiDOFJointTrajectory multi_dof_trajectory?",
                "control_msgs/msg/JointTolerance[] path_tolerance?",
                "control_msgs/msg/JointComponentTolerance[] component_path_tolerance?",
                "control_msgs/msg/JointTolerance[] goal_tolerance?",
                "control_msgs/msg/JointComponentTolerance[] component_goal_tolerance?",
                "builtin_interfaces/msg/Duration goal_time_tolerance?  # s, ns",
            ]),
            result: message("control_msgs/action/FollowJointTrajectory_Result", fields![
                "int32 error_code",
                "string error_string",
            ])
                .with_constants("int32 SUCCESSFUL=0 INVALID_GOAL=-1 INVALID_JOINTS=-2 OLD_HEADER_TIMESTAMP=-3 PATH_TOLERANCE_VIOLATED=-4 GOAL_TOLERANCE_VIOLATED=-5"),
            feedback: message("control_msgs/action/FollowJointTrajectory_Feedback", fields![
                "std_msgs/msg/Header header",
                "string[] joint_names",
                "trajectory_msgs/msg/JointTrajectoryPoint desired  # rad, rad/s",
                "trajectory_msgs/msg/JointTrajectoryPoint actual  # rad, rad/s",
                "trajectory_msgs/msg/JointTrajectoryPoint error  # rad, rad/s",
                // These are in ROS 2's definition. JSON omits them, because compas_fab rejects unknown fields.
                "string[] multi_dof_joint_names?",
                "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint multi_dof_desired?",
                "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint multi_dof_actual?",
                "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint multi_dof_error?",
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

named!(Action, |_: &str| None);

impl Action {
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
}
