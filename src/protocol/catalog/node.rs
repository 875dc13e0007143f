//! The nodes: one row each.
//!
//! **Invariant:** a name here has no slash. Its reader adds one.

use super::table::table;

table! {
    /// A node of the runtime, by the name that introspection shows.
    pub enum Node of name {
        /// The arm: dynamics, integrator and controller in one loop.
        ArmSim = "arm_sim",
        /// Inverse kinematics.
        Ik = "ik",
        /// Drives the arm to a goal.
        IkAction = "ik_action",
        /// Moves the arm along paths.
        JointTrajectoryController = "joint_trajectory_controller",
        /// Timed trials.
        IkTrial = "ik_trial",
        /// Predictions and offline runs.
        Study = "study",
        /// Combines frames for web viewers.
        TfRepublisher = "tf2_web_republisher",
        /// The rosbridge side: connections and registry.
        Gateway = "gateway",
        /// Introspection: lists topics, services and types.
        Rosapi = "rosapi",
        /// Records runs.
        Recorder if "record" = "recorder",
    }
}
