//! The arm's parameters: `get_param` of rosapi and similar services, and `/arm_sim/get_parameters` and similar
//! services, which every node of ROS 2 has. All these services are one question, which names parameters.
//!
//! **Invariant:** a value is read as the arm's own service reads it, and has the type of its declaration. The answer
//! has one entry for each entry of the request, in the same order.

use bytes::Bytes;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::{SetFriction, SetGains, SetIntegrator, SetLimits, SetParams, SetPeriod, SetSensors};
use crate::protocol::catalog::{Rosapi, Service};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, RejectedField, Rejections};
use crate::protocol::ros::parameters::{MAX_NAMED, NO_SUCH, Parameter, ParameterType};
use crate::protocol::wire::json::{self, text};
use crate::services::{Address, Ask};

/// The services of ROS 2.
const OF_ROS_2: [Service; 5] = [
    Service::ListParameters,
    Service::GetParameters,
    Service::GetParameterTypes,
    Service::DescribeParameters,
    Service::SetParameters,
];
/// The value of a parameter that does not exist, as JSON text, because clients parse it.
const NO_VALUE: &str = "\"\"";

/// All services of the parameters.
pub fn parameter_services() -> impl Iterator<Item = Service> {
    let of_rosapi = Rosapi::ALL.into_iter();
    let of_rosapi = of_rosapi.filter(|question| question.is_about_parameters());
    of_rosapi.map(Service::Rosapi).chain(OF_ROS_2)
}

/// Asks about parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct AskParameters<const N: usize> {
    /// The named parameters, and the request about each.
    pub entries: Vec<(NamedParameter, ParameterRequest<N>)>,
}

/// A parameter by its name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NamedParameter {
    /// The name as the client spells it.
    pub name: String,
    /// The parameter, if there is one of that name.
    pub parameter: Option<Parameter>,
    /// The value, as JSON text, for a parameter that does not exist.
    pub default: String,
}

/// The value of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterValue<const N: usize> {
    /// A number.
    Number(f64),
    /// A whole number.
    Whole(u8),
    /// One per joint.
    PerJoint([f64; N]),
    /// None, of a parameter that has one per joint if it is set.
    Unset,
    /// A name or a description.
    Text(String),
}

impl<const N: usize> From<ParameterValue<N>> for Value {
    fn from(value: ParameterValue<N>) -> Self {
        match value {
            ParameterValue::Number(number) => number.into(),
            ParameterValue::Whole(number) => number.into(),
            ParameterValue::PerJoint(numbers) => numbers.to_vec().into(),
            ParameterValue::Unset => Value::Array(Vec::new()),
            ParameterValue::Text(text) => text.into(),
        }
    }
}

/// A request about one parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterRequest<const N: usize> {
    /// Describes it, without its value.
    Describe,
    /// Reads its value.
    Get,
    /// Sets it.
    Set(ParameterChange<N>),
    /// It cannot be set, for this reason.
    Refuse(NotSet),
}

/// A request to the service that has the parameter as a field, with a value for that field alone.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterChange<const N: usize> {
    /// Gravity, masses and lengths.
    Params(SetParams<N>),
    /// Friction.
    Friction(SetFriction<N>),
    /// Gains.
    Gains(SetGains<N>),
    /// Method and timestep.
    Integrator(SetIntegrator),
    /// The control period.
    Period(SetPeriod),
    /// The limits of the motors.
    Limits(SetLimits<N>),
    /// The sensors.
    Sensors(SetSensors<N>),
}

/// Why a parameter was not set.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotSet {
    /// There is none of that name.
    #[error("{NO_SUCH}")]
    Unknown,
    /// It has no value of its own.
    #[error("name: robot_description cannot be set: it is made from lengths and masses")]
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
    #[error("value must be JSON, such as 1.5 or \"rk4\" with its quotes")]
    NotJson,
    /// The arm does not take it.
    #[error("{0}")]
    Rejected(Rejections),
}

// ---- reading --------------------------------------------------------------------------------------------------------

impl NamedParameter {
    fn of(name: String) -> Self {
        Self {
            parameter: Parameter::from_name(&name),
            name,
            default: String::new(),
        }
    }
}

