//! What each rosbridge op does, in the order of the protocol's table.
//!
//! **Invariant:** what is refused is answered, by an error status or by the call's one response, and changes nothing.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;
use serde_json::value::RawValue;
use tokio::sync::oneshot;
use tokio::time::{Instant, sleep_until};

use super::census::Use;
use super::refusal::Refusal;
use super::services::{Forwarded, Provider, Services};
use super::topics::{Subscription, Throttle};
use super::{
    DEFAULT_TIMEOUT, Handled, MAX_ADVERTISED, MAX_BACKLOG, MAX_PROVIDED, MAX_SUBSCRIPTIONS,
    MAX_WAITING_CALLS, Registry, Request, TimedOut,
};
use crate::actors::ConnectionId;
use crate::actors::budget::Claim;
use crate::actors::connection::Configure;
use crate::actors::node::{Reply, SMALL_ANSWER, Sender, ServiceCall, TopicMessage};
use crate::protocol::catalog::{Direction, Service, Topic, types};
use crate::protocol::messages::{self, Level};
use crate::protocol::names;
use crate::protocol::op::{Arguments, CallService, Compression, MAX_NAME, Op, Subscribe};

/// Who sent the frame that is being performed, and its `id`.
struct Origin {
    from: ConnectionId,
    id: Option<Box<RawValue>>,
}

impl Registry {
    /// Performs one op of a client that is known.
    pub(super) fn perform(&mut self, request: Request, ctx: &mut Context<Self>) -> Handled {
        let origin = Origin {
            from: request.from,
            id: request.id,
        };
        let refusal = match request.op {
            Op::Publish { topic, msg } => return self.publish(origin, &topic, msg),
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
            Op::SetLevel(verbosity) => {
                if let Some(client) = self.clients.get_mut(&origin.from) {
                    client.verbosity = verbosity;
                }
                Ok(())
            }
            // Pieces are put together before they get here; a token is asked for before, and where nothing is asked,
            // anything shown will do.
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
        };
        if let Err(why) = refusal {
            self.send_status(
                origin.from,
                Level::Error,
                &why.to_string(),
                origin.id.as_deref(),
            );
        }
        Handled(None)
    }

    fn advertise(
        &mut self,
        origin: &Origin,
        topic: &str,
        type_name: Option<&str>,
    ) -> Result<(), Refusal> {
        refuse_runtime_topic(topic)?;
        let topic = &*names::absolute(topic);
        let Some(client) = self.clients.get(&origin.from) else {
            return Ok(());
        };
        let new = !client.advertised.contains_key(topic);
        if new && client.advertised.len() >= MAX_ADVERTISED {
            return Err(Refusal::TooManyAdvertised);
        }
        let bytes = topic.len() + type_name.map_or(0, str::len);
        let share = new.then(|| self.name_share(bytes)).transpose()?;
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        if let Some(share) = share {
            client.advertised.insert(topic.into(), share);
            self.tally.add(topic, Use::Advertised, type_name);
        }
        if let Some(topic) = Topic::from_name(topic) {
            client.withdrawn.remove(&topic);
        }
        Ok(())
    }

