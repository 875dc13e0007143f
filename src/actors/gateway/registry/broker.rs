//! Advertisements and subscriptions of clients, and published messages: to the subscribers of their topic. A message is
//! encoded once for each spelling of its topic and each requested encoding. `actors/graph/forms.rs` encodes.
//!
//! **Invariant:** the node that publishes a topic is notified of its first subscriber and of the end of its last one.
//! Without subscribers nothing is encoded. Subscribers that requested the same encoding share the same bytes.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use super::clients::{Clients, FrameOrigin};
use super::messages::ToClient;
use crate::actors::ConnectionId;
use crate::actors::gateway::limits::MAX_LONG_FORMS;
use crate::actors::graph::forms::{Made, ToEncode};
use crate::actors::graph::refusal::{self, Refusal};
use crate::actors::graph::subscribers::{self, Subscription};
use crate::actors::graph::topics::Topics;
use crate::actors::node::{Interest, Publish, Tap, Tapped};
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::memory::{Permit, cover_message};
use crate::protocol::catalog::{Topic, types};
use crate::protocol::limits::MEDIUM;
use crate::protocol::messages::{self, Level};
use crate::protocol::names;
use crate::protocol::op::{Compression, Subscribe};
use crate::protocol::outbox::Throttle;
use crate::protocol::wire::json::Payload;
use crate::protocol::wire::series::Series;

/// The topics with their publishers and subscribers.
#[derive(Default)]
pub(super) struct Broker {
    pub(super) topics: Topics<Recipient<ToClient>>,
    /// The last message of each latched topic that has subscribers.
    latched: HashMap<Topic, Bytes>,
    /// Number of messages sent in fragments. It is part of the fragments' ids.
    fragmented: Arc<AtomicU64>,
    /// The node that publishes each of the runtime's topics.
    pub(super) owners: HashMap<Topic, Recipient<Interest>>,
    /// Passes messages and calls to the recorder, while it records.
    tap: Option<Tap>,
    pub(super) gauges: Arc<Gauges>,
}

/// A subscriber, with the mailbox of its connection.
type Subscriber = subscribers::Subscriber<Recipient<ToClient>>;

impl Broker {
    // ---- advertisements and subscriptions ---------------------------------------------------------------------------

    pub(super) fn advertise(
        &mut self,
        clients: &mut Clients,
        origin: &FrameOrigin,
        topic: &str,
        type_name: Option<&str>,
    ) -> Result<(), Refusal> {
        let own = refusal::check_published(topic)?;
        let topic = &*names::absolute(topic);
        let Some(client) = clients.get_mut(origin.from) else {
            return Ok(());
        };
        let before = client.registered.advertised.get(topic);
        let bytes = topic.len() + type_name.map_or(0, str::len);
        let entry = client.entries.enter(bytes, before)?;
        if before.is_none() {
            self.topics.add_publisher(topic);
        }
        if let Some(type_name) = type_name {
            self.topics.note_type(topic, type_name);
        }
        client.registered.advertised.insert(topic.into(), entry);
        if let Some(own) = own {
            client.withdrawn.remove(&own);
        }
        Ok(())
    }

    pub(super) fn unadvertise(&mut self, clients: &mut Clients, origin: &FrameOrigin, topic: &str) {
        let Some(client) = clients.get_mut(origin.from) else {
            return;
        };
        let topic = &*names::absolute(topic);
        if client.registered.advertised.remove(topic).is_some() {
            self.topics.remove_publisher(topic);
        }
        if let Some(topic) = Topic::from_name(topic).filter(|topic| topic.is_subscribed()) {
            client.withdrawn.insert(topic);
        }
    }

