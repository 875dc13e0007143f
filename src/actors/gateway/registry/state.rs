//! The registry's state: its clients, topics, services and nodes, and what several of its ops do with them.
//!
//! **Invariant:** what a client has registered stands here as long as the client does, and then until the cleanup takes
//! it.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::net::IpAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use actix::SpawnHandle;
use bytes::Bytes;
use tokio::sync::oneshot;
use tokio::time::Instant;

use super::nodes::Nodes;
use super::places::Places;
use super::refusal::Refusal;
use super::tables::action_servers::ActionServers;
use super::tables::census::{Tally, Use};
use super::tables::kept::{Kept, KeptEntry};
use super::tables::pending_cleanup::{PendingCleanup, Registration};
use super::tables::services::{Forwarded, Services};
use super::tables::tap::TapPoint;
use super::tables::topics::{Subscription, Topics};
use crate::actors::ConnectionId;
use crate::actors::gateway::messages::{Outlets, Response};
use crate::actors::node::Interest;
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::memory::{Permit, cover};
use crate::options::DEFAULT_CLIENTS;
use crate::protocol::catalog::{Service, Topic};
use crate::protocol::messages::{self as frames, ErrorForm, Level};
use crate::protocol::names;
use crate::protocol::op::Verbosity;
use crate::protocol::wire::payload::Payload;

/// The registry actor.
pub struct Registry {
    pub(super) clients: HashMap<ConnectionId, Client>,
    pub(super) topics: Topics,
    pub(super) services: Services,
    pub(super) action_servers: ActionServers,
    /// The registrations of clients that have gone, to be cleaned up.
    pub(super) pending_cleanup: PendingCleanup,
    /// When the next cleanup is, and the task that waits for it.
    pub(super) next_cleanup: Option<(Instant, SpawnHandle)>,
    pub(super) nodes: Nodes,
    /// The last message of each latched topic that has subscribers.
    pub(super) latched: HashMap<Topic, Bytes>,
    /// Messages that went out in fragments so far: their numbers make the fragments' ids.
    pub(super) fragmented: Arc<AtomicU64>,
    /// Counts what clients use and provide, for those who ask what there is.
    pub(super) tally: Tally,
    pub(super) gauges: Arc<Gauges>,
    pub(super) places: Places,
    pub(super) connections_made: u64,
    /// Copies what passes to the recorder, while it records.
    pub(super) tap: TapPoint,
    /// Why no call is taken any more, once the runtime is ending.
    pub(super) closed: Option<&'static str>,
    /// The room that the frame takes whose op is being performed, if it is a long one.
    pub(super) permit: Option<Permit>,
}

/// One client, as the registry knows it.
pub(crate) struct Client {
    pub(super) outlets: Outlets,
    /// Its address.
    pub(super) from: IpAddr,
    /// The room of all that follows, and of calls and goals that wait for other clients.
    pub(super) kept: Kept,
    pub(super) advertised: HashMap<Box<str>, KeptEntry>,
    /// Topics that the runtime listens to and that this client has explicitly unadvertised: its messages there are
    /// dropped until it advertises again.
    pub(super) withdrawn: HashSet<Topic>,
    /// Its subscriptions, in order of the topics' names: their owners hear of the client's going in that order.
    pub(super) subscriptions: BTreeMap<Arc<str>, Vec<Subscription>>,
    pub(super) provided: HashMap<Box<str>, KeptEntry>,
    /// Actions that it serves.
    pub(super) served_actions: HashMap<Box<str>, KeptEntry>,
    /// Statuses that it wants.
    pub(super) verbosity: Verbosity,
    /// Ends with the client.
    pub(super) present: Arc<()>,
    /// Ends with the client, and when it unsubscribes from the feedback of goals that it has published.
    pub(super) listening: Arc<()>,
    /// A guard that is dropped once no call of this client waits, if it has stopped sending.
    pub(super) answered: Option<oneshot::Sender<()>>,
}

