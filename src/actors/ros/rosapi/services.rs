//! The requests to `rosapi`, their readers, and the writers of their answers.
//!
//! **Invariant:** a parameter's value is read by the arm's own service. A request about an unknown parameter
//! reaches the node, which refuses it.

use std::borrow::Cow;

use bytes::Bytes;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use crate::actors::arm::sim::{FieldByField as _, SetGains, SetIntegrator, SetParams, SetPeriod};
use crate::actors::node::Ask;
use crate::actors::wire::{Address, Answered, Callable, ResponseWriter, Streamed};
use crate::protocol::catalog::{self, Service};
use crate::protocol::messages::Stamp;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, Rejections};
use crate::protocol::ros::parameters::{NO_SUCH, Parameter};
use crate::protocol::ros::rosapi;
use crate::protocol::ros::rosapi::Census;
use crate::protocol::wire::json;

/// A request about topics, services, nodes or types.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Look {
    /// The service of rosapi.
    pub question: catalog::Rosapi,
    /// The name in the request, if it has one.
    pub name: String,
}

/// A request with the registrations of clients. Its answer comes from these and from the catalog.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Listing {
    /// The service of rosapi.
    pub look: Look,
    /// Topics and services of clients.
    pub census: Census,
}

impl Ask for Look {
    type Answer = Listing;
}

/// Requests simulation time \[s\].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GetTime;

impl Ask for GetTime {
    type Answer = f64;
}

/// The value of a parameter.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GetParam<const N: usize> {
    /// The parameter; `None` for an unknown name.
    pub parameter: Option<Parameter>,
    /// The default value as JSON text, for an unknown name.
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

/// The name is unknown.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{NO_SUCH}")]
pub struct Unknown {
    /// The default value in the request.
    pub default: String,
}

/// Sets a parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct SetParam<const N: usize> {
    /// The change, or why it is not possible.
    pub change: Result<ParamChange<N>, NotSet>,
}

impl<const N: usize> Ask for SetParam<N> {
    type Answer = Result<(), NotSet>;
}

/// A change of one parameter, as a request to the arm.
#[derive(Debug, Clone, PartialEq)]
pub enum ParamChange<const N: usize> {
    /// Gravity, masses or lengths.
    Params(SetParams<N>),
    /// Gains.
    Gains(SetGains<N>),
    /// Method or timestep.
    Integrator(SetIntegrator),
    /// The control period.
    Period(SetPeriod),
}

/// Why a parameter was not set.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotSet {
    /// The name is unknown.
    #[error("{NO_SUCH}")]
    Unknown,
    /// It is computed from other parameters.
    #[error("name: robot_description is read only, made from lengths and masses")]
    Derived,
    /// The value has another type.
    #[error("{name} must be a {expected} (type {number}), got type {found}")]
    WrongType {
        /// The parameter's name.
        name: &'static str,
        /// The name of its type.
        expected: &'static str,
        /// The number of its type.
        number: u8,
        /// The number of the received type.
        found: u8,
    },
    /// The value cannot be read.
    #[error("value must be JSON text")]
    NotJson,
    /// The arm refuses it.
    #[error("{0}")]
    Rejected(Rejections),
}

impl NotSet {
    /// Rejections become the reason why a parameter was not set.
    pub(in crate::actors::ros) fn unless_empty(rejected: Rejections) -> Result<(), Self> {
        if rejected.is_empty() {
            Ok(())
        } else {
            Err(Self::Rejected(rejected))
        }
    }
}

/// Whether the parameter exists.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HasParam {
    /// The parameter; `None` for an unknown name.
    pub parameter: Option<Parameter>,
}

impl Ask for HasParam {
    type Answer = bool;
}

/// Deletes a parameter, which is always refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DeleteParam {
    /// The parameter; `None` for an unknown name.
    pub parameter: Option<Parameter>,
}

impl Ask for DeleteParam {
    type Answer = NotDeleted;
}

/// Why a parameter was not deleted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotDeleted {
    /// The name is unknown.
    #[error("{NO_SUCH}")]
    Unknown,
    /// The arm needs it.
    #[error("name: the parameters of the arm cannot be deleted")]
    Fixed,
}

/// The names of all parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GetParamNames;

impl Ask for GetParamNames {
    type Answer = Vec<String>;
}

/// The value of an unknown parameter, as JSON text. Clients parse it, so it must be valid.
const NO_VALUE: &str = "\"\"";

// ---- what there is --------------------------------------------------------------------------------------------------

impl Callable for Look {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let (name, _) = read_texts(service, arguments)?;
        let name = name.into_owned();
        let Service::Rosapi(question) = service else {
            debug_assert!(false, "{} is not this node's", service.name());
            let question = catalog::Rosapi::Topics;
            return Ok(Self { question, name });
        };
        Ok(Self { question, name })
    }
}

impl Streamed for Look {
    fn begin(Listing { look, census }: Listing, to: &Address) -> Box<dyn ResponseWriter> {
        let answer = rosapi::answer(look.question, &look.name, &census);
        Box::new(Some(to.outcome(answer)))
    }
}

// ---- time -----------------------------------------------------------------------------------------------------------

