//! The services: one entry each.
//!
//! **Invariant:** a service without an entry does not compile.

use super::rosapi::Rosapi;
use super::{Field, Node, optional, required};
use crate::protocol::names;

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
    /// Takes single steps of a paused arm.
    Step,
    /// Pushes the arm for a while.
    Disturb,
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
    /// Predicts the largest stable timestep.
    Stability,
    /// Runs the arm offline.
    Rollout,
    /// A question of rosapi, under either of its prefixes.
    Rosapi(Rosapi),
}

impl Service {
    /// The arm's own services, in the order in which they are documented; the others are [`Rosapi::ALL`].
    pub const ALL: [Self; 17] = [
        Self::IntegrationStep,
        Self::SetIntegrator,
        Self::SetParams,
        Self::Pause,
        Self::Reset,
        Self::Step,
        Self::Disturb,
        Self::Enable,
        Self::SetGains,
        Self::Solve,
        Self::SendGoal,
        Self::CancelGoal,
        Self::TrialStart,
        Self::TrialSkip,
        Self::TrialStop,
        Self::Stability,
        Self::Rollout,
    ];

    const fn entry(self) -> &'static ServiceEntry {
        match self {
            Self::IntegrationStep => &INTEGRATION_STEP,
            Self::SetIntegrator => &SET_INTEGRATOR,
            Self::SetParams => &SET_PARAMS,
            Self::Pause => &PAUSE,
            Self::Reset => &RESET,
            Self::Step => &STEP,
            Self::Disturb => &DISTURB,
            Self::Enable => &ENABLE,
            Self::SetGains => &SET_GAINS,
            Self::Solve => &SOLVE,
            Self::SendGoal => &SEND_GOAL,
            Self::CancelGoal => &CANCEL_GOAL,
            Self::TrialStart => &TRIAL_START,
            Self::TrialSkip => &TRIAL_SKIP,
            Self::TrialStop => &TRIAL_STOP,
            Self::Stability => &STABILITY,
            Self::Rollout => &ROLLOUT,
            Self::Rosapi(question) => question.entry(),
        }
    }

    /// The service's name on the wire.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.entry().name
    }

    /// The service of that name, if it is the runtime's own; the leading slash may be left out.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let name = names::absolute(name);
        let own = Self::ALL.into_iter().find(|service| service.name() == name);
        own.or_else(|| Rosapi::from_name(&name).map(Self::Rosapi))
    }

    /// The service type, as ROS writes it.
    #[must_use]
    pub const fn type_name(self) -> &'static str {
        self.entry().type_name
    }

    /// The node that provides the service.
    #[must_use]
    pub const fn owner(self) -> Node {
        self.entry().owner
    }

    /// Whether it is a pure computation: answered when it is done, perhaps out of order, from a queue of its own.
    #[must_use]
    pub const fn is_computation(self) -> bool {
        matches!(
            self,
            Self::IntegrationStep | Self::Stability | Self::Rollout
        )
    }

    /// Whether one bad field rejects the whole request. There, `null` in an optional field means absent.
    #[must_use]
    pub const fn all_or_nothing(self) -> bool {
        matches!(
            self,
            Self::IntegrationStep
                | Self::Step
                | Self::Disturb
                | Self::Solve
                | Self::SendGoal
                | Self::TrialStart
                | Self::Stability
                | Self::Rollout
        )
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

pub(super) struct ServiceEntry {
    pub(super) name: &'static str,
    pub(super) type_name: &'static str,
    pub(super) owner: Node,
    pub(super) request: &'static [Field],
    pub(super) response: &'static [Field],
}

const INTEGRATION_STEP: ServiceEntry = ServiceEntry {
    name: "/arm_sim/integration_step",
    type_name: "pendularm_interfaces/srv/IntegrationStep",
    owner: Node::ArmSim,
    request: &[
        required("function", "string", "m/s^2, of t in s"),
        required("x0", "float64", "m"),
        optional("xdot0", "float64", "m/s"),
        required("dt", "float64", "s"),
        required("steps", "uint64", ""),
        required("integrator", "string", ""),
    ],
    response: &[
        required("times", "float64[]", "s"),
        required("positions", "float64[]", "m"),
        required("velocities", "float64[]", "m/s"),
    ],
};
const SET_INTEGRATOR: ServiceEntry = ServiceEntry {
    name: "/arm_sim/set_integrator",
    type_name: "pendularm_interfaces/srv/SetIntegrator",
    owner: Node::ArmSim,
    request: &METHOD,
    response: &METHOD,
};
const METHOD: [Field; 2] = [
    optional("method", "string", ""),
    optional("timestep", "float64", "s"),
];
const SET_PARAMS: ServiceEntry = ServiceEntry {
    name: "/arm_sim/set_params",
    type_name: "pendularm_interfaces/srv/SetParams",
    owner: Node::ArmSim,
    request: &PARAMS,
    response: &PARAMS,
};
const PARAMS: [Field; 3] = [
    optional("gravity", "float64", "m/s^2"),
    optional("masses", "float64[]", "kg"),
    optional("lengths", "float64[]", "m"),
];
const PAUSE: ServiceEntry = ServiceEntry {
    name: "/arm_sim/pause",
    type_name: "pendularm_interfaces/srv/Pause",
    owner: Node::ArmSim,
    request: &SWITCH,
    response: &SWITCH,
};
const ENABLE: ServiceEntry = ServiceEntry {
    name: "/pid_controller/enable",
    type_name: "pendularm_interfaces/srv/Enable",
    owner: Node::ArmSim,
    request: &SWITCH,
    response: &SWITCH,
};
const SWITCH: [Field; 1] = [optional("data", "bool", "")];
const RESET: ServiceEntry = ServiceEntry {
    name: "/arm_sim/reset",
    type_name: "pendularm_interfaces/srv/Reset",
    owner: Node::ArmSim,
    request: &[],
    response: &[
        required("position", "float64[]", "rad"),
        required("velocity", "float64[]", "rad/s"),
    ],
};
const STEP: ServiceEntry = ServiceEntry {
    name: "/arm_sim/step",
    type_name: "pendularm_interfaces/srv/Step",
    owner: Node::ArmSim,
    request: &[required("steps", "uint64", "")],
    response: &[
        required("steps", "uint64", ""),
        required("time", "float64", "s"),
    ],
};
const DISTURB: ServiceEntry = ServiceEntry {
    name: "/arm_sim/disturb",
    type_name: "pendularm_interfaces/srv/Disturb",
    owner: Node::ArmSim,
    request: &DISTURBANCE,
    response: &DISTURBANCE,
};
const DISTURBANCE: [Field; 2] = [
    required("effort", "float64[]", "N m"),
    required("duration", "float64", "s"),
];
const SET_GAINS: ServiceEntry = ServiceEntry {
    name: "/pid_controller/set_gains",
    type_name: "pendularm_interfaces/srv/SetGains",
    owner: Node::ArmSim,
    request: &GAINS,
    response: &GAINS,
};
const GAINS: [Field; 3] = [
    optional("kp", "float64[]", "N m/rad"),
    optional("ki", "float64[]", "N m/(rad s)"),
    optional("kd", "float64[]", "N m s/rad"),
];
const SOLVE: ServiceEntry = ServiceEntry {
    name: "/ik/solve",
    type_name: "pendularm_interfaces/srv/Solve",
    owner: Node::Ik,
    request: &[
        required("x", "float64", "m"),
        required("y", "float64", "m"),
        optional("phi", "float64", "rad"),
    ],
    response: &[required("positions", "float64[]", "rad")],
};
const SEND_GOAL: ServiceEntry = ServiceEntry {
    name: "/ik_action/send_goal",
    type_name: "pendularm_interfaces/srv/SendGoal",
    owner: Node::IkAction,
    request: &[
        required("x", "float64", "m"),
        required("y", "float64", "m"),
        optional("phi", "float64", "rad"),
        optional("epsilon", "float64", "m"),
        optional("success_hold", "float64", "s"),
    ],
    response: &[required("goal_id", "string", "")],
};
const CANCEL_GOAL: ServiceEntry = ServiceEntry {
    name: "/ik_action/cancel_goal",
    type_name: "pendularm_interfaces/srv/CancelGoal",
    owner: Node::IkAction,
    request: &[optional("goal_id", "string", "")],
    response: &[],
};
const TRIAL_START: ServiceEntry = ServiceEntry {
    name: "/ik_trial/start",
    type_name: "pendularm_interfaces/srv/TrialStart",
    owner: Node::IkTrial,
    request: &TRIAL,
    response: &TRIAL,
};
const TRIAL: [Field; 3] = [
    optional("duration", "float64", "s"),
    optional("epsilon", "float64", "m"),
    optional("success_hold", "float64", "s"),
];
const TRIAL_SKIP: ServiceEntry = ServiceEntry {
    name: "/ik_trial/skip",
    type_name: "pendularm_interfaces/srv/TrialSkip",
    owner: Node::IkTrial,
    request: &[],
    response: &[],
};
const TRIAL_STOP: ServiceEntry = ServiceEntry {
    name: "/ik_trial/stop",
    type_name: "pendularm_interfaces/srv/TrialStop",
    owner: Node::IkTrial,
    request: &[],
    response: &[],
};
/// The type of a request's `gains`; its members are the fields of `/pid_controller/set_gains`.
const GAINS_TYPE: &str = "pendularm_interfaces/msg/Gains";
/// The type of a request's `params`; its members are the fields of `/arm_sim/set_params`.
const PARAMS_TYPE: &str = "pendularm_interfaces/msg/Params";

/// The members of a type of objects in requests.
pub(super) fn members(kind: &str) -> &'static [Field] {
    match kind {
        GAINS_TYPE => &GAINS,
        PARAMS_TYPE => &PARAMS,
        _ => &[],
    }
}