impl Registry {
    /// A registry without nodes; they come with [`Attach`](super::Attach).
    #[must_use]
    pub fn new(gauges: Arc<Gauges>) -> Self {
        Self {
            clients: HashMap::new(),
            topics: Topics::default(),
            services: Services::default(),
            action_servers: ActionServers::default(),
            pending_cleanup: PendingCleanup::default(),
            next_cleanup: None,
            nodes: Nodes::default(),
            latched: HashMap::new(),
            fragmented: Arc::default(),
            tally: Tally::default(),
            gauges,
            places: Places::of(DEFAULT_CLIENTS),
            connections_made: 0,
            tap: TapPoint::default(),
            closed: None,
            permit: None,
        }
    }

    /// A registry without nodes, for at most so many clients at once.
    #[must_use]
    pub fn serving_at_most(self, clients: usize) -> Self {
        let places = Places::of(clients);
        Self { places, ..self }
    }
}

impl Client {
    pub(super) fn new(outlets: Outlets, from: IpAddr) -> Self {
        Self {
            outlets,
            from,
            kept: Kept::default(),
            advertised: HashMap::new(),
            withdrawn: HashSet::new(),
            subscriptions: BTreeMap::new(),
            provided: HashMap::new(),
            served_actions: HashMap::new(),
            verbosity: Verbosity::ALL,
            present: Arc::default(),
            listening: Arc::default(),
            answered: None,
        }
    }

    /// Sends a status, a forwarded call or another client's response.
    pub(super) fn send(&self, frame: Bytes) {
        self.respond(frame, None);
    }

    /// Sends a response, of one of the runtime's own services if there is one given.
    pub(super) fn respond(&self, frame: Bytes, service: Option<Service>) {
        self.outlets.respond.do_send(Response { frame, service });
    }

    /// Sets the form in which the client is told why a call failed, if one is given.
    pub(super) fn set_error_form(&self, form: Option<ErrorForm>) {
        if let Some(form) = form {
            let wants_text = form == ErrorForm::Text;
            self.outlets.wants_text.store(wants_text, Ordering::Relaxed);
        }
    }

    /// The client's subscription of that `id` to the topic in that spelling.
    pub(super) fn subscription(&self, topic: &str, id: Option<&str>) -> Option<&Subscription> {
        let mut of_topic = self.subscriptions.get(topic)?.iter();
        of_topic.find(|one| one.id.as_deref() == id)
    }

    /// Bytes of responses that it has not taken yet.
    pub(super) fn backlog(&self) -> usize {
        self.outlets.backlog.load(Ordering::Relaxed)
    }
}

impl Registry {
    /// Leaves all that a client has registered to the cleanup, with the calls and goals that wait for its answer.
    pub(super) fn withdraw(&mut self, id: ConnectionId) {
        let Some(client) = self.clients.get_mut(&id) else {
            return;
        };
        let advertised = std::mem::take(&mut client.advertised).into_iter();
        let subscriptions = std::mem::take(&mut client.subscriptions).into_iter();
        let provided = std::mem::take(&mut client.provided).into_iter();
        let served_actions = std::mem::take(&mut client.served_actions).into_iter();
        let registrations = advertised
            .map(|(topic, entry)| Registration::Advertised(topic, entry))
            .chain(subscriptions.map(|(topic, all)| Registration::Subscribed(topic, all)))
            .chain(provided.map(|(service, entry)| Registration::Provided(service, entry)))
            .chain(served_actions.map(|(action, entry)| Registration::ServedAction(action, entry)));
        self.pending_cleanup
            .add_registrations(id, Box::new(registrations));
        let goals = self.action_servers.take_numbers(id);
        let calls = self.services.take_numbers(id);
        self.pending_cleanup.add(goals, calls);
    }

    /// Withdraws one thing that a client had registered.
    pub(super) fn withdraw_one(&mut self, id: ConnectionId, registration: Registration) {
        match registration {
            Registration::Advertised(topic, _entry) => self.tally.remove(&topic, Use::Advertised),
            Registration::Subscribed(topic, _entries) => self.drop_subscriber(&topic, id),
            Registration::Provided(service, _entry) => {
                self.withdraw_service(&service, id);
            }
            Registration::ServedAction(action, _entry) => {
                self.withdraw_action(&action, id);
            }
        }
    }

    /// Forgets a client and everything about it.
    pub(super) fn forget(&mut self, id: ConnectionId) {
        self.withdraw(id);
        self.services.forget_caller(id);
        self.action_servers.forget_sender(id);
        if let Some(client) = self.clients.remove(&id) {
            client.outlets.gone.store(true, Ordering::Relaxed);
            self.gauges.set_connections(self.clients.len() as u64);
        }
    }

