//! Questions about parameters in JSON, in the forms of rosapi and of ROS 2.
//!
//! **Invariant:** a value is read as the arm's own service reads it, and has the type of its declaration. A question
//! about a parameter that does not exist reaches the node.

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::{
    ArmQuestion, AskParameters, NamedParameter, NotSet, ParameterRequest, ParameterValue,
    Parameters,
};
use crate::actors::arm::sim::FieldByField;
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
/// The value of a parameter that does not exist, as JSON text, because clients parse it.
const NO_VALUE: &str = "\"\"";

impl<const N: usize> Parameters<N> {
    /// Adds the services of parameters to the registry's table.
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

/// The parameters of a question, and the request about each.
type Entries<const N: usize> = Vec<(NamedParameter, Option<ParameterRequest<N>>)>;

impl<const N: usize> Callable for AskParameters<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let entries = match service {
            Service::Rosapi(Rosapi::GetParamNames) => described(|_| true),
            Service::Rosapi(question) => vec![read_rosapi(question, service, &mut fields)],
            Service::ListParameters => {
                let prefixes = fields.texts("prefixes", MAX_NAMED).unwrap_or_default();
                // No parameter's name has a full stop, so a prefix can only be the name itself.
                described(|name| prefixes.is_empty() || prefixes.iter().any(|one| one == name))
            }
            Service::SetParameters => read_changes(&mut fields)?,
            _ => {
                let names = fields.texts("names", MAX_NAMED).unwrap_or_default();
                let entry = |name| {
                    let named = NamedParameter::of(name);
                    let is_read = service == Service::GetParameters;
                    let read = named.parameter.filter(|_| is_read);
                    (named, read.map(|parameter| request(parameter, None)))
                };
                names.into_iter().map(entry).collect()
            }
        };
        fields.accept(Self { entries })
    }
}

/// Descriptions of the parameters that `is_meant` selects by name.
fn described<const N: usize>(is_meant: impl Fn(&str) -> bool) -> Entries<N> {
    let names = Parameter::ALL.into_iter().map(Parameter::name);
    let meant = names.filter(|name| is_meant(name));
    meant
        .map(|name| (NamedParameter::of(name.to_owned()), None))
        .collect()
}

/// A question of rosapi about one parameter. Its first field is the name, and the second, if there is one, a value.
fn read_rosapi<const N: usize>(
    question: Rosapi,
    service: Service,
    fields: &mut Fields<'_>,
) -> (NamedParameter, Option<ParameterRequest<N>>) {
    let mut text = |index: usize| {
        let field = service.fields().get(index)?;
        fields.text(field.name)
    };
    let (name, value) = (text(0), text(1));
    let mut named = NamedParameter::of(name.unwrap_or_default().into_owned());
    let value = value.unwrap_or_default();
    let request = match (question, named.parameter) {
        (Rosapi::GetParam, parameter) => {
            named.default = value.into_owned();
            parameter.map(|parameter| request(parameter, None))
        }
        (Rosapi::SetParam, None) => Some(Err(NotSet::Unknown)),
        (Rosapi::SetParam, Some(parameter)) => {
            // Literals are accepted as in every frame. They are refused by the parameter's name.
            let text = json::accept_literals(value.into_owned());
            let value = RawValue::from_string(text).map_err(|_| NotSet::NotJson);
            Some(value.and_then(|value| request(parameter, Some(&value))))
        }
        _ => None,
    };
    (named, request)
}

/// The request to the service that has the parameter as a field: with a `value`, or without one to read it.
fn request<const N: usize>(parameter: Parameter, value: Option<&RawValue>) -> ParameterRequest<N> {
    fn read<A: FieldByField>(fields: Fields<'_>, field: &str, parameter: Parameter) -> A {
        let mut ask = A::request(fields);
        ask.rejected().rename(field, parameter.name());
        ask
    }
    let (service, field) = match (parameter.field(), value) {
        (Some(field), _) => field,
        // It is computed from these.
        (None, None) => (Service::SetParams, ""),
        (None, Some(_)) => return Err(NotSet::Derived),
    };
    let fields = Fields::single(service, field, value);
    Ok(match service {
        Service::SetParams => ArmQuestion::Params(read(fields, field, parameter)),
        Service::SetGains => ArmQuestion::Gains(read(fields, field, parameter)),
        Service::SetPeriod => ArmQuestion::Period(read(fields, field, parameter)),
        _ => ArmQuestion::Integrator(read(fields, field, parameter)),
    })
}

/// The changes of `/arm_sim/set_parameters`.
fn read_changes<const N: usize>(fields: &mut Fields<'_>) -> Result<Entries<N>, Rejections> {
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
fn read_given<const N: usize>(
    entry: &RawValue,
) -> Option<(NamedParameter, Option<ParameterRequest<N>>)> {
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
    let change = |parameter: Parameter| {
        let expected = parameter.kind();
        let member = match (expected, kind) {
            (ParameterType::Double, 2) => integer,
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
        request(parameter, Some(member.unwrap_or(RawValue::NULL)))
    };
    let change = named.parameter.ok_or(NotSet::Unknown).and_then(change);
    Some((named, Some(change)))
}

// ---- writing --------------------------------------------------------------------------------------------------------

impl<const N: usize> Answered for AskParameters<N> {
    fn write(answers: Self::Answer, to: &Address) -> Bytes {
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
                let values = answers.into_iter();
                let values = values.map(|(_, answer)| ValueMessage::from(answer.ok().flatten()));
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
    answer: Result<Option<ParameterValue<N>>, NotSet>,
) -> Value {
    match question {
        Rosapi::HasParam => json!({"exists": named.parameter.is_some()}),
        Rosapi::SetParam => change_values(&answer),
        Rosapi::GetParam => match answer.ok().flatten() {
            Some(value) => {
                let value = match value {
                    ParameterValue::Number(number) => Value::from(number),
                    ParameterValue::Numbers(numbers) => Value::from(numbers.to_vec()),
                    ParameterValue::Text(text) => Value::from(text),
                };
                json!({"value": value.to_string(), "successful": true, "reason": ""})
            }
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

impl<const N: usize> From<Option<ParameterValue<N>>> for ValueMessage {
    fn from(value: Option<ParameterValue<N>>) -> Self {
        let mut message = Self::default();
        let kind = match value {
            None => return message,
            Some(ParameterValue::Number(number)) => {
                message.double_value = number;
                ParameterType::Double
            }
            Some(ParameterValue::Numbers(numbers)) => {
                message.double_array_value = numbers.to_vec();
                ParameterType::DoubleArray
            }
            Some(ParameterValue::Text(text)) => {
                message.string_value = text;
                ParameterType::Text
            }
        };
        message.r#type = kind as u8;
        message
    }
}
