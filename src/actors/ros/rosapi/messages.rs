//! The questions to `rosapi`.
//!
//! **Invariant:** a question about a parameter that does not exist gets as far as the node, which says so.

use crate::actors::arm::sim::{SetGains, SetIntegrator, SetParams};
use crate::actors::node::Ask;
use crate::protocol::catalog;
use crate::protocol::op::fields::Rejections;
use crate::protocol::ros::parameters::Parameter;
use crate::protocol::ros::rosapi::Census;

const NO_SUCH: &str = "name must be that of a parameter; get_param_names lists them";

/// A question about what there is: topics, services, nodes and types.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Look {
    /// The question.
    pub question: catalog::Rosapi,
    /// The name that it is about, if it is about one.
    pub name: String,
}

/// A question and the registrations of clients: its answer is made of these and of the catalog.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listing {
    /// The question.
    pub look: Look,
    /// Topics and services of clients.
    pub census: Census,
}

impl Ask for Look {
    type Answer = Listing;
}

/// Asks for simulation time \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GetTime;

impl Ask for GetTime {
    type Answer = f64;
}

/// The value of a parameter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GetParam<const N: usize> {
    /// The parameter; none if there is none of that name.
    pub parameter: Option<Parameter>,
    /// The value, as JSON text, that is wanted where there is none.
    pub default: String,
}

impl<const N: usize> Ask for GetParam<N> {
    type Answer = Result<ParameterValue<N>, Unknown>;
}

/// The value of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterValue<const N: usize> {
    /// A number.
    Number(f64),
    /// One per joint.
    Numbers([f64; N]),
    /// A name or a description.
    Text(String),
}

/// There is no parameter of that name.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{NO_SUCH}")]
pub struct Unknown {
    /// The value that was wanted in that case.
    pub default: String,
}

/// Sets a parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct SetParam<const N: usize> {
    /// The change, or why there can be none.
    pub change: Result<Change<N>, NotSet>,
}

impl<const N: usize> Ask for SetParam<N> {
    type Answer = Result<(), NotSet>;
}

/// A change of one parameter, as a question to the arm.
#[derive(Debug, Clone, PartialEq)]
pub enum Change<const N: usize> {
    /// Gravity, masses or lengths.
    Params(SetParams<N>),
    /// Gains.
    Gains(SetGains<N>),
    /// Method or timestep.
    Integrator(SetIntegrator),
}

/// Why a parameter was not set.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotSet {
    /// There is none of that name.
    #[error("{NO_SUCH}")]
    Unknown,
    /// It has no value of its own.
    #[error("name: robot_description is made from lengths and masses")]
    Derived,
    /// Its value is of another type.
    #[error("{name} must be a {expected} (type {number}), got type {found}")]
    WrongType {
        /// The parameter's name.
        name: &'static str,
        /// The name of its type.
        expected: &'static str,
        /// The number of its type.
        number: u8,
        /// The number of the type that came.
        found: u8,
    },
    /// The value can't be read.
    #[error("value must be JSON text")]
    NotJson,
    /// The arm does not take it.
    #[error("{0}")]
    Rejected(Rejections),
}

impl NotSet {
    /// Rejections are why a parameter was not set.
    pub(in crate::actors::ros) fn unless_empty(rejected: Rejections) -> Result<(), Self> {
        if rejected.is_empty() {
            Ok(())
        } else {
            Err(Self::Rejected(rejected))
        }
    }
}

/// Whether there is a parameter of that name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HasParam {
    /// The parameter; none if there is none of that name.
    pub parameter: Option<Parameter>,
}

impl Ask for HasParam {
    type Answer = bool;
}

/// Deletes a parameter, which can't be done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeleteParam {
    /// The parameter; none if there is none of that name.
    pub parameter: Option<Parameter>,
}

impl Ask for DeleteParam {
    type Answer = NotDeleted;
}

/// Why a parameter was not deleted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotDeleted {
    /// There is none of that name.
    #[error("{NO_SUCH}")]
    Unknown,
    /// The arm needs it.
    #[error("name: the parameters of the arm can't be deleted")]
    Fixed,
}

/// The names of all parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GetParamNames;

impl Ask for GetParamNames {
    type Answer = Vec<String>;
}
