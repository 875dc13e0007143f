//! The rosbridge ops. Subscriptions, calls, actions and action servers have a file each. `fan_out.rs` delivers
//! published messages, and `cleanup.rs` ends requests that nobody will answer.
//!
//! **Invariant:** what is refused is answered, by an error status or by the call's one response, and changes nothing.

mod action_servers;
mod actions;
mod calls;
mod cleanup;
pub(crate) mod fan_out;
mod subscriptions;

use std::sync::Arc;

use actix::prelude::*;
use tokio::sync::oneshot;

use self::fan_out::Backpressure;
use crate::actors::ConnectionId;
use crate::actors::gateway::messages::{Handled, Request, Tapped};
use crate::actors::gateway::registry::refusal::Refusal;
use crate::actors::gateway::registry::state::{FrameOrigin, Registry};
use crate::actors::gateway::registry::tables::census::Use;
use crate::actors::gateway::registry::tables::services::Provider;
use crate::actors::wire::TopicMessage;
use crate::protocol::catalog::{Direction, Service, Topic};
use crate::protocol::messages::trajectory::NodeMessage;
use crate::protocol::messages::{self, Level};
use crate::protocol::names;
use crate::protocol::op::Op;
use crate::protocol::wire::payload::Payload;
use crate::protocol::wire::series::Series;

impl Registry {
    /// Performs one op of a client that is known.
    pub(crate) fn perform(&mut self, request: Request, ctx: &mut Context<Self>) -> Handled {
        let origin = FrameOrigin {
            from: request.from,
            id: request.id,
        };
        let refusal = match request.op {
            Op::Publish { topic, msg, heard } => {
                return self.publish(origin, &topic, &msg, heard, ctx);
            }
            Op::PublishLines(lines) => return self.publish_lines(origin.from, &lines, ctx),
            Op::CallService(call) => return self.call(origin, call, ctx),
            Op::SendActionGoal(goal) => {
                return self.send_action_goal(origin.from, origin.id, goal, ctx);
            }
            Op::CancelActionGoal { action } => {
                return self.cancel_action_goal(origin.from, origin.id, &action, ctx);
            }
            Op::Advertise { topic, type_name } => {
                self.advertise(&origin, &topic, type_name.as_deref())
            }
            Op::Unadvertise { topic } => {
                self.unadvertise(&origin, &topic);
                Ok(())
            }
            Op::Subscribe(subscribe) => self.subscribe(&origin, &subscribe),
            Op::Unsubscribe { topic } => {
                self.unsubscribe(&origin, &topic);
                Ok(())
            }
            Op::AdvertiseService { service, type_name } => {
                self.advertise_service(&origin, &service, type_name.as_deref())
            }
            Op::UnadvertiseService { service } => self.unadvertise_service(&origin, &service),
            Op::ServeAction { action, op } => self.serve_action(&origin, &action, op),
            Op::SetLevel { verbosity, errors } => {
                if let Some(client) = self.clients.get_mut(&origin.from) {
                    client.verbosity = verbosity;
                    client.set_error_form(errors);
                }
                Ok(())
            }
            // Pieces have been put together before, and so has a token been checked; where none is asked for, any token
            // will do.
            Op::Fragment(_) | Op::Auth { .. } => Ok(()),
            Op::ServiceResponse {
                service,
                values,
                result,
                status,
            } => {
                let status = status.unwrap_or_default();
                self.complete(&origin, &service, |service, id| {
                    messages::response_raw(service, id, &values, result, &status)
                })
            }
            Op::BadAnswer {
                of_goal: true,
                name,
                problem,
            } => self.fail_goal(&origin, name.as_deref(), Refusal::Unreadable(problem)),
            Op::BadAnswer { name, problem, .. } => {
                self.fail_call(&origin, name.as_deref(), Refusal::Unreadable(problem))
            }
        };
        if let Err(why) = refusal {
            self.send_status(
                origin.from,
                Level::Error,
                &why.to_string(),
                origin.id.as_ref(),
            );
        }
        Handled::at_once()
    }

    fn advertise(
        &mut self,
        origin: &FrameOrigin,
        topic: &str,
        type_name: Option<&str>,
    ) -> Result<(), Refusal> {
        refuse_runtime_topic(topic)?;
        let topic = &*names::absolute(topic);
        let Some(client) = self.clients.get(&origin.from) else {
            return Ok(());
        };
        let before = client.advertised.get(topic);
        let new = before.is_none();
        let names = topic.len() + type_name.map_or(0, str::len);
        let entry = client.kept.enter(names, before)?;
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        if new {
            self.tally.add(topic, Use::Advertised, type_name);
        }
        let is_noted = |type_name| self.tally.note_type(topic, type_name);
        if new || type_name.is_some_and(is_noted) {
            client.advertised.insert(topic.into(), entry);
        }
        if let Some(topic) = Topic::from_name(topic) {
            client.withdrawn.remove(&topic);
        }
        Ok(())
    }

