//! THE list: every topic and service of the runtime, with its name, type, direction, owner and fields.
//!
//! The registry, the README's table and the tests are checked against it; nothing else spells `/joint_states`. Fields stand in
//! documented order, which is the order in which a positional `args` array is read.
//!
//! **Invariant:** what is listed is served, and what is served is listed: the enums make the compiler ask.

/// A node of the runtime, by the name that introspection shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Node {
    /// The arm: dynamics, integrator and controller in one loop.
    ArmSim,
    /// Inverse kinematics.
    Ik,
    /// Drives the arm to a goal.
    IkAction,
    /// Timed trials.
    IkTrial,
    /// The rosbridge side: connections and registry.
    Gateway,
}

impl Node {
    /// All nodes.
    pub const ALL: [Self; 5] = [
        Self::ArmSim,
        Self::Ik,
        Self::IkAction,
        Self::IkTrial,
        Self::Gateway,
    ];

    /// The node's name, without a slash.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ArmSim => "arm_sim",
            Self::Ik => "ik",
            Self::IkAction => "ik_action",
            Self::IkTrial => "ik_trial",
            Self::Gateway => "gateway",
        }
    }
}

/// Who sends on a topic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Direction {
    /// The runtime publishes; clients subscribe, and may neither advertise nor publish.
    Published,
    /// The runtime subscribes; anybody may publish, without an advertisement too.
    Subscribed,
}

/// One field of a message, a request or a response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Its key.
    pub name: &'static str,
    /// Its type as ROS writes it: `float64`, `float64[]`, `bool`, `string`, `uint64`, `pkg/msg/Type`.
    pub kind: &'static str,
    /// Its unit, empty where it has none. `SI` where it differs from joint to joint or depends on the controller.
    pub unit: &'static str,
    /// Whether a request must have it. In messages and responses every field is there.
    pub required: bool,
}

const fn required(name: &'static str, kind: &'static str, unit: &'static str) -> Field {
    Field {
        name,
        kind,
        unit,
        required: true,
    }
}

const fn optional(name: &'static str, kind: &'static str, unit: &'static str) -> Field {
    Field {
        name,
        kind,
        unit,
        required: false,
    }
}

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
}

impl Topic {
    /// All topics, in the order in which they are documented.
    pub const ALL: [Self; 7] = [
        Self::JointTrajectory,
        Self::JointStates,
        Self::Clock,
        Self::Diagnostics,
        Self::IkFeedback,
        Self::IkResult,
        Self::TrialStatus,
    ];

    /// The topic's name on the wire.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::JointTrajectory => "/joint_trajectory",
            Self::JointStates => "/joint_states",
            Self::Clock => "/clock",
            Self::Diagnostics => "/diagnostics",
            Self::IkFeedback => "/ik_action/feedback",
            Self::IkResult => "/ik_action/result",
            Self::TrialStatus => "/ik_trial/status",
        }
    }

    /// The topic of that name, if it is the runtime's own.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|topic| topic.name() == name)
    }

    /// The message type, as ROS writes it.
    #[must_use]
    pub const fn type_name(self) -> &'static str {
        match self {
            Self::JointTrajectory => "trajectory_msgs/msg/JointTrajectory",
            Self::JointStates => "sensor_msgs/msg/JointState",
            Self::Clock => "rosgraph_msgs/msg/Clock",
            Self::Diagnostics => "diagnostic_msgs/msg/DiagnosticArray",
            Self::IkFeedback => "pendularm_interfaces/msg/IkFeedback",
            Self::IkResult => "pendularm_interfaces/msg/IkResult",
            Self::TrialStatus => "pendularm_interfaces/msg/TrialStatus",
        }
    }

    /// Whether the runtime sends or takes these messages.
    #[must_use]
    pub const fn direction(self) -> Direction {
        match self {
            Self::JointTrajectory => Direction::Subscribed,
            Self::JointStates
            | Self::Clock
            | Self::Diagnostics
            | Self::IkFeedback
            | Self::IkResult
            | Self::TrialStatus => Direction::Published,
        }
    }

    /// The node that publishes the topic, or that takes what is published there. Of `/diagnostics`, which the gateway adds to,
    /// the arm's.
    #[must_use]
    pub const fn owner(self) -> Node {
        match self {
            Self::JointTrajectory | Self::JointStates | Self::Clock | Self::Diagnostics => {
                Node::ArmSim
            }
            Self::IkFeedback | Self::IkResult => Node::IkAction,
            Self::TrialStatus => Node::IkTrial,
        }
    }

    /// The fields of a message.
    #[must_use]
    pub const fn fields(self) -> &'static [Field] {
        match self {
            Self::JointTrajectory => &JOINT_TRAJECTORY,
            Self::JointStates => &JOINT_STATE,
            Self::Clock => &CLOCK,
            Self::Diagnostics => &DIAGNOSTICS,
            Self::IkFeedback => &IK_FEEDBACK,
            Self::IkResult => &IK_RESULT,
            Self::TrialStatus => &TRIAL_STATUS,
        }
    }
}

