//! The questions to `rosapi` in JSON, and the responses.
//!
//! **Invariant:** a parameter's value is read as the arm's own service reads it.

use std::borrow::Cow;

use actix::prelude::*;
use bytes::Bytes;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::{
    Change, DeleteParam, GetParam, GetParamNames, GetTime, HasParam, Listing, Look, NotDeleted,
    NotSet, ParameterValue, Rosapi, SetParam, Unknown,
};
use crate::actors::arm::sim::{SetGains, SetIntegrator, SetParams};
use crate::actors::wire::{Address, Answered, Nodes, Served, Streamed};
use crate::protocol::catalog::{self, Service};
use crate::protocol::messages::Stamp;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, Rejections};
use crate::protocol::ros::parameters::Parameter;
use crate::protocol::ros::rosapi;
use crate::protocol::wire::json;

/// The value of a parameter that does not exist, as JSON text: clients parse it, so it has to be some.
const NO_VALUE: &str = "\"\"";

impl<const N: usize> Rosapi<N> {
    /// Enters this node's services into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        for question in catalog::Rosapi::ALL {
            let service = Service::Rosapi(question);
            let node = address.clone();
            match question {
                catalog::Rosapi::GetTime => nodes.serve::<GetTime>(service, node),
                catalog::Rosapi::GetParam => nodes.serve::<GetParam<N>>(service, node),
                catalog::Rosapi::SetParam => nodes.serve::<SetParam<N>>(service, node),
                catalog::Rosapi::HasParam => nodes.serve::<HasParam>(service, node),
                catalog::Rosapi::DeleteParam => nodes.serve::<DeleteParam>(service, node),
                catalog::Rosapi::GetParamNames => nodes.serve::<GetParamNames>(service, node),
                _ => nodes.serve_long::<Look>(service, node),
            }
        }
    }
}

// ---- what there is --------------------------------------------------------------------------------------------------

impl Served for Look {
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
    type Writer = Option<Bytes>;

    fn begin(Listing { look, census }: Listing, to: &Address) -> Self::Writer {
        Some(to.outcome(rosapi::answer(look.question, &look.name, &census)))
    }

    fn advance(writer: &mut Self::Writer) -> Option<Bytes> {
        writer.take()
    }
}

// ---- time -----------------------------------------------------------------------------------------------------------

impl Served for GetTime {
    fn read(_: Service, _: &Arguments) -> Result<Self, Rejections> {
        Ok(Self)
    }
}

impl Answered for GetTime {
    fn write(time: f64, to: &Address) -> Bytes {
        let Stamp { sec, nanosec } = Stamp::from_seconds(time);
        // ROS 1 has other names for the same; some clients know only those.
        let time = json!({"sec": sec, "nanosec": nanosec, "secs": sec, "nsecs": nanosec});
        to.response(&json!({"time": time}), "")
    }
}

// ---- parameters -----------------------------------------------------------------------------------------------------

/// The first two fields, both texts; empty where the question has no such field, or the request leaves it out.
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

impl<const N: usize> Served for GetParam<N> {
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

impl<const N: usize> Served for SetParam<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let (name, text) = read_texts(service, arguments)?;
        let change = match Parameter::from_name(&name) {
            None => Err(NotSet::Unknown),
            Some(parameter) => read_text(parameter, &text),
        };
        Ok(Self { change })
    }
}

/// A value in JSON text.
fn read_text<const N: usize>(parameter: Parameter, text: &str) -> Result<Change<N>, NotSet> {
    // As lenient about numbers as every frame: they are refused by the parameter's name.
    let text = json::accept_literals(text.to_owned());
    let value = RawValue::from_string(text).map_err(|_| NotSet::NotJson)?;
    read_change(parameter, &value)
}

/// A value, as the arm's own service would read it.
pub(in crate::actors::ros) fn read_change<const N: usize>(
    parameter: Parameter,
    value: &RawValue,
) -> Result<Change<N>, NotSet> {
    let (service, field) = parameter.field().ok_or(NotSet::Derived)?;
    let fields = Fields::single(service, field, value);
    Ok(match service {
        Service::SetParams => Change::Params(SetParams::request(fields)),
        Service::SetGains => Change::Gains(SetGains::request(fields)),
        _ => Change::Integrator(SetIntegrator::request(fields)),
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

impl Served for HasParam {
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

impl Served for DeleteParam {
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

impl Served for GetParamNames {
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
