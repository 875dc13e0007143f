//! Questions about parameters in JSON, as rosapi and as ROS 2 ask them.
//!
//! **Invariant:** a value is read as the arm's own service reads it, and has the type of its declaration. A question
//! about a parameter that does not exist gets as far as the node.

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::{
    AskParameters, NamedParameter, NotSet, ParameterAnswer, ParameterChange, ParameterRequest,
    ParameterValue, Parameters,
};
use crate::actors::arm::sim::{FieldByField as _, SetGains, SetIntegrator, SetParams, SetPeriod};
use crate::actors::wire::{Address, Answered, Callable, Nodes};
use crate::protocol::catalog::{Rosapi, Service};
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, RejectedField, Rejections};
use crate::protocol::ros::parameters::{MAX_NAMED, NO_SUCH, Parameter, ParameterType};
use crate::protocol::wire::json::{self, text};

/// The services of ROS 2.
const OF_ROS_2: [Service; 5] = [
    Service::ListParameters,
    Service::GetParameters,
    Service::GetParameterTypes,
    Service::DescribeParameters,
    Service::SetParameters,
];
/// The value of a parameter that does not exist, as JSON text: clients parse it, so it has to be some.
const NO_VALUE: &str = "\"\"";

impl<const N: usize> Parameters<N> {
    /// Enters the services of parameters into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        let of_rosapi = Rosapi::ALL.into_iter();
        let of_rosapi = of_rosapi.filter(|question| question.is_about_parameters());
        for service in of_rosapi.map(Service::Rosapi).chain(OF_ROS_2) {
            nodes.serve::<AskParameters<N>>(service, address.clone());
        }
    }
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

/// The parameters of a question, and what each is named for.
type Entries<const N: usize> = Vec<(NamedParameter, ParameterRequest<N>)>;

impl<const N: usize> Callable for AskParameters<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let entries = match service {
            Service::Rosapi(Rosapi::GetParamNames) => described(|_| true),
            Service::Rosapi(question) => vec![read_rosapi(question, service, &mut fields)],
            Service::ListParameters => {
                let prefixes = fields.texts("prefixes", MAX_NAMED).unwrap_or_default();
                // No name of ours has a full stop, so only the name itself can be meant.
                described(|name| prefixes.is_empty() || prefixes.iter().any(|one| one == name))
            }
            Service::SetParameters => read_changes(&mut fields)?,
            _ => {
                let names = fields.texts("names", MAX_NAMED).unwrap_or_default();
                let request = match service {
                    Service::GetParameters => ParameterRequest::Read,
                    _ => ParameterRequest::Describe,
                };
                let entry = |name| (NamedParameter::of(name), request.clone());
                names.into_iter().map(entry).collect()
            }
        };
        if fields.accepted() {
            Ok(Self { entries })
        } else {
            Err(fields.finish())
        }
    }
}

/// The parameters whose names are meant.
fn described<const N: usize>(is_meant: impl Fn(&str) -> bool) -> Entries<N> {
    let meant = Parameter::ALL
        .into_iter()
        .filter(|one| is_meant(one.name()));
    let entry = |one: Parameter| {
        let named = NamedParameter::of(one.name().to_owned());
        (named, ParameterRequest::Describe)
    };
    meant.map(entry).collect()
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
            ParameterRequest::Read
        }
        (Rosapi::SetParam, None) => ParameterRequest::Change(Err(NotSet::Unknown)),
        (Rosapi::SetParam, Some(parameter)) => {
            ParameterRequest::Change(read_json(parameter, &value))
        }
        _ => ParameterRequest::Describe,
    };
    (named, request)
}

/// A value in JSON text.
fn read_json<const N: usize>(
    parameter: Parameter,
    text: &str,
) -> Result<ParameterChange<N>, NotSet> {
    // As lenient about numbers as every frame: they are refused by the parameter's name.
    let text = json::accept_literals(text.to_owned());
    let value = RawValue::from_string(text).map_err(|_| NotSet::NotJson)?;
    read_change(parameter, &value)
}

/// A value, as the arm's own service would read it.
fn read_change<const N: usize>(
    parameter: Parameter,
    value: &RawValue,
) -> Result<ParameterChange<N>, NotSet> {
    let (service, field) = parameter.field().ok_or(NotSet::Derived)?;
    let fields = Fields::single(service, field, value);
    Ok(match service {
        Service::SetParams => ParameterChange::Params(SetParams::request(fields)),
        Service::SetGains => ParameterChange::Gains(SetGains::request(fields)),
        Service::SetPeriod => {
            let mut change = SetPeriod::request(fields);
            change.rejected.rename(field, parameter.name());
            ParameterChange::Period(change)
        }
        _ => {
            let mut change = SetIntegrator::request(fields);
            change.rejected.rename(field, parameter.name());
            ParameterChange::Integrator(change)
        }
    })
}

/// The changes of `/arm_sim/set_parameters`.
fn read_changes<const N: usize>(fields: &mut Fields<'_>) -> Result<Entries<N>, Rejections> {
    let entries = fields.entries("parameters", MAX_NAMED).unwrap_or_default();
    let mut changes = Vec::with_capacity(entries.len());
    for (index, entry) in entries.into_iter().enumerate() {
        let Some(given) = GivenParameter::read(entry) else {
            let field = format!("parameters[{index}]");
            let reason = "must be a rcl_interfaces/msg/Parameter: name and value, with its type";
            return Err(RejectedField::refused(&field, &reason).into());
        };
        let name = text(given.name).unwrap_or_default().into_owned();
        changes.push((
            NamedParameter::of(name),
            ParameterRequest::Change(given.change()),
        ));
    }
    Ok(changes)
}