/// A service of the runtime's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Service {
    /// Integrates a particle of one degree of freedom, apart from the arm.
    IntegrationStep,
    /// Method and timestep of the live arm.
    SetIntegrator,
    /// Gravity, masses and lengths.
    SetParams,
    /// Freezes and resumes simulation time.
    Pause,
    /// Back to the starting pose at time 0.
    Reset,
    /// The controller on or off.
    Enable,
    /// The controller's gains.
    SetGains,
    /// Joint positions for a tip position.
    Solve,
    /// Drives the arm to a tip position.
    SendGoal,
    /// Preempts the active goal.
    CancelGoal,
    /// Starts a timed trial afresh.
    TrialStart,
    /// Abandons the trial's present target for a new one.
    TrialSkip,
    /// Ends the trial.
    TrialStop,
}

impl Service {
    /// All services, in the order in which they are documented.
    pub const ALL: [Self; 13] = [
        Self::IntegrationStep,
        Self::SetIntegrator,
        Self::SetParams,
        Self::Pause,
        Self::Reset,
        Self::Enable,
        Self::SetGains,
        Self::Solve,
        Self::SendGoal,
        Self::CancelGoal,
        Self::TrialStart,
        Self::TrialSkip,
        Self::TrialStop,
    ];

    /// The service's name on the wire.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::IntegrationStep => "/arm_sim/integration_step",
            Self::SetIntegrator => "/arm_sim/set_integrator",
            Self::SetParams => "/arm_sim/set_params",
            Self::Pause => "/arm_sim/pause",
            Self::Reset => "/arm_sim/reset",
            Self::Enable => "/pid_controller/enable",
            Self::SetGains => "/pid_controller/set_gains",
            Self::Solve => "/ik/solve",
            Self::SendGoal => "/ik_action/send_goal",
            Self::CancelGoal => "/ik_action/cancel_goal",
            Self::TrialStart => "/ik_trial/start",
            Self::TrialSkip => "/ik_trial/skip",
            Self::TrialStop => "/ik_trial/stop",
        }
    }

    /// The service of that name, if it is the runtime's own.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|service| service.name() == name)
    }

    /// The service type, as ROS writes it.
    #[must_use]
    pub const fn type_name(self) -> &'static str {
        match self {
            Self::IntegrationStep => "pendularm_interfaces/srv/IntegrationStep",
            Self::SetIntegrator => "pendularm_interfaces/srv/SetIntegrator",
            Self::SetParams => "pendularm_interfaces/srv/SetParams",
            Self::Pause => "pendularm_interfaces/srv/Pause",
            Self::Reset => "pendularm_interfaces/srv/Reset",
            Self::Enable => "pendularm_interfaces/srv/Enable",
            Self::SetGains => "pendularm_interfaces/srv/SetGains",
            Self::Solve => "pendularm_interfaces/srv/Solve",
            Self::SendGoal => "pendularm_interfaces/srv/SendGoal",
            Self::CancelGoal => "pendularm_interfaces/srv/CancelGoal",
            Self::TrialStart => "pendularm_interfaces/srv/TrialStart",
            Self::TrialSkip => "pendularm_interfaces/srv/TrialSkip",
            Self::TrialStop => "pendularm_interfaces/srv/TrialStop",
        }
    }

    /// The node that provides the service.
    #[must_use]
    pub const fn owner(self) -> Node {
        match self {
            Self::IntegrationStep
            | Self::SetIntegrator
            | Self::SetParams
            | Self::Pause
            | Self::Reset
            | Self::Enable
            | Self::SetGains => Node::ArmSim,
            Self::Solve => Node::Ik,
            Self::SendGoal | Self::CancelGoal => Node::IkAction,
            Self::TrialStart | Self::TrialSkip | Self::TrialStop => Node::IkTrial,
        }
    }

    /// Whether it is a pure computation: answered when it is done, perhaps out of order, from a queue of its own.
    #[must_use]
    pub const fn is_computation(self) -> bool {
        matches!(self, Self::IntegrationStep)
    }

    /// Whether one bad field rejects the whole request. There, `null` in an optional field means absent.
    #[must_use]
    pub const fn all_or_nothing(self) -> bool {
        matches!(
            self,
            Self::IntegrationStep | Self::Solve | Self::SendGoal | Self::TrialStart
        )
    }

    /// The fields of a request, in the order of a positional `args` array.
    #[must_use]
    pub const fn fields(self) -> &'static [Field] {
        match self {
            Self::IntegrationStep => &INTEGRATION_STEP,
            Self::SetIntegrator => &SET_INTEGRATOR,
            Self::SetParams => &SET_PARAMS,
            Self::Pause | Self::Enable => &SWITCH,
            Self::SetGains => &SET_GAINS,
            Self::Solve => &SOLVE,
            Self::SendGoal => &SEND_GOAL,
            Self::CancelGoal => &CANCEL_GOAL,
            Self::TrialStart => &TRIAL_START,
            Self::Reset | Self::TrialSkip | Self::TrialStop => &[],
        }
    }

    /// The fields of the `values` of a response that reports success, in the order in which they are written.
    #[must_use]
    pub const fn response_fields(self) -> &'static [Field] {
        match self {
            Self::IntegrationStep => &INTEGRATION_STEP_RESPONSE,
            Self::SetIntegrator => &SET_INTEGRATOR,
            Self::SetParams => &SET_PARAMS,
            Self::Pause | Self::Enable => &SWITCH,
            Self::Reset => &RESET_RESPONSE,
            Self::SetGains => &SET_GAINS,
            Self::Solve => &SOLVE_RESPONSE,
            Self::SendGoal => &SEND_GOAL_RESPONSE,
            Self::TrialStart => &TRIAL_START,
            Self::CancelGoal | Self::TrialSkip | Self::TrialStop => &[],
        }
    }
}

