//! The parameter services in JSON.
//!
//! **Invariant:** a value is read by the arm's own service, and has its declared type.

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;
use serde_json::json;
use serde_json::value::RawValue;

use super::{
    DescribeParameters, GetParameterTypes, GetParameters, ListParameters, Parameters, SetParameters,
};
use crate::actors::ros::rosapi::{NotSet, ParamChange, ParameterValue, read_change};
use crate::actors::wire::{Address, Answered, Callable, Nodes};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, RejectedField, Rejections};
use crate::protocol::ros::parameters::{MAX_NAMED, Parameter, ParameterType};
use crate::protocol::wire::json::{self, text};

impl<const N: usize> Parameters<N> {
    /// Adds this node's services to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        let node = || address.clone();
        nodes.serve::<ListParameters>(Service::ListParameters, node());
        nodes.serve::<GetParameters<N>>(Service::GetParameters, node());
        nodes.serve::<GetParameterTypes>(Service::GetParameterTypes, node());
        nodes.serve::<DescribeParameters>(Service::DescribeParameters, node());
        nodes.serve::<SetParameters<N>>(Service::SetParameters, node());
    }
}

// ---- reading --------------------------------------------------------------------------------------------------------

/// The list of texts in the field `name` of a request; empty if an optional field is absent.
fn read_texts(
    service: Service,
    arguments: &Arguments,
    name: &'static str,
) -> Result<Vec<String>, Rejections> {
    let mut fields = Fields::read(arguments, service)?;
    let texts = fields.texts(name, MAX_NAMED);
    if fields.accepted() {
        Ok(texts.unwrap_or_default())
    } else {
        Err(fields.finish())
    }
}

fn read_parameters(
    service: Service,
    arguments: &Arguments,
) -> Result<Vec<Option<Parameter>>, Rejections> {
    let names = read_texts(service, arguments, "names")?;
    Ok(names
        .iter()
        .map(|name| Parameter::from_name(name))
        .collect())
}

impl Callable for ListParameters {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let prefixes = read_texts(service, arguments, "prefixes")?;
        Ok(Self { prefixes })
    }
}

impl<const N: usize> Callable for GetParameters<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let parameters = read_parameters(service, arguments)?;
        Ok(Self { parameters })
    }
}

impl Callable for GetParameterTypes {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let parameters = read_parameters(service, arguments)?;
        Ok(Self { parameters })
    }
}

impl Callable for DescribeParameters {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let names = read_texts(service, arguments, "names")?.into_iter();
        let parameters = names.map(|name| {
            let parameter = Parameter::from_name(&name);
            (name, parameter)
        });
        Ok(Self {
            parameters: parameters.collect(),
        })
    }
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
}

impl<const N: usize> Callable for SetParameters<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let entries = fields.entries("parameters", MAX_NAMED);
        let Some(entries) = entries.filter(|_| fields.accepted()) else {
            return Err(fields.finish());
        };
        let mut changes = Vec::with_capacity(entries.len());
        for (index, entry) in entries.into_iter().enumerate() {
            match GivenParameter::read(entry) {
                Some(given) => changes.push(given.change()),
                None => {
                    let field = format!("parameters[{index}]");
                    let reason =
                        "must be a rcl_interfaces/msg/Parameter: name and value, with its type";
                    return Err(RejectedField::refused(&field, &reason).into());
                }
            }
        }
        Ok(Self { changes })
    }
}

impl GivenParameter<'_> {
    fn change<const N: usize>(&self) -> Result<ParamChange<N>, NotSet> {
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
        let of = |kind: ParameterType| Self {
            r#type: kind as u8,
            ..Self::default()
        };
        match value {
            None => Self::default(),
            Some(ParameterValue::Number(double_value)) => Self {
                double_value,
                ..of(ParameterType::Double)
            },
            Some(ParameterValue::Numbers(numbers)) => Self {
                double_array_value: numbers.to_vec(),
                ..of(ParameterType::DoubleArray)
            },
            Some(ParameterValue::Text(string_value)) => Self {
                string_value,
                ..of(ParameterType::Text)
            },
        }
    }
}

/// The number of a parameter's type; 0 (not set) for an unknown parameter.
fn type_number(parameter: Option<Parameter>) -> u8 {
    parameter.map_or(0, |parameter| parameter.kind() as u8)
}

impl Answered for ListParameters {
    fn write(parameters: Vec<Parameter>, to: &Address) -> Bytes {
        let names: Vec<&str> = parameters.into_iter().map(Parameter::name).collect();
        to.response(&json!({"result": {"names": names, "prefixes": []}}), "")
    }
}

impl<const N: usize> Answered for GetParameters<N> {
    fn write(values: Vec<Option<ParameterValue<N>>>, to: &Address) -> Bytes {
        let values: Vec<ValueMessage> = values.into_iter().map(Into::into).collect();
        to.response(&json!({"values": values}), "")
    }
}

impl Answered for GetParameterTypes {
    fn write(parameters: Vec<Option<Parameter>>, to: &Address) -> Bytes {
        let types: Vec<u8> = parameters.into_iter().map(type_number).collect();
        to.response(&json!({"types": types}), "")
    }
}

impl Answered for DescribeParameters {
    fn write(parameters: Vec<(String, Option<Parameter>)>, to: &Address) -> Bytes {
        let described = parameters.into_iter().map(|(name, parameter)| {
            json!({
                "name": parameter.map_or(name, |one| one.name().to_owned()),
                "type": type_number(parameter),
                "description": parameter.map(Parameter::description).unwrap_or_default(),
                "additional_constraints": "",
                "read_only": parameter.is_some_and(|one| one.field().is_none()),
                "dynamic_typing": false,
                "floating_point_range": [],
                "integer_range": [],
            })
        });
        let descriptors: Vec<_> = described.collect();
        to.response(&json!({"descriptors": descriptors}), "")
    }
}

impl<const N: usize> Answered for SetParameters<N> {
    fn write(results: Vec<Result<(), NotSet>>, to: &Address) -> Bytes {
        let results = results.into_iter().map(|result| {
            let reason = result
                .as_ref()
                .map_or_else(NotSet::to_string, |()| String::new());
            json!({"successful": result.is_ok(), "reason": reason})
        });
        let results: Vec<_> = results.collect();
        to.response(&json!({"results": results}), "")
    }
}