const STABILITY: ServiceEntry = ServiceEntry {
    name: "/study/stability",
    type_name: "pendularm_interfaces/srv/Stability",
    owner: Node::Study,
    request: &[
        optional("integrator", "string", ""),
        optional("gains", GAINS_TYPE, "SI"),
        optional("params", PARAMS_TYPE, "SI"),
        optional("setpoint", "float64[]", "rad"),
    ],
    response: &[
        required("timestep_limit_held", "float64", "s"),
        required("timestep_limit_continuous", "float64", "s"),
        required("minimum_over_poses_held", "float64", "s"),
        required("minimum_over_poses_continuous", "float64", "s"),
        required("advised_timestep", "float64", "s"),
    ],
};
const ROLLOUT: ServiceEntry = ServiceEntry {
    name: "/study/rollout",
    type_name: "pendularm_interfaces/srv/Rollout",
    owner: Node::Study,
    request: &[
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
    ],
    response: &[
        required("times", "float64[]", "s"),
        required("positions", "float64[][]", "rad"),
        required("velocities", "float64[][]", "rad/s"),
        required("efforts", "float64[][]", "N m"),
        required("energy", "float64[]", "J"),
        required("evaluations", "uint64", ""),
        required("wall_time", "float64", "s"),
        required("error", "float64", "rad"),
    ],
};