impl<const N: usize> Ask for AskParameters<N> {
    /// The requested values.
    type Answer = Vec<(NamedParameter, Result<Option<ParameterValue<N>>, NotSet>)>;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let entries = match service {
            Service::Rosapi(Rosapi::GetParamNames) => described(|_| true),
            Service::Rosapi(question) => vec![read_rosapi(question, service, &mut fields)],
            Service::ListParameters => {
                let prefixes = fields.texts("prefixes", MAX_NAMED).unwrap_or_default();
                // No parameter's name has a full stop, so a prefix can only be the name itself, and any depth is enough.
                let _ = fields.whole("depth");
                described(|name| prefixes.is_empty() || prefixes.iter().any(|one| one == name))
            }
            Service::SetParameters => read_changes(&mut fields)?,
            _ => {
                let names = fields.texts("names", MAX_NAMED).unwrap_or_default();
                let entry = |name| {
                    let request = match service {
                        Service::GetParameters => ParameterRequest::Get,
                        _ => ParameterRequest::Describe,
                    };
                    (NamedParameter::of(name), request)
                };
                names.into_iter().map(entry).collect()
            }
        };
        fields.accept(Self { entries })
    }

    fn write(answers: Self::Answer, to: &Address) -> Bytes {
        let as_json = |answer: Result<Option<ParameterValue<N>>, NotSet>| {
            answer.map(|value| value.map(Value::from))
        };
        let values = match to.service() {
            Service::Rosapi(Rosapi::GetParamNames) => {
                let all = answers.iter().filter_map(|(named, _)| named.parameter);
                json!({"names": all.map(Parameter::full_name).collect::<Vec<_>>()})
            }
            Service::Rosapi(question) => match answers.into_iter().next() {
                Some((named, answer)) => rosapi_values(question, &named, as_json(answer)),
                None => Value::Null,
            },
            Service::ListParameters => {
                let names: Vec<_> = answers.iter().map(|(named, _)| &named.name).collect();
                json!({"result": {"names": names, "prefixes": []}})
            }
            Service::GetParameters => {
                let values = answers.into_iter();
                let values = values
                    .map(|(named, answer)| value_message(&named, as_json(answer).ok().flatten()));
                json!({"values": values.collect::<Vec<_>>()})
            }
            Service::GetParameterTypes => {
                let types = answers
                    .iter()
                    .map(|(named, _)| type_number(named.parameter));
                json!({"types": types.collect::<Vec<_>>()})
            }
            Service::SetParameters => {
                let results = answers.iter().map(|(_, answer)| change_values(answer));
                json!({"results": results.collect::<Vec<_>>()})
            }
            _ => {
                let descriptors = answers.iter().map(|(named, _)| descriptor(named));
                json!({"descriptors": descriptors.collect::<Vec<_>>()})
            }
        };
        to.response(&values, "")
    }
}

/// Descriptions of the parameters that `is_meant` selects by name.
fn described<const N: usize>(
    is_meant: impl Fn(&str) -> bool,
) -> Vec<(NamedParameter, ParameterRequest<N>)> {
    let names = Parameter::ALL.into_iter().map(Parameter::name);
    let meant = names.filter(|name| is_meant(name));
    meant
        .map(|name| {
            (
                NamedParameter::of(name.to_owned()),
                ParameterRequest::Describe,
            )
        })
        .collect()
}

/// A question of rosapi about one parameter. Its first field is the name, and the second, if there is one, a value.
fn read_rosapi<const N: usize>(
    question: Rosapi,
    service: Service,
    fields: &mut Fields<'_>,
) -> (NamedParameter, ParameterRequest<N>) {
    let mut text = |index: usize| {
        let field = service.fields().get(index)?;
        fields.text(field.name)
    };
    let (name, value) = (text(0), text(1));
    let mut named = NamedParameter::of(name.unwrap_or_default().into_owned());
    let value = value.unwrap_or_default();
    let request = match (question, named.parameter) {
        (Rosapi::GetParam, _) => {
            named.default = value.into_owned();
            ParameterRequest::Get
        }
        (Rosapi::SetParam, None) => ParameterRequest::Refuse(NotSet::Unknown),
        (Rosapi::SetParam, Some(parameter)) => {
            // Literals are accepted as in every frame. They are refused by the parameter's name.
            let text = json::accept_literals(value.into_owned());
            let value = RawValue::from_string(text).map_err(|_| NotSet::NotJson);
            value.and_then(|value| change(parameter, &value)).into()
        }
        _ => ParameterRequest::Describe,
    };
    (named, request)
}

impl<const N: usize> From<Result<ParameterChange<N>, NotSet>> for ParameterRequest<N> {
    fn from(change: Result<ParameterChange<N>, NotSet>) -> Self {
        change.map_or_else(Self::Refuse, Self::Set)
    }
}

/// The request that sets a parameter to a value.
fn change<const N: usize>(
    parameter: Parameter,
    value: &RawValue,
) -> Result<ParameterChange<N>, NotSet> {
    let (service, field) = parameter.field().ok_or(NotSet::Derived)?;
    // A parameter has no value `null`. An array without entries stands for it.
    let is_unset = parameter == Parameter::EffortLimit && value.get() == "[]";
    let value = if is_unset { RawValue::NULL } else { value };
    let fields = &mut Fields::single(service, field, Some(value));
    Ok(match service {
        Service::SetParams => ParameterChange::Params(SetParams::from_fields(fields)),
        Service::SetFriction => ParameterChange::Friction(SetFriction::from_fields(fields)),
        Service::SetGains => ParameterChange::Gains(SetGains::from_fields(fields)),
        Service::SetLimits => ParameterChange::Limits(SetLimits::from_fields(fields)),
        Service::SetSensors => ParameterChange::Sensors(SetSensors::from_fields(fields)),
        Service::SetPeriod => ParameterChange::Period(SetPeriod::from_fields(fields)),
        _ => ParameterChange::Integrator(SetIntegrator::from_fields(fields)),
    })
}

