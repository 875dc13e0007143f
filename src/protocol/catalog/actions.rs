//! The actions: goals with progress and an end, as rosbridge has them beside topics and services.
//!
//! **Invariant:** an action has the fields of the services and topics that do the same: there is one goal machine.

use super::{Field, Node, Service, Topic};
use crate::protocol::names;

/// An action of the runtime's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Action {
    /// Drives the arm to a tip position.
    MoveTo,
}

impl Action {
    /// All actions.
    pub const ALL: [Self; 1] = [Self::MoveTo];

    /// The action's name on the wire.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::MoveTo => "/ik_action",
        }
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
        match self {
            Self::MoveTo => "pendularm_interfaces/action/MoveTo",
        }
    }

    /// The node that pursues the goals.
    #[must_use]
    pub const fn owner(self) -> Node {
        match self {
            Self::MoveTo => Node::IkAction,
        }
    }

    /// The fields of a goal.
    #[must_use]
    pub const fn goal_fields(self) -> &'static [Field] {
        match self {
            Self::MoveTo => Service::SendGoal.fields(),
        }
    }

    /// The fields of a result.
    #[must_use]
    pub const fn result_fields(self) -> &'static [Field] {
        match self {
            Self::MoveTo => Topic::IkResult.fields(),
        }
    }

    /// The fields of feedback.
    #[must_use]
    pub const fn feedback_fields(self) -> &'static [Field] {
        match self {
            Self::MoveTo => Topic::IkFeedback.fields(),
        }
    }
}