    fn unadvertise(&mut self, origin: &Origin, topic: &str) {
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
    fn publish(&mut self, origin: Origin, topic: &str, msg: Box<RawValue>) -> Handled {
        if let Err(why) = refuse_runtime_topic(topic) {
            self.send_status(
                origin.from,
                Level::Error,
                &why.to_string(),
                origin.id.as_deref(),
            );
            return Handled(None);
        }
        let topic = &*names::absolute(topic);
        let Some(client) = self.clients.get(&origin.from) else {
            return Handled(None);
        };
        let listener = Topic::from_name(topic)
            .filter(|topic| is_listened_to(*topic) && !client.withdrawn.contains(topic))
            .and_then(|topic| self.nodes.listeners.get(&topic));
        if listener.is_none() && !client.advertised.contains_key(topic) {
            return Handled(None);
        }
        self.fan_out(topic, |spelling| messages::publish_raw(spelling, &msg));
        let Some(listener) = listener else {
            return Handled(None);
        };
        let (done, ended) = oneshot::channel();
        let sender = Some(Sender {
            connection: origin.from,
            id: origin.id,
            done,
        });
        listener.do_send(TopicMessage { msg, sender });
        Handled(Some(ended))
    }

    fn subscribe(&mut self, origin: &Origin, subscribe: &Subscribe) -> Result<(), Refusal> {
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        let held: usize = client.subscriptions.values().map(Vec::len).sum();
        let topic = subscribe.topic.as_str();
        let id: Option<Box<str>> = origin.id.as_ref().map(|id| id.get().into());
        if id.as_ref().is_some_and(|id| id.len() > MAX_NAME) {
            return Err(Refusal::LongSubscriptionId(MAX_NAME));
        }
        let known = client
            .subscriptions
            .get(topic)
            .is_some_and(|all| all.iter().any(|one| one.id == id));
        if !known && held >= MAX_SUBSCRIPTIONS {
            return Err(Refusal::TooManySubscriptions);
        }
        let absolute = names::absolute(topic);
        if subscribe.encoding.compression == Compression::CborRaw {
            let type_name = self.type_of(topic).or(subscribe.type_name.as_deref());
            if type_name.and_then(types::find).is_none() {
                return Err(Refusal::UnknownType);
            }
        }
        let bytes = [id.as_deref(), subscribe.type_name.as_deref()];
        let bytes: usize = bytes.into_iter().flatten().map(str::len).sum();
        let share = self.name_share(topic.len() + bytes)?;
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        let first = !self.topics.has_subscribers(&absolute);
        let (name, new) = self
            .topics
            .add(topic, origin.from, client.outlets.deliver.clone());
        if new {
            let type_name = subscribe.type_name.as_deref();
            self.tally.add(&absolute, Use::Subscribed, type_name);
        }
        let subscriptions = client.subscriptions.entry(name.clone()).or_default();
        subscriptions.retain(|one| one.id != id);
        subscriptions.push(Subscription {
            id,
            throttle: subscribe.throttle,
            queue_length: subscribe.queue_length,
            encoding: subscribe.encoding,
            _share: share,
        });
        let throttle = Throttle::of(subscriptions);
        self.topics.configure(&name, origin.from, subscriptions);
        let shared = Arc::clone(&name);
        client.outlets.configure.do_send(Configure {
            topic: name,
            throttle,
        });
        // The status leaves before the first message: the topic's owner hears of the subscriber after it.
        let msg = format!("subscribed to {topic}");
        self.send_status(origin.from, Level::Info, &msg, origin.id.as_deref());
        if first {
            self.tell_owner(topic, true);
        } else if new {
            self.deliver_latched(&shared, origin.from);
        }
        Ok(())
    }

    fn unsubscribe(&mut self, origin: &Origin, topic: &str) {
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return;
        };
        let Some((name, _)) = client.subscriptions.get_key_value(topic) else {
            return;
        };
        let name = name.clone();
        let mut left = client.subscriptions.remove(topic).unwrap_or_default();
        match &origin.id {
            None => left.clear(),
            Some(id) => left.retain(|one| one.id.as_deref() != Some(id.get())),
        }
        let throttle = Throttle::of(&left);
        client.outlets.configure.do_send(Configure {
            topic: name.clone(),
            throttle,
        });
        if left.is_empty() {
            self.drop_subscriber(&name, origin.from);
        } else {
            self.topics.configure(&name, origin.from, &left);
            client.subscriptions.insert(name, left);
        }
    }

    fn advertise_service(
        &mut self,
        origin: &Origin,
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
        if client.provided.len() >= MAX_PROVIDED && !client.provided.contains_key(service) {
            return Err(Refusal::TooManyProvided);
        }
        let share = self.name_share(service.len() + type_name.map_or(0, str::len))?;
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        client.provided.insert(service.into(), share);
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
        self.send_status(origin.from, Level::Info, &msg, origin.id.as_deref());
        Ok(())
    }

    fn unadvertise_service(&mut self, origin: &Origin, service: &str) -> Result<(), Refusal> {
        let name = &*names::absolute(service);
        if !self.withdraw_service(name, origin.from) {
            return Err(Refusal::NotProvider(service.to_owned()));
        }
        if let Some(client) = self.clients.get_mut(&origin.from) {
            client.provided.remove(name);
        }
        Ok(())
    }

