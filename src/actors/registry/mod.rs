//! The registry: every client, topic and service; fans published topics out to subscribed connections, and routes calls.
//!
//! **Invariant:** a message is encoded once, whatever the number of its subscribers, and not at all without any.

mod actions;
mod census;
mod fan_out;
mod messages;
mod ops;
mod refusal;
mod services;
mod topics;

use std::cell::Cell;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use serde_json::value::RawValue;
use tokio::sync::oneshot;

use self::census::{Tally, Use};
use self::messages::TimedOut;
pub use self::messages::{
    Attach, Connect, Disconnect, FinishAll, Handled, Outlets, Progress, Publish, RefuseCalls,
    Refused, Relay, Request, Respond, Retire, TakeCensus,
};
use self::refusal::Refusal;
use self::services::{Forwarded, Services};
pub use self::topics::Throttle;
use self::topics::{Subscription, Topics};
use super::ConnectionId;
use super::budget::{Budget, Claim, Share};
use super::connection::{Answer, Finish, MAX_RESPONSES_WAITING};
use super::follower::ActionRequest;
use super::gauges::Gauges;
use super::node::{Interest, ServiceCall, TopicMessage};
use crate::protocol::catalog::{Action, Service, Topic};
use crate::protocol::messages::{self as frames, Level};
use crate::protocol::names;
use crate::protocol::op::Verbosity;

/// Clients at once; each costs a few kilobytes at rest and at most its outbox under load. Fewer where fewer files may be open.
pub const MAX_CONNECTIONS: usize = 1024;
/// Subscriptions (topic and id) of one connection.
pub const MAX_SUBSCRIPTIONS: usize = 1024;
/// Topics that one connection advertises.
pub const MAX_ADVERTISED: usize = 1024;
/// Services that one connection provides.
pub const MAX_PROVIDED: usize = 256;
/// Calls of one connection that wait for clients to answer.
pub const MAX_WAITING_CALLS: usize = 256;
/// How long a provider may take when its caller does not say.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(10);
/// What a registration takes of the total of names, beside three times its name: its places in the tables.
pub const REGISTRATION_BYTES: usize = 1024;
/// Bytes of responses that may wait for one connection before what other clients send it (calls to it as a provider,
/// answers to its own calls) is refused: it has not been read for long then, but others would go on.
pub const MAX_BACKLOG: usize = 2 * MAX_RESPONSES_WAITING;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The registry actor.
pub struct Registry {
    clients: HashMap<ConnectionId, Client>,
    topics: Topics,
    services: Services,
    nodes: Nodes,
    /// The last message of each latched topic that has subscribers.
    latched: HashMap<Topic, Bytes>,
    /// Messages that went out in fragments so far: their numbers make the fragments' ids.
    fragmented: Cell<u64>,
    /// What clients use and provide, for those who ask what there is.
    tally: Tally,
    gauges: Arc<Gauges>,
    /// Clients at once.
    max_connections: usize,
    connections_made: u64,
    /// Why no call is taken any more, once the runtime is ending.
    closed: Option<&'static str>,
}

/// What the registry knows of one client.
struct Client {
    outlets: Outlets,
    /// The total that what it is sent counts in.
    responses: Budget,
    /// Topics, each with its share of the total of names.
    advertised: HashMap<Box<str>, Share>,
    /// Topics that the runtime listens to and that this client has explicitly unadvertised: its messages there are
    /// dropped until it advertises again.
    withdrawn: HashSet<Topic>,
    subscriptions: HashMap<Arc<str>, Vec<Subscription>>,
    provided: HashMap<Box<str>, Share>,
    /// Which statuses it wants.
    verbosity: Verbosity,
    /// Dropped once no call of this client waits any more, if it has stopped sending.
    answered: Option<oneshot::Sender<()>>,
}

/// The runtime's own nodes: who serves, listens and publishes what.
#[derive(Default)]
pub struct Nodes {
    /// The node that answers each service.
    pub services: HashMap<Service, Recipient<ServiceCall>>,
    /// The node that pursues the goals of each action.
    pub actions: HashMap<Action, Recipient<ActionRequest>>,
    /// The node that listens to each topic the runtime subscribes to.
    pub listeners: HashMap<Topic, Recipient<TopicMessage>>,
    /// The node that publishes each of the runtime's topics.
    pub publishers: HashMap<Topic, Recipient<Interest>>,
}

impl Registry {
    /// A registry without nodes; they come with [`Attach`].
    #[must_use]
    pub fn new(gauges: Arc<Gauges>) -> Self {
        Self {
            clients: HashMap::new(),
            topics: Topics::default(),
            services: Services::default(),
            nodes: Nodes::default(),
            latched: HashMap::new(),
            fragmented: Cell::new(0),
            tally: Tally::default(),
            gauges,
            max_connections: MAX_CONNECTIONS,
            connections_made: 0,
            closed: None,
        }
    }