const JOINT_TRAJECTORY: [Field; 3] = [
    optional("header", "std_msgs/msg/Header", ""),
    optional("joint_names", "string[]", ""),
    required(
        "points",
        "trajectory_msgs/msg/JointTrajectoryPoint[]",
        "rad, rad/s",
    ),
];
const JOINT_STATE: [Field; 5] = [
    required("header", "std_msgs/msg/Header", ""),
    required("name", "string[]", ""),
    required("position", "float64[]", "rad"),
    required("velocity", "float64[]", "rad/s"),
    required("effort", "float64[]", "N m"),
];
const CLOCK: [Field; 1] = [required("clock", "builtin_interfaces/msg/Time", "s, ns")];
const DIAGNOSTICS: [Field; 2] = [
    required("header", "std_msgs/msg/Header", ""),
    required("status", "diagnostic_msgs/msg/DiagnosticStatus[]", ""),
];
const IK_FEEDBACK: [Field; 5] = [
    required("goal_id", "string", ""),
    required("target", "pendularm_interfaces/msg/Target", "m, rad"),
    required("positions", "float64[]", "rad"),
    required("distance_remaining", "float64", "m"),
    required("elapsed", "float64", "s"),
];
const IK_RESULT: [Field; 4] = [
    required("goal_id", "string", ""),
    required("outcome", "string", ""),
    required("target", "pendularm_interfaces/msg/Target", "m, rad"),
    required("final_distance", "float64", "m"),
];
const TRIAL_STATUS: [Field; 8] = [
    required("running", "bool", ""),
    required("elapsed", "float64", "s"),
    required("duration", "float64", "s"),
    required("targets_reached", "uint64", ""),
    required("target", "pendularm_interfaces/msg/Target", "m, rad"),
    required("error", "float64", "m"),
    required("desired_positions", "float64[]", "rad"),
    required("action_status", "string", ""),
];

const INTEGRATION_STEP: [Field; 6] = [
    required("function", "string", "m/s^2 of t in s"),
    required("x0", "float64", "m"),
    optional("xdot0", "float64", "m/s"),
    required("dt", "float64", "s"),
    required("steps", "uint64", ""),
    required("integrator", "string", ""),
];
const INTEGRATION_STEP_RESPONSE: [Field; 3] = [
    required("times", "float64[]", "s"),
    required("positions", "float64[]", "m"),
    required("velocities", "float64[]", "m/s"),
];
const SET_INTEGRATOR: [Field; 2] = [
    optional("method", "string", ""),
    optional("timestep", "float64", "s"),
];
const SET_PARAMS: [Field; 3] = [
    optional("gravity", "float64", "m/s^2"),
    optional("masses", "float64[]", "kg"),
    optional("lengths", "float64[]", "m"),
];
const SWITCH: [Field; 1] = [optional("data", "bool", "")];
const RESET_RESPONSE: [Field; 2] = [
    required("position", "float64[]", "rad"),
    required("velocity", "float64[]", "rad/s"),
];
const SET_GAINS: [Field; 3] = [
    optional("kp", "float64[]", "N m/rad"),
    optional("ki", "float64[]", "N m/(rad s)"),
    optional("kd", "float64[]", "N m s/rad"),
];
const SOLVE: [Field; 3] = [
    required("x", "float64", "m"),
    required("y", "float64", "m"),
    optional("phi", "float64", "rad"),
];
const SOLVE_RESPONSE: [Field; 1] = [required("positions", "float64[]", "rad")];
const SEND_GOAL: [Field; 5] = [
    required("x", "float64", "m"),
    required("y", "float64", "m"),
    optional("phi", "float64", "rad"),
    optional("epsilon", "float64", "m"),
    optional("success_hold", "float64", "s"),
];
const SEND_GOAL_RESPONSE: [Field; 1] = [required("goal_id", "string", "")];
const CANCEL_GOAL: [Field; 1] = [optional("goal_id", "string", "")];
const TRIAL_START: [Field; 3] = [
    optional("duration", "float64", "s"),
    optional("epsilon", "float64", "m"),
    optional("success_hold", "float64", "s"),
];