    /// Sends a call to the node or the client that serves it; whatever fails is the call's one response.
    fn call(&mut self, origin: Origin, call: CallService, ctx: &mut Context<Self>) -> Handled {
        let own = Service::from_name(&call.service);
        let refusal = if let Some(why) = self.closed {
            Err(Refusal::Closed(why))
        } else if let Some(service) = own {
            match self.nodes.services.get(&service) {
                Some(node) => {
                    let name = call.service.into_boxed_str();
                    let registry = ctx.address().recipient();
                    let (reply, ended) = Reply::new(
                        registry,
                        origin.from,
                        service,
                        name,
                        origin.id,
                        self.gone(origin.from),
                    );
                    let reply = reply.within(self.gauges.totals().responses.clone());
                    node.do_send(ServiceCall {
                        service,
                        arguments: call.args,
                        reply,
                    });
                    return Handled(Some(ended));
                }
                None => Err(Refusal::NotServed(call.service.clone())),
            }
        } else {
            self.forward(&origin, &call, ctx)
        };
        if let Err(why) = refusal {
            self.send_response(origin.from, &call.service, origin.id.as_deref(), &why);
        }
        Handled(None)
    }

    /// Passes a call on to the client that provides the service.
    fn forward(
        &mut self,
        origin: &Origin,
        call: &CallService,
        ctx: &mut Context<Self>,
    ) -> Result<(), Refusal> {
        let service = call.service.as_str();
        let provider = self
            .services
            .provider(&names::absolute(service))
            .cloned()
            .and_then(|provider| Some((self.clients.get(&provider.connection)?, provider)));
        let Some((client, provider)) = provider else {
            return Err(Refusal::NoProvider(service.to_owned()));
        };
        if matches!(call.args, Arguments::Neither(_)) {
            return Err(Refusal::BadArguments);
        }
        if self.services.waiting_for(origin.from) >= MAX_WAITING_CALLS {
            return Err(Refusal::TooManyWaiting);
        }
        if client.backlog() > MAX_BACKLOG {
            return Err(Refusal::ProviderBusy(service.to_owned()));
        }
        let number = self.services.next_call();
        let frame = messages::call(
            &provider.spelling,
            &Services::call_id(number),
            call.args.raw(),
        );
        let id_bytes = origin.id.as_ref().map_or(0, |id| id.get().len());
        let take = |bytes| {
            let share = client.responses.take(bytes, Claim::Ordinary);
            share.ok_or(Refusal::NoRoom)
        };
        let share = take(SMALL_ANSWER + 2 * id_bytes)?;
        client.pass(take(frame.len())?.cover(frame), None);
        let registry = ctx.address();
        let deadline = Instant::now() + call.timeout.unwrap_or(DEFAULT_TIMEOUT);
        let timer = actix_rt::spawn(async move {
            sleep_until(deadline).await;
            registry.do_send(TimedOut(number));
        });
        self.services.remember(
            number,
            Forwarded {
                caller: origin.from,
                id: origin.id.clone(),
                provider: provider.connection,
                service: service.into(),
                deadline,
                timer: timer.abort_handle(),
                share,
            },
        );
        Ok(())
    }

    /// A provider's answer goes back under the caller's own id.
    fn complete(
        &mut self,
        origin: &Origin,
        service: &str,
        encode: impl FnOnce(&str, Option<&RawValue>) -> Bytes,
    ) -> Result<(), Refusal> {
        let mut call = self
            .services
            .complete(origin.id.as_deref(), service, origin.from)
            .ok_or_else(|| Refusal::StaleCall(service.to_owned()))?;
        let Some(caller) = self.clients.get(&call.caller) else {
            return Ok(());
        };
        if caller.backlog() > MAX_BACKLOG {
            let why = Refusal::CallerBusy(call.service.to_string());
            self.answer_forwarded(&call, &why);
            return Ok(());
        }
        let frame = encode(&call.service, call.id.as_deref());
        if call.share.resize(frame.len(), Claim::Ordinary) {
            caller.pass(call.share.cover(frame), None);
            self.note_answered(call.caller);
        } else {
            self.answer_forwarded(&call, &Refusal::NoRoom);
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
fn is_listened_to(topic: Topic) -> bool {
    topic.direction() == Direction::Subscribed
}