    fn unadvertise(&mut self, origin: &FrameOrigin, topic: &str) {
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return;
        };
        let topic = &*names::absolute(topic);
        if client.advertised.remove(topic).is_some() {
            self.tally.remove(topic, Use::Advertised);
        }
        if let Some(topic) = Topic::from_name(topic).filter(|topic| is_listened_to(*topic)) {
            client.withdrawn.insert(topic);
        }
    }

    /// Delivers a client's message to the topic's subscribers, and to the runtime's own listener if it has one.
    fn publish(
        &mut self,
        origin: FrameOrigin,
        topic: &str,
        msg: &Payload,
        heard: Option<NodeMessage>,
        ctx: &mut Context<Self>,
    ) -> Handled {
        if let Err(why) = refuse_runtime_topic(topic) {
            self.send_status(
                origin.from,
                Level::Error,
                &why.to_string(),
                origin.id.as_ref(),
            );
            return Handled::at_once();
        }
        let topic = &*names::absolute(topic);
        let Some(client) = self.clients.get(&origin.from) else {
            return Handled::at_once();
        };
        let listener = Topic::from_name(topic)
            .filter(|topic| is_listened_to(*topic) && !client.withdrawn.contains(topic))
            .and_then(|topic| self.nodes.listeners.get(&topic));
        if listener.is_none() && !client.advertised.contains_key(topic) {
            return Handled::at_once();
        }
        let mut pace = Backpressure::default();
        let encode = |spelling: &str| messages::publish_raw(spelling, msg);
        self.fan_out(topic, Some(&mut pace), encode, ctx);
        let Some(listener) = listener else {
            return pace.and(Handled::at_once());
        };
        if let Some(topic) = Topic::from_name(topic) {
            self.tap.pass(Tapped::NodeMessage(topic, msg));
        }
        let (done, ended) = oneshot::channel();
        listener(TopicMessage {
            heard: heard.unwrap_or_else(|| msg.clone().into()),
            respond: ctx.address().recipient(),
            connection: origin.from,
            present: Arc::downgrade(&client.present),
            listening: Arc::downgrade(&client.listening),
            id: origin.id,
            done,
        });
        pace.and(Handled::by_node(ended))
    }

    /// Delivers messages of a client as they are, if it advertises the topic.
    fn publish_lines(
        &self,
        from: ConnectionId,
        lines: &Series,
        ctx: &mut Context<Self>,
    ) -> Handled {
        let topic = &*lines.topic;
        let mut pace = Backpressure::default();
        let client = self.clients.get(&from);
        if client.is_some_and(|client| client.advertised.contains_key(topic)) {
            let encode = |spelling: &str| messages::respelled(topic, spelling, &lines.frames);
            self.fan_out(topic, Some(&mut pace), encode, ctx);
        }
        pace.and(Handled::at_once())
    }

    fn advertise_service(
        &mut self,
        origin: &FrameOrigin,
        spelling: &str,
        type_name: Option<&str>,
    ) -> Result<(), Refusal> {
        if Service::from_name(spelling).is_some() {
            return Err(Refusal::RuntimeService(spelling.to_owned()));
        }
        let service = &*names::absolute(spelling);
        let Some(client) = self.clients.get(&origin.from) else {
            return Ok(());
        };
        let names = spelling.len() + type_name.map_or(0, str::len);
        let entry = client.kept.enter(names, client.provided.get(service))?;
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        client.provided.insert(service.into(), entry);
        if let Some(before) = self
            .services
            .provider(service)
            .map(|provider| provider.connection)
            .filter(|&one| one != origin.from)
            && let Some(before) = self.clients.get_mut(&before)
        {
            before.provided.remove(service);
        }
        let provider = Provider {
            connection: origin.from,
            spelling: spelling.into(),
        };
        self.services.provide(service, provider);
        self.tally.provide(service, type_name);
        let msg = format!("advertised service {spelling}");
        self.send_status(origin.from, Level::Info, &msg, origin.id.as_ref());
        Ok(())
    }

    fn unadvertise_service(&mut self, origin: &FrameOrigin, service: &str) -> Result<(), Refusal> {
        let name = &*names::absolute(service);
        if !self.withdraw_service(name, origin.from) {
            return Err(Refusal::NotProvider(service.to_owned()));
        }
        if let Some(client) = self.clients.get_mut(&origin.from) {
            client.provided.remove(name);
        }
        Ok(())
    }
}

/// Topics that the runtime alone publishes are not for clients.
fn refuse_runtime_topic(topic: &str) -> Result<(), Refusal> {
    match Topic::from_name(topic) {
        Some(own) if !is_listened_to(own) => Err(Refusal::RuntimeTopic(topic.to_owned())),
        _ => Ok(()),
    }
}

/// Whether the runtime itself subscribes to the topic.
pub(crate) fn is_listened_to(topic: Topic) -> bool {
    topic.direction() == Direction::Subscribed
}