    pub(super) fn subscribe(
        &mut self,
        clients: &mut Clients,
        origin: &FrameOrigin,
        subscribe: &Subscribe,
    ) -> Result<(), Refusal> {
        let topic = subscribe.topic.as_str();
        let own = || subscribe.type_name.as_deref().and_then(types::find);
        if subscribe.encoding.compression == Compression::CborRaw
            && self.topics.known_type(topic).is_none()
            && own().is_none()
        {
            return Err(Refusal::UnknownType);
        }
        let is_first = !self.is_wanted(&names::absolute(topic));
        let is_new = self.add_subscription(clients, origin, subscribe)?;
        // Sent first, so that the client gets the status before the first message.
        let msg = format!("subscribed to {topic}");
        clients.send_status(origin, Level::Info, &msg);
        if is_first {
            self.notify_owner(topic, true);
        } else if is_new {
            self.deliver_latched(topic, origin.from);
        }
        Ok(())
    }

    /// Adds a subscription, or replaces the one with its id. Returns whether it is new.
    fn add_subscription(
        &mut self,
        clients: &mut Clients,
        origin: &FrameOrigin,
        subscribe: &Subscribe,
    ) -> Result<bool, Refusal> {
        let id: Option<Box<str>> = origin.id.as_ref().map(|id| id.get().into());
        let topic = subscribe.topic.as_str();
        let absolute = names::absolute(topic);
        let bytes = [id.as_deref(), subscribe.type_name.as_deref()];
        let bytes: usize = bytes.into_iter().flatten().map(str::len).sum();
        let Some(client) = clients.get_mut(origin.from) else {
            return Ok(false);
        };
        let known = self.topics.subscriber(&absolute, topic, origin.from);
        let before = known
            .as_ref()
            .and_then(|one| one.subscription(id.as_deref()));
        let is_new = before.is_none();
        let instead = before.map(|one| &one.entry);
        let entry = client.entries.enter(topic.len() + bytes, instead)?;
        let subscription = Subscription::new(id.clone(), subscribe, entry);
        if known.is_none() {
            let spelling: Arc<str> = topic.into();
            client.registered.subscribed.insert(Arc::clone(&spelling));
            let mailbox = client.outlets.mailbox.clone();
            let topics = &mut self.topics;
            topics.add_subscriber(&absolute, spelling, origin.from, mailbox);
        }
        if let Some(type_name) = subscribe.type_name.as_deref() {
            self.topics.note_type(&absolute, type_name);
        }
        if let Some(subscriber) = self.topics.subscriber(&absolute, topic, origin.from) {
            subscriber.change(|one| one.id != id, Some(subscription));
            if is_new && Topic::from_name(topic).is_some_and(Topic::is_latched) {
                // The throttle of an earlier subscription must not delay this one's latched message, which replaces the
                // held one.
                configure(subscriber, None);
            }
            configure(subscriber, subscriber.throttle());
        }
        Ok(is_new)
    }

    pub(super) fn unsubscribe(&mut self, clients: &mut Clients, origin: &FrameOrigin, topic: &str) {
        let absolute = names::absolute(topic);
        let subscriber = self.topics.subscriber(&absolute, topic, origin.from);
        let Some(subscriber) = subscriber else {
            return;
        };
        let ended = origin.id.as_ref().map(Payload::get);
        subscriber.change(|one| ended.is_some() && one.id.as_deref() != ended, None);
        let throttle = subscriber.throttle();
        configure(subscriber, throttle);
        if throttle.is_none() {
            if let Some(client) = clients.get_mut(origin.from) {
                client.registered.subscribed.remove(topic);
            }
            self.drop_subscriber(clients, topic, origin.from);
        }
    }

    /// Whether the topic has a subscriber or a tap. `topic` is an absolute name.
    fn is_wanted(&self, topic: &str) -> bool {
        self.tap.is_some() || !self.topics.subscribers(topic).is_empty()
    }

    /// Notes that the topic's last subscriber has gone.
    fn note_unwanted(&mut self, topic: &str) {
        if let Some(topic) = Topic::from_name(topic) {
            self.latched.remove(&topic);
        }
        self.notify_owner(topic, false);
    }

    fn notify_owner(&self, topic: &str, wanted: bool) {
        if let Some(topic) = Topic::from_name(topic)
            && let Some(owner) = self.owners.get(&topic)
        {
            owner.do_send(Interest { topic, wanted });
        }
    }

