//! rosapi: tells clients of the ROS web world what there is, and gives them the parameters and the time.
//!
//! Parameters are read and set by the arm's own services, as any client would: the same checks, the same words.
//!
//! **Invariant:** nothing is kept between two questions: topics and services are asked of the registry, values of the arm.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;
use serde::Deserialize;
use serde_json::value::RawValue;
use serde_json::{Map, Value, json};
use tokio::sync::oneshot;

use super::ConnectionId;
use super::arm_sim::SimulationTime;
use super::node::{Reply, ServiceCall};
use super::registry::{Nodes, Respond, TakeCensus};
use crate::protocol::catalog::{self, Service};
use crate::protocol::fields::Fields;
use crate::protocol::json;
use crate::protocol::messages::Stamp;
use crate::protocol::op::Arguments;
use crate::protocol::parameters::Parameter;
use crate::protocol::{rosapi, urdf};

/// The value of a parameter that does not exist, as JSON text: clients parse it, so it has to be some.
const NO_VALUE: &str = "\"\"";
const NO_SUCH: &str = "name must be that of a parameter; get_param_names lists them";
const NO_ANSWER: &str = "arm_sim does not answer";

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `rosapi`.
pub struct Rosapi {
    registry: Recipient<TakeCensus>,
    arm: Recipient<ServiceCall>,
    clock: Recipient<SimulationTime>,
    joint_names: Vec<&'static str>,
    /// Who waits for the arm's answer, by the number that stands in for a connection.
    waiting: HashMap<ConnectionId, oneshot::Sender<Bytes>>,
    /// Questions to the arm so far.
    asked: u64,
}