    /// Returns the address that has most places, and how many.
    pub(super) fn most_places(&self) -> Option<(IpAddr, usize)> {
        let mut held: BTreeMap<IpAddr, usize> = BTreeMap::new();
        for client in self.clients.values() {
            *held.entry(client.from).or_default() += 1;
        }
        held.into_iter().max_by_key(|(_, held)| *held)
    }

    /// Takes `connection` off a topic's list, and tells the topic's owner when that was the last one.
    pub(super) fn drop_subscriber(&mut self, topic: &Arc<str>, connection: ConnectionId) {
        let name = names::absolute(topic);
        self.topics.remove(topic, connection);
        self.tally.remove(&name, Use::Subscribed);
        if let Some(client) = self.clients.get_mut(&connection)
            && Topic::from_name(&name) == Some(Topic::TfWebFeedback)
            && !names::spellings(&name).any(|one| client.subscriptions.contains_key(one))
        {
            client.listening = Arc::default();
        }
        if !self.topics.has_subscribers(&name) {
            self.topics.forget_sizes(&name);
        }
        if !self.is_wanted(&name) {
            self.note_unwanted(&name);
        }
    }

    /// Withdraws a service by its absolute name, if `connection` is its provider; true if it was.
    pub(super) fn withdraw_service(&mut self, service: &str, connection: ConnectionId) -> bool {
        let provided = self.services.withdraw(service, connection);
        if provided {
            self.tally.withdraw(service);
        }
        provided
    }

    /// The frame, with the room that the long frame takes which it has come of.
    pub(super) fn covered(&self, frame: Bytes) -> Bytes {
        cover(self.permit.as_ref(), frame)
    }

    /// Whether messages on the topic of that absolute name are to be made.
    pub(super) fn is_wanted(&self, topic: &str) -> bool {
        self.tap.is_set() || self.topics.has_subscribers(topic)
    }

    /// Notes that nobody wants messages on that topic any more.
    pub(super) fn note_unwanted(&mut self, topic: &str) {
        if let Some(topic) = Topic::from_name(topic) {
            self.latched.remove(&topic);
        }
        self.tell_owner(topic, false);
    }

    pub(super) fn tell_owner(&self, topic: &str, wanted: bool) {
        if let Some(topic) = Topic::from_name(topic)
            && let Some(owner) = self.nodes.publishers.get(&topic)
        {
            owner.do_send(Interest { topic, wanted });
        }
    }

    pub(super) fn send_status(
        &self,
        to: ConnectionId,
        level: Level,
        msg: &str,
        id: Option<&Payload>,
    ) {
        if level == Level::Error {
            tracing::debug!(connection = to.0, why = msg, "refused");
        }
        if let Some(client) = self.clients.get(&to)
            && client.verbosity.wants(level)
        {
            client.send(frames::status(level, msg, id));
        }
    }

    /// Fails a forwarded call.
    pub(super) fn answer_forwarded(&mut self, call: &Forwarded, why: &Refusal) {
        self.refuse_call(call.caller, &call.service, call.id.as_ref(), why);
        self.note_answered(call.caller);
    }

    /// A call of `caller` has been answered: if it was the last one, a client that has stopped sending may go.
    pub(super) fn note_answered(&mut self, caller: ConnectionId) {
        if self.services.waiting_for(caller) == 0
            && let Some(client) = self.clients.get_mut(&caller)
        {
            client.answered = None;
        }
    }

    /// Answers a call with `result: false`, and why.
    pub(super) fn refuse_call(
        &self,
        to: ConnectionId,
        service: &str,
        id: Option<&Payload>,
        why: &Refusal,
    ) {
        if let Some(client) = self.clients.get(&to) {
            let form = client.outlets.error_form();
            let frame = frames::failure(service, id, &why.to_string(), form);
            client.respond(frame, Service::from_name(service));
        }
    }
}

/// The sender of the frame that is being performed, and the frame's `id`.
pub(crate) struct FrameOrigin {
    pub(super) from: ConnectionId,
    pub(super) id: Option<Payload>,
}
