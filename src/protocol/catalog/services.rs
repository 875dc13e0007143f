//! The services: one row each.
//!
//! **Invariant:** every service that a client can call is a row here. A row that no node serves fails
//! `tests/actors/rosapi.rs`.

use super::entry::{Field, ServiceEntry, optional, required, service};
use super::nested::{CRITICAL_TYPE, GAINS, GAINS_TYPE, PARAMS, PARAMS_TYPE};
use super::node::Node;
use super::rosapi::Rosapi;
use super::table::{fields, table};
use super::topics::{ARM_STATE, ARM_STATE_AND_FEEDBACK};
use crate::protocol::names;

table! {
    /// A service of the runtime's own.
    pub enum Service of ServiceEntry {
        /// Integrates a particle of one degree of freedom, without the arm.
        IntegrationStep = of_arm("/arm_sim/integration_step", "pendularm_interfaces/srv/IntegrationStep")
            .request(fields![
                required("function", "string", "m/s^2, of t in s"),
                required("x0", "float64", "m"),
                optional("xdot0", "float64", "m/s"),
                required("dt", "float64", "s"),
                required("steps", "uint64", ""),
                required("integrator", "string", ""),
            ])
            .response(fields![
                required("times", "float64[]", "s"),
                required("positions", "float64[]", "m"),
                required("velocities", "float64[]", "m/s"),
            ])
            .computation()
            .all_or_nothing(),
        /// Method and timestep of the live arm.
        SetIntegrator = changes("/arm_sim/set_integrator", "pendularm_interfaces/srv/SetIntegrator")
            .request(&METHOD)
            .response(&METHOD),
        /// Gravity, masses and lengths.
        SetParams = changes("/arm_sim/set_params", "pendularm_interfaces/srv/SetParams")
            .request(&PARAMS)
            .response(&PARAMS),
        /// Freezes and resumes simulation time.
        Pause = of_arm("/arm_sim/pause", "pendularm_interfaces/srv/Pause")
            .request(&SWITCH)
            .response(&SWITCH)
            .supersedes(ARM_STATE_AND_FEEDBACK),
        /// Returns to the starting pose at time 0.
        Reset = of_arm("/arm_sim/reset", "pendularm_interfaces/srv/Reset")
            .response(&STATE)
            .supersedes(ARM_STATE_AND_FEEDBACK),
        /// Puts the arm into another state.
        SetState = changes("/arm_sim/set_state", "pendularm_interfaces/srv/SetState")
            .request(fields![
                optional("position", "float64[]", "rad"),
                optional("velocity", "float64[]", "rad/s"),
            ])
            .response(&STATE),
        /// Takes single steps of a paused arm.
        Step = changes("/arm_sim/step", "pendularm_interfaces/srv/Step")
            .request(fields![
                required("steps", "uint64", ""),
                optional("effort", "float64[]", "N m"),
            ])
            .response(fields![
                required("steps", "uint64", ""),
                required("time", "float64", "s"),
                required("position", "float64[]", "rad"),
                required("velocity", "float64[]", "rad/s"),
                required("effort", "float64[]", "N m"),
            ])
            .all_or_nothing(),
        /// Adds an effort for some time.
        Disturb = changes("/arm_sim/disturb", "pendularm_interfaces/srv/Disturb")
            .request(&DISTURBANCE)
            .response(&DISTURBANCE)
            .all_or_nothing(),
        /// The names of the arm's parameters.
        ListParameters = of_arm("/arm_sim/list_parameters", "rcl_interfaces/srv/ListParameters")
            .request(fields![
                optional("prefixes", "string[]", ""),
                optional("depth", "uint64", ""),
            ])
            .response(fields![required("result", "rcl_interfaces/msg/ListParametersResult", "")])
            .all_or_nothing(),
        /// Their values.
        GetParameters = of_arm("/arm_sim/get_parameters", "rcl_interfaces/srv/GetParameters")
            .request(&NAMES)
            .response(fields![required("values", "rcl_interfaces/msg/ParameterValue[]", "")])
            .all_or_nothing(),
        /// Their types.
        GetParameterTypes = of_arm("/arm_sim/get_parameter_types", "rcl_interfaces/srv/GetParameterTypes")
            .request(&NAMES)
            .response(fields![required("types", "uint8[]", "")])
            .all_or_nothing(),
        /// Their descriptions.
        DescribeParameters = of_arm("/arm_sim/describe_parameters", "rcl_interfaces/srv/DescribeParameters")
            .request(&NAMES)
            .response(fields![required("descriptors", "rcl_interfaces/msg/ParameterDescriptor[]", "")])
            .all_or_nothing(),
        /// Sets them.
        SetParameters = changes("/arm_sim/set_parameters", "rcl_interfaces/srv/SetParameters")
            .request(fields![required("parameters", "rcl_interfaces/msg/Parameter[]", "")])
            .response(fields![required("results", "rcl_interfaces/msg/SetParametersResult[]", "")])
            .all_or_nothing(),
        /// The controller on or off.
        Enable = changes("/pid_controller/enable", "pendularm_interfaces/srv/Enable")
            .request(&SWITCH)
            .response(&SWITCH),
        /// The controller's gains.
        SetGains = changes("/pid_controller/set_gains", "pendularm_interfaces/srv/SetGains")
            .request(&GAINS)
            .response(&GAINS),
        /// The control period.
        SetPeriod = changes("/pid_controller/set_period", "pendularm_interfaces/srv/SetPeriod")
            .request(fields![
                optional("period", "float64", "s"),
                optional("delay", "bool", ""),
            ])
            .response(fields![
                required("period", "float64", "s"),
                required("effective_period", "float64", "s"),
                required("delay", "bool", ""),
            ]),
        /// Joint positions for an end effector position.
        Solve = service("/ik/solve", "pendularm_interfaces/srv/Solve", Node::Ik)
            .request(fields![
                required("x", "float64", "m"),
                required("y", "float64", "m"),
                optional("phi", "float64", "rad"),
            ])
            .response(fields![required("positions", "float64[]", "rad")])
            .all_or_nothing(),
        /// Drives the arm to an end effector position.
        SendGoal = service("/ik_action/send_goal", "pendularm_interfaces/srv/SendGoal", Node::IkAction)
            .request(fields![
                required("x", "float64", "m"),
                required("y", "float64", "m"),
                optional("phi", "float64", "rad"),
                optional("epsilon", "float64", "m"),
                optional("success_hold", "float64", "s"),
            ])
            .response(fields![required("goal_id", "string", "")])
            .all_or_nothing(),
        /// Preempts the active goal.
        CancelGoal = service("/ik_action/cancel_goal", "pendularm_interfaces/srv/CancelGoal", Node::IkAction)
            .request(fields![optional("goal_id", "string", "")])
            .all_or_nothing(),
        /// Starts a new timed trial.
        TrialStart = service("/ik_trial/start", "pendularm_interfaces/srv/TrialStart", Node::IkTrial)
            .request(&TRIAL)
            .response(&TRIAL)
            .all_or_nothing(),
        /// Replaces the trial's present target by a new one.
        TrialSkip = service("/ik_trial/skip", "pendularm_interfaces/srv/TrialSkip", Node::IkTrial),
        /// Ends the trial.
        TrialStop = service("/ik_trial/stop", "pendularm_interfaces/srv/TrialStop", Node::IkTrial),
        /// The topic with the frames for web viewers.
        RepublishTfs = service("/republish_tfs", "tf2_web_republisher/srv/RepublishTFs", Node::TfRepublisher)
            .request(fields![
                optional("source_frames", "string[]", ""),
                optional("target_frame", "string", ""),
                optional("angular_thres", "float32", ""),
                optional("trans_thres", "float32", ""),
                optional("rate", "float32", "Hz"),
                optional("timeout", "builtin_interfaces/msg/Duration", "s, ns"),
            ])
            .response(fields![required("topic_name", "string", "")])
            .all_or_nothing(),
        /// Predicts the largest stable timestep.
        Stability = service("/study/stability", "pendularm_interfaces/srv/Stability", Node::Study)
            .request(fields![
                optional("integrator", "string", ""),
                optional("gains", GAINS_TYPE, "SI"),
                optional("params", PARAMS_TYPE, "SI"),
                optional("setpoint", "float64[]", "rad"),
                optional("control_period", "float64", "s"),
            ])
            .response(fields![
                required("control_period_limit", "float64", "s"),
                required("timestep_limit", "float64", "s"),
                required("timestep_limit_held", "float64", "s"),
                required("timestep_limit_continuous", "float64", "s"),
                required("equilibrium", "float64[]", "rad"),
                required("equilibrium_kind", "string", ""),
                required("minimum_over_poses_held", "float64", "s"),
                required("minimum_over_poses_continuous", "float64", "s"),
                required("minimum_over_poses_bound", "float64", "s"),
                required("bound_is_proven", "bool", ""),
                required("certified", "bool", ""),
                required("worst_pose", "float64[]", "rad"),
                required("critical", CRITICAL_TYPE, "SI"),
                required("timestep_limit_motion", "float64", "s"),
                required("motion_speed", "float64", "rad/s"),
                required("advised_timestep", "float64", "s"),
                required("advised_duration", "float64", "s"),
            ])
            .computation()
            .all_or_nothing(),
        /// Runs the arm offline.
        Rollout = service("/study/rollout", "pendularm_interfaces/srv/Rollout", Node::Study)
            .request(fields![
                optional("q0", "float64[]", "rad"),
                optional("qdot0", "float64[]", "rad/s"),
                optional("duration", "float64", "s"),
                optional("timestep", "float64", "s"),
                optional("integrator", "string", ""),
                optional("params", PARAMS_TYPE, "SI"),
                optional("gains", GAINS_TYPE, "SI"),
                optional("setpoint", "float64[]", "rad"),
                optional("samples", "uint64", ""),
                optional("reference", "bool", ""),
                optional("control_period", "float64", "s"),
            ])
            .response(fields![
                required("times", "float64[]", "s"),
                required("positions", "float64[][]", "rad"),
                required("velocities", "float64[][]", "rad/s"),
                required("efforts", "float64[][]", "N m"),
                required("energy", "float64[]", "J"),
                required("evaluations", "uint64", ""),
                required("wall_time", "float64", "s"),
                required("error", "float64", "rad"),
                required("error_uncertainty", "float64", "rad"),
                required("sampling_error", "float64", "rad"),
                required("sampling_error_uncertainty", "float64", "rad"),
            ])
            .computation()
            .all_or_nothing(),
        /// Finds gains that are stable in every pose and settle in time.
        SuggestGains = service("/study/gains", "pendularm_interfaces/srv/SuggestGains", Node::Study)
            .request(fields![
                optional("settling_time", "float64", "s"),
                optional("margin", "float64", "1"),
                optional("timestep", "float64", "s"),
                optional("integrator", "string", ""),
                optional("params", PARAMS_TYPE, "SI"),
            ])
            .response(fields![
                required("kp", "float64[]", "N m/rad"),
                required("ki", "float64[]", "N m/(rad s)"),
                required("kd", "float64[]", "N m s/rad"),
                required("timestep_limit", "float64", "s"),
                required("certified", "bool", ""),
                required("margin", "float64", "1"),
                required("settled_after", "float64", "s"),
            ])
            .computation()
            .all_or_nothing(),
        /// Finds the cheapest method and timestep for an allowed error at the end effector.
        Plan = service("/study/plan", "pendularm_interfaces/srv/Plan", Node::Study)
            .request(fields![
                required("error", "float64", "m"),
                optional("duration", "float64", "s"),
                optional("servo", "bool", ""),
                optional("q0", "float64[]", "rad"),
                optional("qdot0", "float64[]", "rad/s"),
                optional("params", PARAMS_TYPE, "SI"),
                optional("gains", GAINS_TYPE, "SI"),
                optional("setpoint", "float64[]", "rad"),
                optional("control_period", "float64", "s"),
            ])
            .response(fields![
                required("integrator", "string", ""),
                required("timestep", "float64", "s"),
                required("control_period", "float64", "s"),
                required("evaluations_per_second", "float64", "1/s"),
                required("error", "float64", "m"),
                required("error_uncertainty", "float64", "m"),
                required("methods", "string[]", ""),
                required("timesteps", "float64[]", "s"),
                required("evaluations", "uint64[]", ""),
                required("errors", "float64[]", "m"),
            ])
            .computation()
            .all_or_nothing(),
        /// Begins a record.
        RecorderStart if "record" =
            service("/recorder/start", "pendularm_interfaces/srv/RecorderStart", Node::Recorder)
            .request(fields![optional("name", "string", "")])
            .response(fields![required("file", "string", "")])
            .all_or_nothing(),
        /// Ends the record.
        RecorderStop if "record" =
            service("/recorder/stop", "pendularm_interfaces/srv/RecorderStop", Node::Recorder)
            .response(fields![
                required("file", "string", ""),
                required("messages", "uint64", ""),
                required("bytes", "uint64", ""),
                required("dropped", "uint64", ""),
            ]),
    }
    /// A service of rosapi, under either of its prefixes.
    Rosapi(Rosapi),
}

