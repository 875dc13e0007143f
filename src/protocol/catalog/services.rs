//! The services: one row each.
//!
//! **Invariant:** every service that a client can call is a row here. A row that no node serves fails
//! `tests/actors/refusals/`.

use super::entry::{Field, ServiceEntry, fields, service};
use super::node::Node;
use super::parts::{GAINS, LIMITS, PARAMS, SENSORS};
use super::rosapi::Rosapi;
use super::table::{named, table};
use super::topics::{ARM_STATE, ARM_STATE_AND_FEEDBACK};

table! {
    /// A service of the runtime's own.
    pub enum Service of ServiceEntry {
        /// Integrates a particle of one degree of freedom, without the arm.
        IntegrationStep = of_arm("/arm_sim/integration_step", "pendularm_interfaces/srv/IntegrationStep")
            .request(fields![
                "string function  # m/s^2, of t in s",
                "float64 x0  # m",
                "float64 xdot0?  # m/s",
                "float64 dt  # s",
                "uint64 steps",
                "string integrator",
            ])
            .response(fields![
                "float64[] times  # s",
                "float64[] positions  # m",
                "float64[] velocities  # m/s",
            ])
            .computation(),
        /// Method and timestep of the live arm.
        SetIntegrator = changes("/arm_sim/set_integrator", "pendularm_interfaces/srv/SetIntegrator")
            .request(METHOD)
            .response(METHOD),
        /// Gravity, masses and lengths.
        SetParams = changes("/arm_sim/set_params", "pendularm_interfaces/srv/SetParams")
            .request(PARAMS)
            .response(PARAMS),
        /// Viscous friction of the joints.
        SetFriction = changes("/arm_sim/set_friction", "pendularm_interfaces/srv/SetFriction")
            .request(fields!["float64[] viscous?  # N m s/rad"])
            .response(fields!["float64[] viscous  # N m s/rad"]),
        /// Freezes and resumes simulation time.
        Pause = of_arm("/arm_sim/pause", "pendularm_interfaces/srv/Pause")
            .request(SWITCH)
            .response(SWITCH)
            .null_is_refused()
            .supersedes(ARM_STATE_AND_FEEDBACK),
        /// Returns to the starting pose at time 0.
        Reset = of_arm("/arm_sim/reset", "pendularm_interfaces/srv/Reset")
            .response(STATE)
            .supersedes(ARM_STATE_AND_FEEDBACK),
        /// Puts the arm into another state.
        SetState = changes("/arm_sim/set_state", "pendularm_interfaces/srv/SetState")
            .request(fields!["float64[] position?  # rad", "float64[] velocity?  # rad/s"])
            .response(STATE),
        /// Takes single steps of a paused arm.
        Step = changes("/arm_sim/step", "pendularm_interfaces/srv/Step")
            .request(fields!["uint64 steps", "float64[] effort?  # N m"])
            .response(fields![
                "uint64 steps",
                "float64 time  # s",
                "float64[] position  # rad",
                "float64[] velocity  # rad/s",
                "float64[] effort  # N m",
            ]),
        /// Adds an effort for some time.
        Disturb = changes("/arm_sim/disturb", "pendularm_interfaces/srv/Disturb")
            .request(DISTURBANCE)
            .response(DISTURBANCE),
        /// The names of the arm's parameters.
        ListParameters = of_arm("/arm_sim/list_parameters", "rcl_interfaces/srv/ListParameters")
            .request(fields!["string[] prefixes?", "uint64 depth?"])
            .response(fields!["rcl_interfaces/msg/ListParametersResult result"]),
        /// Their values.
        GetParameters = of_arm("/arm_sim/get_parameters", "rcl_interfaces/srv/GetParameters")
            .request(NAMES)
            .response(fields!["rcl_interfaces/msg/ParameterValue[] values"]),
        /// Their types.
        GetParameterTypes = of_arm("/arm_sim/get_parameter_types", "rcl_interfaces/srv/GetParameterTypes")
            .request(NAMES)
            .response(fields!["uint8[] types"]),
        /// Their descriptions.
        DescribeParameters = of_arm("/arm_sim/describe_parameters", "rcl_interfaces/srv/DescribeParameters")
            .request(NAMES)
            .response(fields!["rcl_interfaces/msg/ParameterDescriptor[] descriptors"]),
        /// Sets them.
        SetParameters = changes("/arm_sim/set_parameters", "rcl_interfaces/srv/SetParameters")
            .request(fields!["rcl_interfaces/msg/Parameter[] parameters"])
            .response(fields!["rcl_interfaces/msg/SetParametersResult[] results"]),
        /// The controller on or off.
        Enable = changes("/pid_controller/enable", "pendularm_interfaces/srv/Enable")
            .request(SWITCH)
            .response(SWITCH),
        /// The controller's gains.
        SetGains = changes("/pid_controller/set_gains", "pendularm_interfaces/srv/SetGains")
            .request(GAINS)
            .response(GAINS),
        /// The control period.
        SetPeriod = changes("/pid_controller/set_period", "pendularm_interfaces/srv/SetPeriod")
            .request(fields!["float64 period?  # s", "bool delay?"])
            .response(fields!["float64 period  # s", "float64 effective_period  # s", "bool delay"]),
        /// The limits of the motors, and the anti-windup.
        SetLimits = changes("/pid_controller/set_limits", "pendularm_interfaces/srv/SetLimits")
            .request(LIMITS)
            .response(LIMITS),
        /// What the controller measures, and the delay of its efforts.
        SetSensors = changes("/pid_controller/set_sensors", "pendularm_interfaces/srv/SetSensors")
            .request(SENSORS)
            .response(SENSORS),
        /// Joint positions for an end effector position.
        Solve = service("/ik/solve", "pendularm_interfaces/srv/Solve", Node::Ik)
            .request(fields!["float64 x  # m", "float64 y  # m", "float64 phi?  # rad"])
            .response(fields!["float64[] positions  # rad"]),
        /// Drives the arm to an end effector position.
        SendGoal = service("/ik_action/send_goal", "pendularm_interfaces/srv/SendGoal", Node::IkAction)
            .request(fields![
                "float64 x  # m",
                "float64 y  # m",
                "float64 phi?  # rad",
                "float64 epsilon?  # m",
                "float64 success_hold?  # s",
            ])
            .response(fields!["string goal_id"]),
        /// Preempts the active goal.
        CancelGoal = service("/ik_action/cancel_goal", "pendularm_interfaces/srv/CancelGoal", Node::IkAction)
            .request(fields!["string goal_id?"]),
        /// Starts a new timed trial.
        TrialStart = service("/ik_trial/start", "pendularm_interfaces/srv/TrialStart", Node::IkTrial)
            .request(TRIAL)
            .response(TRIAL),
        /// Replaces the trial's present target by a new one.
        TrialSkip = service("/ik_trial/skip", "pendularm_interfaces/srv/TrialSkip", Node::IkTrial),
        /// Ends the trial.
        TrialStop = service("/ik_trial/stop", "pendularm_interfaces/srv/TrialStop", Node::IkTrial),
        /// The topic with the frames for web viewers.
        RepublishTfs = service("/republish_tfs", "tf2_web_republisher/srv/RepublishTFs", Node::TfRepublisher)
            .request(fields![
                "string[] source_frames?",
                "string target_frame?",
                "float32 angular_thres?",
                "float32 trans_thres?",
                "float32 rate?  # Hz",
                "builtin_interfaces/msg/Duration timeout?  # s, ns",
            ])
            .response(fields!["string topic_name"]),
        /// Predicts the largest stable timestep.
        Stability = service("/study/stability", "pendularm_interfaces/srv/Stability", Node::Study)
            .request(fields![
                "string integrator?",
                "pendularm_interfaces/msg/Gains gains?  # SI",
                "pendularm_interfaces/msg/Params params?  # SI",
                "float64[] setpoint?  # rad",
                "float64 control_period?  # s",
                "uint64 delay?",
                "float64[] q?  # rad",
                "float64[] qd?  # rad/s",
                "float64[] viscous?  # N m s/rad",
                "pendularm_interfaces/msg/Limits limits?  # SI",
                "pendularm_interfaces/msg/Sensors sensors?  # SI",
            ])
            .response(fields![
                "float64 control_period_limit  # s",
                "float64 timestep_limit  # s",
                "float64 timestep_limit_held  # s",
                "float64 timestep_limit_continuous  # s",
                "float64[] equilibrium  # rad",
                "string equilibrium_kind",
                "float64 minimum_over_poses_held  # s",
                "float64 minimum_over_poses_continuous  # s",
                "float64 minimum_over_poses_bound  # s",
                "bool bound_is_proven",
                "bool certified",
                "float64[] worst_pose  # rad",
                "pendularm_interfaces/msg/CriticalMode critical  # SI",
                "float64 timestep_limit_motion  # s",
                "float64 motion_speed  # rad/s",
                "float64 advised_timestep  # s",
                "float64 advised_duration  # s",
            ])
            .computation(),
        /// Predicts the largest stable control period of any robot.
        HeldLimit = service("/study/held_limit", "pendularm_interfaces/srv/HeldLimit", Node::Study)
            .request(fields![
                "float64[] mass_matrix  # kg m^2",
                "float64[] kp?  # N m/rad",
                "float64[] kd?  # N m s/rad",
                "float64[] ki?  # N m/(rad s)",
                "float64[] damping?  # N m s/rad",
                "float64[] stiffness?  # N m/rad",
                "float64 period?  # s",
                "uint64 delay?",
                "string between?",
                "uint64 steps?",
            ])
            .response(fields![
                "float64 period_limit  # s",
                "pendularm_interfaces/msg/HeldMode critical  # SI",
                "float64[] effective_inertia  # kg m^2",
                "bool stable",
                "float64 growth_per_period  # 1",
                "float64 timestep_limit  # s",
                "float64 kd_factor_limit  # 1",
                "float64 armature  # kg m^2",
                "string explanation",
            ])
            .computation(),
        /// Analyses a method by its tableau.
        Method = service("/study/method", "pendularm_interfaces/srv/Method", Node::Study)
            .request(fields![
                "pendularm_interfaces/msg/Tableau tableau",
                "pendularm_interfaces/msg/Gains gains?",
                "pendularm_interfaces/msg/Params params?",
                "float64[] setpoint?  # rad",
                "float64 control_period?  # s",
            ])
            .response(fields![
                "uint64 stages",
                "uint64 evaluations",
                "uint64 order",
                "string failing_condition",
                "uint64 embedded_order",
                "string[] faults",
                "float64 measured_order  # 1",
                "float64 real_limit  # 1",
                "float64 imaginary_limit  # 1",
                "bool symplectic",
                "float64[] region_extent  # 1",
                "string[] region",
                "float64 timestep_limit_held  # s",
                "float64 timestep_limit  # s",
                "uint64 swing_evaluations",
                "string[] methods",
                "uint64[] swing_evaluations_of_methods",
            ])
            .computation(),
        /// Runs the arm offline.
        Rollout = service("/study/rollout", "pendularm_interfaces/srv/Rollout", Node::Study)
            .request(fields![
                "float64[] q0?  # rad",
                "float64[] qdot0?  # rad/s",
                "float64 duration?  # s",
                "float64 timestep?  # s",
                "string integrator?",
                "pendularm_interfaces/msg/Params params?  # SI",
                "pendularm_interfaces/msg/Gains gains?  # SI",
                "float64[] setpoint?  # rad",
                "uint64 samples?",
                "bool reference?",
                "float64 control_period?  # s",
                "uint64 delay?",
                "float64[] q?  # rad",
                "float64[] qd?  # rad/s",
                "float64[] viscous?  # N m s/rad",
                "pendularm_interfaces/msg/Limits limits?  # SI",
                "pendularm_interfaces/msg/Sensors sensors?  # SI",
                "pendularm_interfaces/msg/Tableau tableau?",
            ])
            .response(fields![
                "float64[] times  # s",
                "float64[][] positions  # rad",
                "float64[][] velocities  # rad/s",
                "float64[][] efforts  # N m",
                "float64[] energy  # J",
                "uint64 evaluations",
                "float64 wall_time  # s",
                "float64 error  # rad",
                "float64 error_uncertainty  # rad",
                "float64 sampling_error  # rad",
                "float64 sampling_error_uncertainty  # rad",
                "pendularm_interfaces/msg/Divergence divergence  # s",
            ])
            .computation(),
        /// Finds gains that are stable in every pose and settle in time.
        SuggestGains = service("/study/gains", "pendularm_interfaces/srv/SuggestGains", Node::Study)
            .request(fields![
                "float64 settling_time?  # s",
                "float64 margin?  # 1",
                "float64 timestep?  # s",
                "string integrator?",
                "pendularm_interfaces/msg/Params params?  # SI",
                "uint64 delay?",
                "float64[] viscous?  # N m s/rad",
                "pendularm_interfaces/msg/Limits limits?  # SI",
                "pendularm_interfaces/msg/Sensors sensors?  # SI",
            ])
            .response(fields![
                "float64[] kp  # N m/rad",
                "float64[] ki  # N m/(rad s)",
                "float64[] kd  # N m s/rad",
                "float64 timestep_limit  # s",
                "bool certified",
                "float64 margin  # 1",
                "float64 settled_after  # s",
            ])
            .computation(),
        /// Finds the cheapest method and timestep for an allowed error at the end effector.
        Plan = service("/study/plan", "pendularm_interfaces/srv/Plan", Node::Study)
            .request(fields![
                "float64 error  # m",
                "float64 duration?  # s",
                "bool controller?",
                "float64[] q0?  # rad",
                "float64[] qdot0?  # rad/s",
                "pendularm_interfaces/msg/Params params?  # SI",
                "pendularm_interfaces/msg/Gains gains?  # SI",
                "float64[] setpoint?  # rad",
                "float64 control_period?  # s",
                "uint64 delay?",
                "float64[] q?  # rad",
                "float64[] qd?  # rad/s",
                "float64[] viscous?  # N m s/rad",
                "pendularm_interfaces/msg/Limits limits?  # SI",
                "pendularm_interfaces/msg/Sensors sensors?  # SI",
                "pendularm_interfaces/msg/Tableau tableau?",
            ])
            .response(fields![
                "string integrator",
                "float64 timestep  # s",
                "float64 control_period  # s",
                "float64 evaluations_per_second  # 1/s",
                "float64 error  # m",
                "float64 error_uncertainty  # m",
                "string[] methods",
                "float64[] timesteps  # s",
                "uint64[] evaluations",
                "float64[] errors  # m",
                "pendularm_interfaces/msg/OwnPlan own",
            ])
            .computation(),
        /// Begins a record.
        RecorderStart if "record" =
            service("/recorder/start", "pendularm_interfaces/srv/RecorderStart", Node::Recorder)
            .request(fields!["string name?"])
            .response(fields!["string file"]),
        /// Ends the record.
        RecorderStop if "record" =
            service("/recorder/stop", "pendularm_interfaces/srv/RecorderStop", Node::Recorder)
            .response(fields!["string file", "uint64 messages", "uint64 bytes", "uint64 dropped"]),
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
    let changes = of_arm(name, type_name).supersedes(ARM_STATE);
    changes.null_is_refused()
}

const METHOD: &[Field] = fields!["string method?", "float64 timestep?  # s",];
const STATE: &[Field] = fields!["float64[] position  # rad", "float64[] velocity  # rad/s",];
const NAMES: &[Field] = fields!["string[] names"];
const SWITCH: &[Field] = fields!["bool data?"];
const DISTURBANCE: &[Field] = fields!["float64[] effort  # N m", "float64 duration  # s",];
const TRIAL: &[Field] = fields![
    "float64 duration?  # s",
    "float64 epsilon?  # m",
    "float64 success_hold?  # s",
];

named!(Service, |name: &str| Rosapi::from_name(name)
    .map(Self::Rosapi));

impl Service {
    /// Whether it is a pure computation. It has its own queue, and may answer late and out of order.
    #[must_use]
    pub const fn is_computation(self) -> bool {
        self.entry().is_computation
    }

    /// Whether `null` in an optional field means absent.
    #[must_use]
    pub const fn null_is_absent(self) -> bool {
        self.entry().null_is_absent
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