    /// Removes a subscriber from a topic, and notifies the topic's owner if it was the last one.
    pub(super) fn drop_subscriber(
        &mut self,
        clients: &mut Clients,
        topic: &str,
        connection: ConnectionId,
    ) {
        let name = names::absolute(topic);
        self.topics.remove_subscriber(&name, topic, connection);
        if let Some(client) = clients.get_mut(connection)
            && Topic::from_name(&name) == Some(Topic::TfWebFeedback)
            && !names::spellings(&name).any(|one| client.registered.subscribed.contains(one))
        {
            client.listening = Arc::default();
        }
        if !self.is_wanted(&name) {
            self.note_unwanted(&name);
        }
    }

    // ---- messages ---------------------------------------------------------------------------------------------------

    /// Delivers a message of a node. Stores it if its topic is latched. Messages that it outdates are discarded even
    /// if nobody subscribes to it, because an answer may follow.
    pub(super) fn publish(&mut self, Publish { topic, frame }: Publish) {
        let name = topic.name();
        let outdated = topic.supersedes().iter();
        for subscriber in outdated.flat_map(|one| self.topics.subscribers(one)) {
            discard_held(subscriber);
        }
        if !self.is_wanted(name) {
            return;
        }
        let frame = frame();
        self.show_tap(|tap| tap(Tapped::Published(topic, &frame)));
        let encode = |spelling: &str| messages::respelled(name, spelling, &frame);
        // A node cannot wait, and its messages are short.
        for message in self.fan_out(name, None, encode) {
            self.deliver_made(&message, &message.make());
        }
        if topic.is_latched() {
            self.latched.insert(topic, frame);
        }
    }

    /// Delivers messages of a client unchanged, if it advertises the topic. Returns the long ones that are still to be
    /// encoded.
    pub(super) fn publish_lines(
        &self,
        clients: &Clients,
        from: ConnectionId,
        lines: &Series,
    ) -> Vec<ToEncode> {
        let topic = &*lines.topic;
        let client = clients.get(from);
        if client.is_none_or(|client| !client.registered.advertised.contains_key(topic)) {
            return Vec::new();
        }
        let encode = |spelling: &str| messages::respelled(topic, spelling, &lines.frames);
        self.fan_out(topic, clients.permit.as_ref(), encode)
    }

    /// Delivers a message, or a series of messages, to every subscriber of `topic`, an absolute name, in all spellings.
    /// `encode` makes the JSON for a spelling. All forms share the `permit` of a long frame. Returns the long messages
    /// that are still to be encoded in other forms.
    pub(super) fn fan_out(
        &self,
        topic: &str,
        permit: Option<&Permit>,
        encode: impl Fn(&str) -> Bytes,
    ) -> Vec<ToEncode> {
        let now = Instant::now();
        let mut plain: Vec<(&str, Bytes)> = Vec::new();
        let mut others: Vec<ToEncode> = Vec::new();
        for subscriber in self.topics.subscribers(topic) {
            let (spelling, encoding) = (&*subscriber.spelling, subscriber.encoding);
            let known = plain.iter().find(|(known, _)| *known == spelling);
            let frame = match known {
                Some((_, frame)) => frame.clone(),
                None => {
                    let frame = cover_message(permit, encode(spelling));
                    plain.push((spelling, frame.clone()));
                    frame
                }
            };
            let mut forms = others.iter_mut();
            if encoding.keeps(frame.len()) {
                deliver(subscriber, frame, now);
            } else if let Some(known) = forms.find(|form| form.suits(subscriber)) {
                known.recipients.push(Arc::clone(&subscriber.spelling));
            } else if frame.len() > MEDIUM && plain.len() + others.len() >= MAX_LONG_FORMS {
                self.gauges.add_dropped(1);
            } else {
                others.push(self.to_encode(subscriber, frame, permit));
            }
        }
        let (long, short) = others.into_iter().partition(ToEncode::is_long);
        for message in short {
            self.deliver_made(&message, &message.make());
        }
        long
    }