impl Rosapi {
    /// A node that asks the registry who is there and the arm for its values.
    #[must_use]
    pub fn new(
        registry: Recipient<TakeCensus>,
        arm: Recipient<ServiceCall>,
        clock: Recipient<SimulationTime>,
        joint_names: &[&'static str],
    ) -> Self {
        Self {
            registry,
            arm,
            clock,
            joint_names: joint_names.to_vec(),
            waiting: HashMap::new(),
            asked: 0,
        }
    }

    /// Enters this node's services into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        for question in catalog::Rosapi::ALL {
            let service = Service::Rosapi(question);
            nodes.services.insert(service, address.clone().recipient());
        }
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// The arm's answer to a question, as it came.
#[derive(Deserialize)]
struct ArmAnswer {
    values: Map<String, Value>,
    result: bool,
    status: String,
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl Actor for Rosapi {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Handler<ServiceCall> for Rosapi {
    type Result = ();

    fn handle(&mut self, call: ServiceCall, ctx: &mut Context<Self>) {
        let ServiceCall {
            service,
            arguments,
            mut reply,
        } = call;
        let Service::Rosapi(question) = service else {
            debug_assert!(false, "{} is not this node's", service.name());
            return reply.refuse("rosapi does not serve this");
        };
        match question {
            catalog::Rosapi::GetTime => self.tell_time(reply, ctx),
            catalog::Rosapi::GetParam
            | catalog::Rosapi::SetParam
            | catalog::Rosapi::HasParam
            | catalog::Rosapi::DeleteParam
            | catalog::Rosapi::GetParamNames => {
                self.parameter(question, &arguments, reply, ctx);
            }
            _ => {
                let census = self.registry.send(TakeCensus).into_actor(self);
                ctx.spawn(census.map(move |census, _, _| {
                    let census = census.unwrap_or_default();
                    finish(reply, rosapi::answer(question, &arguments, &census));
                }));
            }
        }
    }
}

impl Handler<Respond> for Rosapi {
    type Result = ();

    /// The arm's answer to a question of this node's.
    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        if let Some(waiting) = self.waiting.remove(&respond.connection) {
            let _ = waiting.send(respond.frame);
        }
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

/// Answers and ends the call.
fn finish(mut reply: Reply, answer: Result<Value, String>) {
    match answer {
        Ok(values) => reply.succeed(&values),
        Err(why) => reply.refuse(&why),
    }
}

impl Rosapi {
    fn tell_time(&self, reply: Reply, ctx: &mut Context<Self>) {
        let time = self.clock.send(SimulationTime).into_actor(self);
        ctx.spawn(time.map(move |time, _, _| {
            let answer = match time {
                Ok(time) => {
                    let Stamp { sec, nanosec } = Stamp::from_seconds(time);
                    // ROS 1 has other names for the same; some clients know only those.
                    Ok(json!({"time": {"sec": sec, "nanosec": nanosec, "secs": sec, "nsecs": nanosec}}))
                }
                Err(_) => Err(NO_ANSWER.to_owned()),
            };
            finish(reply, answer);
        }));
    }

    /// Asks the arm, which answers as it answers any client.
    fn ask(
        &mut self,
        service: Service,
        arguments: Arguments,
        ctx: &Context<Self>,
    ) -> impl Future<Output = Option<ArmAnswer>> + use<> {
        self.asked += 1;
        let number = ConnectionId(self.asked);
        let (answered, answer) = oneshot::channel();
        self.waiting.insert(number, answered);
        let (reply, _) = Reply::new(
            ctx.address().recipient(),
            number,
            service,
            service.name().into(),
            None,
            Arc::default(),
        );
        self.arm.do_send(ServiceCall {
            service,
            arguments,
            reply,
        });
        async move { serde_json::from_slice(&answer.await.ok()?).ok() }
    }

    /// Answers a question about parameters.
    fn parameter(
        &mut self,
        question: catalog::Rosapi,
        arguments: &Arguments,
        reply: Reply,
        ctx: &mut Context<Self>,
    ) {
        let asked = match Asked::read(question, arguments) {
            Ok(asked) => asked,
            Err(why) => return finish(reply, Err(why)),
        };
        let found = Parameter::from_name(&asked.name);
        let answer = match (question, found) {
            (catalog::Rosapi::GetParamNames, _) => {
                json!({"names": Parameter::ALL.map(Parameter::full_name)})
            }
            (catalog::Rosapi::HasParam, found) => json!({"exists": found.is_some()}),
            (catalog::Rosapi::GetParam, Some(found)) => return self.get(found, reply, ctx),
            (catalog::Rosapi::SetParam, Some(found)) => {
                return self.set(found, &asked.value, reply, ctx);
            }
            (catalog::Rosapi::GetParam, None) => {
                let value = match &*asked.value {
                    "" => NO_VALUE,
                    default => default,
                };
                json!({"value": value, "successful": false, "reason": NO_SUCH})
            }
            (_, Some(_)) => refused("name: the parameters of the arm can't be deleted"),
            (_, None) => refused(NO_SUCH),
        };
        finish(reply, Ok(answer));
    }

    fn get(&mut self, parameter: Parameter, reply: Reply, ctx: &mut Context<Self>) {
        let (service, field) = parameter.field().unwrap_or((Service::SetParams, ""));
        let answer = self.ask(service, Arguments::none(), ctx).into_actor(self);
        ctx.spawn(answer.map(move |answer, node, _| {
            let Some(ArmAnswer { values, .. }) = answer else {
                return finish(reply, Err(NO_ANSWER.to_owned()));
            };
            let value = match parameter {
                Parameter::RobotDescription => Some(Value::from(node.describe(&values))),
                _ => values.get(field).cloned(),
            };
            let text = value.map_or_else(|| NO_VALUE.to_owned(), |value| value.to_string());
            finish(
                reply,
                Ok(json!({"value": text, "successful": true, "reason": ""})),
            );
        }));
    }

    fn set(&mut self, parameter: Parameter, text: &str, reply: Reply, ctx: &mut Context<Self>) {
        let Some((service, field)) = parameter.field() else {
            let why = "name: robot_description is made from lengths and masses";
            return finish(reply, Ok(refused(why)));
        };
        // As lenient about numbers as every frame: the arm refuses them by the parameter's name.
        let text = json::accept_literals(text.to_owned());
        if RawValue::from_string(text.clone()).is_err() {
            return finish(reply, Ok(refused("value must be JSON text")));
        }
        let Ok(fields) = RawValue::from_string(format!("{{\"{field}\":{text}}}")) else {
            return finish(reply, Ok(refused("value must be JSON text")));
        };
        let answer = self.ask(service, Arguments::Object(fields), ctx);
        ctx.spawn(answer.into_actor(self).map(move |answer, _, _| {
            let answer =
                answer.map(|answer| json!({"successful": answer.result, "reason": answer.status}));
            finish(reply, answer.ok_or_else(|| NO_ANSWER.to_owned()));
        }));
    }

    /// The arm's description, from the values of `set_params`.
    fn describe(&self, values: &Map<String, Value>) -> String {
        let numbers = |field: &str| -> Vec<f64> {
            let entries = values.get(field).and_then(Value::as_array);
            let entries = entries.into_iter().flatten();
            entries.filter_map(Value::as_f64).collect()
        };
        urdf::describe(&self.joint_names, &numbers("lengths"), &numbers("masses"))
    }
}

/// What a question about parameters says.
struct Asked<'a> {
    name: Cow<'a, str>,
    /// The value to be set, or the one to be given where there is none.
    value: Cow<'a, str>,
}

impl<'a> Asked<'a> {
    fn read(question: catalog::Rosapi, arguments: &'a Arguments) -> Result<Self, String> {
        let service = Service::Rosapi(question);
        let mut fields = Fields::read(arguments, service).map_err(|why| why.to_string())?;
        let mut text = |index: usize| {
            let field = service.fields().get(index)?;
            fields.text(field.name)
        };
        let asked = Self {
            name: text(0).unwrap_or_default(),
            value: text(1).unwrap_or_default(),
        };
        if fields.accepted() {
            Ok(asked)
        } else {
            Err(fields.status())
        }
    }
}

fn refused(reason: &str) -> Value {
    json!({"successful": false, "reason": reason})
}
