//! THE list: every topic and service of the runtime, with its name, type, direction, owner and fields.
//!
//! The registry, the README's table and the tests are checked against it; nothing else spells `/joint_states`. Fields stand in
//! documented order, which is the order in which a positional `args` array is read.
//!
//! **Invariant:** what is listed is served, and what is served is listed: the enums make the compiler ask.

mod actions;
pub mod rosapi;
mod services;
mod topics;
pub mod types;

pub use actions::Action;
pub use rosapi::Rosapi;
pub use services::Service;
pub use topics::Topic;

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
    /// Predictions and offline runs.
    Study,
    /// The rosbridge side: connections and registry.
    Gateway,
    /// Tells what there is.
    Rosapi,
}

impl Node {
    /// All nodes.
    pub const ALL: [Self; 7] = [
        Self::ArmSim,
        Self::Ik,
        Self::IkAction,
        Self::IkTrial,
        Self::Study,
        Self::Gateway,
        Self::Rosapi,
    ];

    /// The node's name, without a slash.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ArmSim => "arm_sim",
            Self::Ik => "ik",
            Self::IkAction => "ik_action",
            Self::IkTrial => "ik_trial",
            Self::Study => "study",
            Self::Gateway => "gateway",
            Self::Rosapi => "rosapi",
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
    /// Its type as ROS writes it: `float64`, `float64[]`, `bool`, `string`, `uint64`, `pkg/msg/Type`. `float64[][]`, one
    /// array per sample, ROS does not know.
    pub kind: &'static str,
    /// Its unit, empty where it has none. `SI` where it differs from joint to joint or depends on the controller.
    pub unit: &'static str,
    /// Whether a request must have it. In messages and responses every field is there.
    pub required: bool,
}

impl Field {
    /// The members of a field that is an object in a request, in documented order; empty for every other field.
    #[must_use]
    pub fn members(&self) -> &'static [Self] {
        services::members(self.kind)
    }
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