/// A service of the arm.
const fn of_arm(name: &'static str, type_name: &'static str) -> ServiceEntry {
    service(name, type_name, Node::ArmSim)
}

/// A service that changes the arm, after which earlier states are outdated.
const fn changes(name: &'static str, type_name: &'static str) -> ServiceEntry {
    of_arm(name, type_name).supersedes(ARM_STATE)
}

const METHOD: [Field; 2] = [
    optional("method", "string", ""),
    optional("timestep", "float64", "s"),
];
const STATE: [Field; 2] = [
    required("position", "float64[]", "rad"),
    required("velocity", "float64[]", "rad/s"),
];
const NAMES: [Field; 1] = [required("names", "string[]", "")];
const SWITCH: [Field; 1] = [optional("data", "bool", "")];
const DISTURBANCE: [Field; 2] = [
    required("effort", "float64[]", "N m"),
    required("duration", "float64", "s"),
];
const TRIAL: [Field; 3] = [
    optional("duration", "float64", "s"),
    optional("epsilon", "float64", "m"),
    optional("success_hold", "float64", "s"),
];

/// A viewer's request: frames relative to another frame.
pub(super) const WISH: [Field; 5] = [
    required("source_frames", "string[]", ""),
    required("target_frame", "string", ""),
    optional("angular_thres", "float32", ""),
    optional("trans_thres", "float32", ""),
    optional("rate", "float32", "Hz"),
];