impl Callable for GetTime {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Fields::read(arguments, service)?;
        Ok(Self)
    }
}

impl Answered for GetTime {
    fn write(time: f64, to: &Address) -> Bytes {
        let Stamp { sec, nanosec } = Stamp::from_seconds(time);
        // ROS 1 has other names for these members, and some clients know only those.
        let time = json!({"sec": sec, "nanosec": nanosec, "secs": sec, "nsecs": nanosec});
        to.response(&json!({"time": time}), "")
    }
}

// ---- parameters -----------------------------------------------------------------------------------------------------

/// The first two fields, both texts; empty if the service has no such field or the request omits it.
fn read_texts(
    service: Service,
    arguments: &Arguments,
) -> Result<(Cow<'_, str>, Cow<'_, str>), Rejections> {
    let mut fields = Fields::read(arguments, service)?;
    let mut text = |index: usize| {
        let field = service.fields().get(index)?;
        fields.text(field.name)
    };
    let (first, second) = (text(0), text(1));
    if fields.accepted() {
        Ok((first.unwrap_or_default(), second.unwrap_or_default()))
    } else {
        Err(fields.finish())
    }
}

fn read_parameter(
    service: Service,
    arguments: &Arguments,
) -> Result<Option<Parameter>, Rejections> {
    let (name, _) = read_texts(service, arguments)?;
    Ok(Parameter::from_name(&name))
}

impl<const N: usize> Callable for GetParam<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let (name, default) = read_texts(service, arguments)?;
        Ok(Self {
            parameter: Parameter::from_name(&name),
            default: default.into_owned(),
        })
    }
}

impl<const N: usize> Answered for GetParam<N> {
    fn write(answer: Result<ParameterValue<N>, Unknown>, to: &Address) -> Bytes {
        let values = match answer {
            Ok(value) => {
                let value = match value {
                    ParameterValue::Number(number) => Value::from(number),
                    ParameterValue::Numbers(numbers) => Value::from(numbers.to_vec()),
                    ParameterValue::Text(text) => Value::from(text),
                };
                json!({"value": value.to_string(), "successful": true, "reason": ""})
            }
            Err(why) => {
                let reason = why.to_string();
                let value = match &*why.default {
                    "" => NO_VALUE,
                    default => default,
                };
                json!({"value": value, "successful": false, "reason": reason})
            }
        };
        to.response(&values, "")
    }
}

impl<const N: usize> Callable for SetParam<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let (name, text) = read_texts(service, arguments)?;
        let change = match Parameter::from_name(&name) {
            None => Err(NotSet::Unknown),
            Some(parameter) => read_json(parameter, &text),
        };
        Ok(Self { change })
    }
}

/// A value in JSON text.
fn read_json<const N: usize>(parameter: Parameter, text: &str) -> Result<ParamChange<N>, NotSet> {
    // Numbers are read as leniently as in every frame. They are refused by the parameter's name.
    let text = json::accept_literals(text.to_owned());
    let value = RawValue::from_string(text).map_err(|_| NotSet::NotJson)?;
    read_change(parameter, &value)
}

/// Reads a value with the arm's own service.
pub(in crate::actors::ros) fn read_change<const N: usize>(
    parameter: Parameter,
    value: &RawValue,
) -> Result<ParamChange<N>, NotSet> {
    let (service, field) = parameter.field().ok_or(NotSet::Derived)?;
    let fields = Fields::single(service, field, value);
    Ok(match service {
        Service::SetParams => ParamChange::Params(SetParams::request(fields)),
        Service::SetGains => ParamChange::Gains(SetGains::request(fields)),
        Service::SetPeriod => {
            let mut change = SetPeriod::request(fields);
            change.rejected.rename(field, parameter.name());
            ParamChange::Period(change)
        }
        _ => {
            let mut change = SetIntegrator::request(fields);
            change.rejected.rename(field, parameter.name());
            ParamChange::Integrator(change)
        }
    })
}

impl<const N: usize> Answered for SetParam<N> {
    fn write(answer: Result<(), NotSet>, to: &Address) -> Bytes {
        let reason = answer
            .as_ref()
            .map_or_else(NotSet::to_string, |()| String::new());
        let values = json!({"successful": answer.is_ok(), "reason": reason});
        to.response(&values, "")
    }
}

impl Callable for HasParam {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let parameter = read_parameter(service, arguments)?;
        Ok(Self { parameter })
    }
}

impl Answered for HasParam {
    fn write(exists: bool, to: &Address) -> Bytes {
        to.response(&json!({"exists": exists}), "")
    }
}

impl Callable for DeleteParam {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let parameter = read_parameter(service, arguments)?;
        Ok(Self { parameter })
    }
}

impl Answered for DeleteParam {
    fn write(why: NotDeleted, to: &Address) -> Bytes {
        let values = json!({"successful": false, "reason": why.to_string()});
        to.response(&values, "")
    }
}

impl Callable for GetParamNames {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        read_texts(service, arguments)?;
        Ok(Self)
    }
}

impl Answered for GetParamNames {
    fn write(names: Vec<String>, to: &Address) -> Bytes {
        to.response(&json!({"names": names}), "")
    }
}