    /// A JSON frame, or a series of frames, to encode in the form that the subscriber requested.
    fn to_encode(
        &self,
        subscriber: &Subscriber,
        plain: Bytes,
        permit: Option<&Permit>,
    ) -> ToEncode {
        ToEncode {
            spelling: Arc::clone(&subscriber.spelling),
            plain,
            encoding: subscriber.encoding,
            recipients: vec![Arc::clone(&subscriber.spelling)],
            type_name: self.topics.known_type(&subscriber.spelling),
            fragmented: Arc::clone(&self.fragmented),
            permit: permit.cloned(),
        }
    }

    /// Delivers a message in one form to its recipients that are still subscribed, even if they have requested another
    /// form since.
    pub(super) fn deliver_made(&self, message: &ToEncode, made: &Made) {
        let topic = names::absolute(&message.spelling);
        // Both lists have the same order.
        let mut left = self.topics.subscribers(&topic).iter();
        for recipient in &message.recipients {
            let mut rest = left.clone();
            if let Some(subscriber) = rest.find(|one| Arc::ptr_eq(recipient, &one.spelling)) {
                self.deliver_form(subscriber, made);
                left = rest;
            }
        }
    }

    /// Delivers the messages of a form. Messages that could not be made count as dropped.
    fn deliver_form(&self, subscriber: &Subscriber, made: &Made) {
        self.gauges.add_dropped(made.lost);
        let now = Instant::now();
        for frame in &made.messages {
            deliver(subscriber, frame.clone(), now);
        }
    }

    /// Delivers a latched topic's last message to a new subscription.
    fn deliver_latched(&self, spelling: &str, to: ConnectionId) {
        let latched = Topic::from_name(spelling).map(|topic| (topic, self.latched.get(&topic)));
        let Some((topic, Some(frame))) = latched else {
            return;
        };
        let mut all = self.topics.subscribers(topic.name()).iter();
        if let Some(subscriber) = all.find(|one| one.connection == to && *one.spelling == *spelling)
        {
            let plain = messages::respelled(topic.name(), spelling, frame);
            if subscriber.encoding.keeps(plain.len()) {
                return deliver(subscriber, plain, Instant::now());
            }
            let message = self.to_encode(subscriber, plain, None);
            self.deliver_form(subscriber, &message.make());
        }
    }

    // ---- the recorder -----------------------------------------------------------------------------------------------

    /// Shows a message or a call to the tap, if there is one.
    pub(super) fn show_tap(&mut self, show: impl FnOnce(&mut Tap)) {
        self.tap.as_mut().map(show);
    }

    /// Sets or removes the tap. It gets the latched messages first.
    pub(super) fn set_tap(&mut self, tap: Option<Tap>) {
        let was_set = self.tap.is_some();
        self.tap = tap;
        for topic in Topic::ALL {
            if self.topics.subscribers(topic.name()).is_empty() {
                match (was_set, self.tap.is_some()) {
                    (_, true) => self.notify_owner(topic.name(), true),
                    (true, false) => self.note_unwanted(topic.name()),
                    (false, false) => {}
                }
            } else if let (Some(frame), Some(tap)) = (self.latched.get(&topic), &mut self.tap) {
                tap(Tapped::Published(topic, frame));
            }
        }
    }
}

/// Sends a frame to the subscriber's connection.
fn deliver(subscriber: &Subscriber, frame: Bytes, at: Instant) {
    let topic = Some(Arc::clone(&subscriber.spelling));
    let message = ToClient::Deliver { topic, frame, at };
    subscriber.mailbox.do_send(message);
}

/// Sends the throttle of the subscriber's topic to its connection.
fn configure(subscriber: &Subscriber, throttle: Option<Throttle>) {
    let topic = Arc::clone(&subscriber.spelling);
    let message = ToClient::Configure { topic, throttle };
    subscriber.mailbox.do_send(message);
}

/// Discards what a throttle holds back of the subscriber's topic.
fn discard_held(subscriber: &Subscriber) {
    let topic = Arc::clone(&subscriber.spelling);
    subscriber.mailbox.do_send(ToClient::Discard { topic });
}