impl Service {
    /// The service's name on the wire.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.entry().name
    }

    /// The service of that name, if it is the runtime's own. The leading slash is optional.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let name = names::absolute(name);
        let own = Self::ALL.into_iter().find(|service| service.name() == name);
        own.or_else(|| Rosapi::from_name(&name).map(Self::Rosapi))
    }

    /// The service type in ROS notation.
    #[must_use]
    pub const fn type_name(self) -> &'static str {
        self.entry().type_name
    }

    /// The node that provides the service.
    #[must_use]
    pub const fn owner(self) -> Node {
        self.entry().owner
    }

    /// Whether it is a pure computation. It has its own queue, and may answer late and out of order.
    #[must_use]
    pub const fn is_computation(self) -> bool {
        self.entry().is_computation
    }

    /// Whether one bad field rejects the whole request. There, `null` in an optional field means absent.
    #[must_use]
    pub const fn all_or_nothing(self) -> bool {
        self.entry().is_all_or_nothing
    }

    /// Topics, in clients' spelling. No earlier message of them may follow the answer.
    #[must_use]
    pub const fn supersedes(self) -> &'static [&'static str] {
        self.entry().supersedes
    }

    /// The fields of a request, in the order of a positional `args` array.
    #[must_use]
    pub const fn fields(self) -> &'static [Field] {
        self.entry().request
    }

    /// The fields of the `values` of a response that reports success, in the order in which they are written.
    #[must_use]
    pub const fn response_fields(self) -> &'static [Field] {
        self.entry().response
    }
}