/// The parts of `rcl_interfaces/msg/Parameter` that the parameters here use.
struct GivenParameter<'a> {
    name: &'a RawValue,
    kind: u8,
    integer: Option<&'a RawValue>,
    double: Option<&'a RawValue>,
    text: Option<&'a RawValue>,
    integers: Option<&'a RawValue>,
    doubles: Option<&'a RawValue>,
}

impl<'a> GivenParameter<'a> {
    /// `None` if it is not a parameter.
    fn read(entry: &'a RawValue) -> Option<Self> {
        let [name, value] = json::members(entry.get(), &["name", "value"]).ok()?;
        let [kind, integer, double, text, integers, doubles] = json::members(
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
        Some(Self {
            name: name?,
            kind: u8::try_from(json::integer(kind?)?).ok()?,
            integer,
            double,
            text,
            integers,
            doubles,
        })
    }

    fn change<const N: usize>(&self) -> Result<ParameterChange<N>, NotSet> {
        let name = text(self.name).ok_or(NotSet::Unknown)?;
        let parameter = Parameter::from_name(&name).ok_or(NotSet::Unknown)?;
        let expected = parameter.kind();
        let member = match (expected, self.kind) {
            (ParameterType::Double, 2) => self.integer,
            (ParameterType::Double, 3) => self.double,
            (ParameterType::Text, 4) => self.text,
            (ParameterType::DoubleArray, 7) => self.integers,
            (ParameterType::DoubleArray, 8) => self.doubles,
            (_, found) => {
                return Err(NotSet::WrongType {
                    name: parameter.name(),
                    expected: expected.name(),
                    number: expected as u8,
                    found,
                });
            }
        };
        read_change(parameter, member.unwrap_or(RawValue::NULL))
    }
}

// ---- writing --------------------------------------------------------------------------------------------------------

impl<const N: usize> Answered for AskParameters<N> {
    fn write(answers: Vec<(NamedParameter, ParameterAnswer<N>)>, to: &Address) -> Bytes {
        let values = match to.service() {
            Service::Rosapi(Rosapi::GetParamNames) => {
                let all = answers.iter().filter_map(|(named, _)| named.parameter);
                json!({"names": all.map(Parameter::full_name).collect::<Vec<_>>()})
            }
            Service::Rosapi(question) => match answers.into_iter().next() {
                Some((named, answer)) => rosapi_values(question, &named, answer),
                None => Value::Null,
            },
            Service::ListParameters => {
                let names: Vec<_> = answers.iter().map(|(named, _)| &named.name).collect();
                json!({"result": {"names": names, "prefixes": []}})
            }
            Service::GetParameters => {
                let values = answers
                    .into_iter()
                    .map(|(_, answer)| ValueMessage::from(answer));
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

/// The values of an answer of rosapi about one parameter.
fn rosapi_values<const N: usize>(
    question: Rosapi,
    named: &NamedParameter,
    answer: ParameterAnswer<N>,
) -> Value {
    match (question, answer) {
        (Rosapi::HasParam, _) => json!({"exists": named.parameter.is_some()}),
        (_, ParameterAnswer::Value(Some(value))) => {
            let value = match value {
                ParameterValue::Number(number) => Value::from(number),
                ParameterValue::Numbers(numbers) => Value::from(numbers.to_vec()),
                ParameterValue::Text(text) => Value::from(text),
            };
            json!({"value": value.to_string(), "successful": true, "reason": ""})
        }
        (_, ParameterAnswer::Value(None)) => {
            let value = match named.default.as_str() {
                "" => NO_VALUE,
                default => default,
            };
            json!({"value": value, "successful": false, "reason": NO_SUCH})
        }
        (_, answer @ ParameterAnswer::Changed(_)) => change_values(&answer),
        (_, ParameterAnswer::Described) => {
            let reason = match named.parameter {
                Some(_) => "name: the parameters of the arm can't be deleted",
                None => NO_SUCH,
            };
            json!({"successful": false, "reason": reason})
        }
    }
}

fn change_values<const N: usize>(answer: &ParameterAnswer<N>) -> Value {
    let reason = match answer {
        ParameterAnswer::Changed(Err(why)) => why.to_string(),
        _ => String::new(),
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
#[derive(Debug, Default, Serialize)]
struct ValueMessage {
    r#type: u8,
    bool_value: bool,
    integer_value: i64,
    double_value: f64,
    string_value: String,
    byte_array_value: [u8; 0],
    bool_array_value: [bool; 0],
    integer_array_value: [i64; 0],
    double_array_value: Vec<f64>,
    string_array_value: [String; 0],
}

impl<const N: usize> From<ParameterAnswer<N>> for ValueMessage {
    fn from(answer: ParameterAnswer<N>) -> Self {
        let of = |kind: ParameterType| Self {
            r#type: kind as u8,
            ..Self::default()
        };
        match answer {
            ParameterAnswer::Value(Some(ParameterValue::Number(double_value))) => Self {
                double_value,
                ..of(ParameterType::Double)
            },
            ParameterAnswer::Value(Some(ParameterValue::Numbers(numbers))) => Self {
                double_array_value: numbers.to_vec(),
                ..of(ParameterType::DoubleArray)
            },
            ParameterAnswer::Value(Some(ParameterValue::Text(string_value))) => Self {
                string_value,
                ..of(ParameterType::Text)
            },
            _ => Self::default(),
        }
    }
}