/// The changes of `/arm_sim/set_parameters`.
fn read_changes<const N: usize>(
    fields: &mut Fields<'_>,
) -> Result<Vec<(NamedParameter, ParameterRequest<N>)>, Rejections> {
    let entries = fields.entries("parameters", MAX_NAMED).unwrap_or_default();
    let read = |(index, entry)| {
        read_given(entry).ok_or_else(|| {
            let field = format!("parameters[{index}]");
            let reason = "must be a rcl_interfaces/msg/Parameter: name and value, with its type";
            RejectedField::refused(&field, &reason).into()
        })
    };
    entries.into_iter().enumerate().map(read).collect()
}

/// Reads a `rcl_interfaces/msg/Parameter`; `None` if it is not one.
fn read_given<const N: usize>(entry: &RawValue) -> Option<(NamedParameter, ParameterRequest<N>)> {
    let [name, value] = json::members(entry.get(), &["name", "value"]).ok()?;
    let [kind, integer, double, string, integers, doubles] = json::members(
        value?.get(),
        &[
            "type",
            "integer_value",
            "double_value",
            "string_value",
            "integer_array_value",
            "double_array_value",
        ],
    )
    .ok()?;
    let named = NamedParameter::of(text(name?).unwrap_or_default().into_owned());
    let kind = u8::try_from(json::integer(kind?)?).ok()?;
    let read = |parameter: Parameter| {
        let expected = parameter.kind();
        let member = match (expected, kind) {
            (ParameterType::Double | ParameterType::Integer, 2) => integer,
            (ParameterType::Double, 3) => double,
            (ParameterType::Text, 4) => string,
            (ParameterType::DoubleArray, 7) => integers,
            (ParameterType::DoubleArray, 8) => doubles,
            (_, found) => {
                return Err(NotSet::WrongType {
                    name: parameter.name(),
                    expected: expected.name(),
                    number: expected as u8,
                    found,
                });
            }
        };
        change(parameter, member.unwrap_or(RawValue::NULL))
    };
    let change = named.parameter.ok_or(NotSet::Unknown).and_then(read);
    Some((named, change.into()))
}

// ---- writing --------------------------------------------------------------------------------------------------------

/// The values of an answer of rosapi about one parameter.
fn rosapi_values(
    question: Rosapi,
    named: &NamedParameter,
    answer: Result<Option<Value>, NotSet>,
) -> Value {
    match question {
        Rosapi::HasParam => json!({"exists": named.parameter.is_some()}),
        Rosapi::SetParam => change_values(&answer),
        Rosapi::GetParam => match answer.ok().flatten() {
            Some(value) => json!({"value": value.to_string(), "successful": true, "reason": ""}),
            None => {
                let value = match named.default.as_str() {
                    "" => NO_VALUE,
                    default => default,
                };
                json!({"value": value, "successful": false, "reason": NO_SUCH})
            }
        },
        _ => {
            let reason = match named.parameter {
                Some(_) => "name: the parameters of the arm can't be deleted",
                None => NO_SUCH,
            };
            json!({"successful": false, "reason": reason})
        }
    }
}

fn change_values<T>(answer: &Result<T, NotSet>) -> Value {
    let reason = match answer {
        Err(why) => why.to_string(),
        Ok(_) => String::new(),
    };
    json!({"successful": reason.is_empty(), "reason": reason})
}

/// `rcl_interfaces/msg/ParameterDescriptor`.
fn descriptor(named: &NamedParameter) -> Value {
    let parameter = named.parameter;
    json!({
        "name": parameter.map_or(named.name.as_str(), |one| one.name()),
        "type": type_number(parameter),
        "description": parameter.map(Parameter::description).unwrap_or_default(),
        "additional_constraints": "",
        "read_only": parameter.is_some_and(|one| one.field().is_none()),
        "dynamic_typing": false,
        "floating_point_range": [],
        "integer_range": [],
    })
}

/// The number of a parameter's type; 0, not set, for one that there is not.
fn type_number(parameter: Option<Parameter>) -> u8 {
    parameter.map_or(0, |parameter| parameter.kind() as u8)
}

/// `rcl_interfaces/msg/ParameterValue`.
fn value_message(named: &NamedParameter, value: Option<Value>) -> Value {
    let kind = value.as_ref().and(named.parameter).map(Parameter::kind);
    let value = value.unwrap_or_default();
    let of = |wanted: ParameterType, default: Value| match kind == Some(wanted) {
        true => value.clone(),
        false => default,
    };
    json!({
        "type": kind.map_or(0, |kind| kind as u8),
        "bool_value": false,
        "integer_value": of(ParameterType::Integer, json!(0)),
        "double_value": of(ParameterType::Double, json!(0.0)),
        "string_value": of(ParameterType::Text, json!("")),
        "byte_array_value": [],
        "bool_array_value": [],
        "integer_array_value": [],
        "double_array_value": of(ParameterType::DoubleArray, json!([])),
        "string_array_value": [],
    })
}