    /// The same for at most so many clients at once.
    #[must_use]
    pub fn serving_at_most(self, max_connections: usize) -> Self {
        Self {
            max_connections,
            ..self
        }
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl Actor for Registry {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Handler<Attach> for Registry {
    type Result = ();

    fn handle(&mut self, Attach(nodes): Attach, _: &mut Context<Self>) {
        self.nodes = nodes;
    }
}

impl Handler<Connect> for Registry {
    type Result = Result<ConnectionId, Refused>;

    fn handle(&mut self, Connect(outlets): Connect, _: &mut Context<Self>) -> Self::Result {
        if self.closed.is_some() {
            return Err(Refused::Closed);
        }
        if self.clients.len() >= self.max_connections {
            return Err(Refused::Full(self.max_connections));
        }
        self.connections_made += 1;
        let id = ConnectionId(self.connections_made);
        let responses = self.gauges.totals().responses.clone();
        self.clients.insert(id, Client::new(outlets, responses));
        self.gauges.set_connections(self.clients.len() as u64);
        Ok(id)
    }
}

impl Handler<Retire> for Registry {
    type Result = Handled;

    fn handle(&mut self, Retire(id): Retire, _: &mut Context<Self>) -> Handled {
        self.withdraw(id);
        if self.services.waiting_for(id) == 0 {
            return Handled(None);
        }
        let (answered, all_answered) = oneshot::channel();
        if let Some(client) = self.clients.get_mut(&id) {
            client.answered = Some(answered);
        }
        Handled(Some(all_answered))
    }
}

impl Handler<Disconnect> for Registry {
    type Result = ();

    fn handle(&mut self, Disconnect(id): Disconnect, _: &mut Context<Self>) {
        self.withdraw(id);
        self.services.forget_caller(id);
        if let Some(client) = self.clients.remove(&id) {
            client.outlets.gone.store(true, Ordering::Relaxed);
            self.gauges.set_connections(self.clients.len() as u64);
        }
    }
}

impl Handler<Request> for Registry {
    type Result = Handled;

    fn handle(&mut self, request: Request, ctx: &mut Context<Self>) -> Handled {
        if !self.clients.contains_key(&request.from) {
            return Handled(None);
        }
        self.perform(request, ctx)
    }
}

impl Handler<Relay> for Registry {
    type Result = ();

    fn handle(&mut self, Relay { from, series }: Relay, _: &mut Context<Self>) {
        let topic = &*series.topic;
        let client = self.clients.get(&from);
        if client.is_some_and(|client| client.advertised.contains_key(topic)) {
            self.fan_out(topic, |spelling| {
                frames::respelled(topic, spelling, &series.frames)
            });
        }
    }
}

impl Handler<Publish> for Registry {
    type Result = ();

    fn handle(&mut self, message: Publish, _: &mut Context<Self>) {
        let topic = message.topic.name();
        self.fan_out(topic, |spelling| {
            frames::respelled(topic, spelling, &message.frame)
        });
        if message.topic.is_latched() && self.topics.has_subscribers(topic) {
            self.latched.insert(message.topic, message.frame);
        }
        if let Some(msg) = message.msg
            && let Some(listener) = self.nodes.listeners.get(&message.topic)
        {
            listener.do_send(TopicMessage { msg, sender: None });
        }
    }
}

impl Handler<Respond> for Registry {
    type Result = ();

    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        if let Some(client) = self.clients.get(&respond.connection)
            && respond
                .status
                .is_none_or(|level| client.verbosity.wants(level))
        {
            if respond.service.is_some() {
                // A `Reply` has counted it.
                client.pass(respond.frame, respond.service);
            } else {
                client.send(respond.frame, None);
            }
        }
    }
}

impl Handler<TakeCensus> for Registry {
    type Result = MessageResult<TakeCensus>;

    fn handle(&mut self, _: TakeCensus, _: &mut Context<Self>) -> Self::Result {
        MessageResult(self.tally.take())
    }
}

impl Handler<RefuseCalls> for Registry {
    type Result = ();

    fn handle(&mut self, RefuseCalls(why): RefuseCalls, _: &mut Context<Self>) {
        self.closed = Some(why);
        for call in self.services.take_all() {
            self.answer_forwarded(&call, &Refusal::Closed(why));
        }
    }
}

impl Handler<FinishAll> for Registry {
    type Result = ();

    fn handle(&mut self, _: FinishAll, _: &mut Context<Self>) {
        for client in self.clients.values() {
            client.outlets.finish.do_send(Finish);
        }
    }
}

impl Handler<TimedOut> for Registry {
    type Result = ();

    fn handle(&mut self, TimedOut(number): TimedOut, _: &mut Context<Self>) {
        if let Some(call) = self.services.take(number) {
            let why = Refusal::TimedOut(call.service.to_string());
            self.answer_forwarded(&call, &why);
        }
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl Client {
    fn new(outlets: Outlets, responses: Budget) -> Self {
        Self {
            outlets,
            responses,
            advertised: HashMap::new(),
            withdrawn: HashSet::new(),
            subscriptions: HashMap::new(),
            provided: HashMap::new(),
            verbosity: Verbosity::ALL,
            answered: None,
        }
    }

    /// Sends a response or a status.
    fn send(&self, frame: Bytes, service: Option<Service>) {
        self.pass(self.responses.count(frame), service);
    }

    /// The same with one that has been counted already.
    fn pass(&self, frame: Bytes, service: Option<Service>) {
        self.outlets.answer.do_send(Answer { frame, service });
    }

    /// Bytes of responses that it has not taken yet.
    fn backlog(&self) -> usize {
        self.outlets.backlog.load(Ordering::Relaxed)
    }
}

impl Registry {
    /// Withdraws all that a client has registered, and fails the calls that wait for it as provider.
    fn withdraw(&mut self, id: ConnectionId) {
        let Some(client) = self.clients.get_mut(&id) else {
            return;
        };
        let advertised = std::mem::take(&mut client.advertised);
        let subscriptions = std::mem::take(&mut client.subscriptions);
        let provided = std::mem::take(&mut client.provided);
        for topic in advertised.keys() {
            self.tally.remove(topic, Use::Advertised);
        }
        for topic in subscriptions.keys() {
            self.drop_subscriber(topic, id);
        }
        for service in provided.keys() {
            self.withdraw_service(service, id);
        }
        for call in self.services.take_provided_by(id) {
            let why = Refusal::ProviderGone(call.service.to_string());
            self.answer_forwarded(&call, &why);
        }
    }

    /// Takes `connection` off a topic's list, and tells the topic's owner when that was the last one.
    fn drop_subscriber(&mut self, topic: &Arc<str>, connection: ConnectionId) {
        let name = names::absolute(topic);
        self.topics.remove(topic, connection);
        self.tally.remove(&name, Use::Subscribed);
        if !self.topics.has_subscribers(&name) {
            if let Some(topic) = Topic::from_name(topic) {
                self.latched.remove(&topic);
            }
            self.tell_owner(topic, false);
        }
    }

    /// Withdraws a service by its absolute name, if `connection` is its provider; true if it was.
    fn withdraw_service(&mut self, service: &str, connection: ConnectionId) -> bool {
        let provided = self.services.withdraw(service, connection);
        if provided {
            self.tally.withdraw(service);
        }
        provided
    }

    /// A registration's share of the total of names.
    fn name_share(&self, bytes: usize) -> Result<Share, Refusal> {
        let bytes = REGISTRATION_BYTES + 3 * bytes;
        let share = self.gauges.totals().names.take(bytes, Claim::Last);
        share.ok_or(Refusal::TooManyNames)
    }

    fn tell_owner(&self, topic: &str, wanted: bool) {
        if let Some(topic) = Topic::from_name(topic)
            && let Some(owner) = self.nodes.publishers.get(&topic)
        {
            owner.do_send(Interest { topic, wanted });
        }
    }

    /// The flag that computations for a client look at.
    fn gone(&self, id: ConnectionId) -> Arc<AtomicBool> {
        self.clients
            .get(&id)
            .map_or_else(Arc::default, |client| Arc::clone(&client.outlets.gone))
    }

    fn send_status(&self, to: ConnectionId, level: Level, msg: &str, id: Option<&RawValue>) {
        if level == Level::Error {
            tracing::debug!(connection = to.0, why = msg, "refused");
        }
        if let Some(client) = self.clients.get(&to)
            && client.verbosity.wants(level)
        {
            client.send(frames::status(level, msg, id), None);
        }
    }

    /// Fails a forwarded call.
    fn answer_forwarded(&mut self, call: &Forwarded, why: &Refusal) {
        self.send_response(call.caller, &call.service, call.id.as_deref(), why);
        self.note_answered(call.caller);
    }

    /// A call of `caller` has been answered: if it was the last one, a client that has stopped sending may go.
    fn note_answered(&mut self, caller: ConnectionId) {
        if self.services.waiting_for(caller) == 0
            && let Some(client) = self.clients.get_mut(&caller)
        {
            client.answered = None;
        }
    }

    /// Answers a call with `result: false`.
    fn send_response(&self, to: ConnectionId, service: &str, id: Option<&RawValue>, why: &Refusal) {
        if let Some(client) = self.clients.get(&to) {
            let frame = frames::failure(service, id, &why.to_string());
            client.send(frame, Service::from_name(service));
        }
    }
}
