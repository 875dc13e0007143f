//! Advertisements and subscriptions of clients, the tap of the recorder, and published messages: to the subscribers of
//! their topic, and to the node that subscribes to it. A message is encoded once for each spelling of its topic and each
//! requested encoding. `actors/graph/forms.rs` encodes.
//!
//! **Invariant:** the node that publishes a topic is notified of its first subscriber and of the end of its last one.
//! Without subscribers nothing is encoded. Subscribers that requested the same encoding share the same bytes. A long
//! message is encoded on a worker thread and delays only its publisher.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use super::{FrameOrigin, Registry, Subscriber, ToClient};
use crate::actors::ConnectionId;
use crate::actors::gateway::limits::MAX_LONG_FORMS;
use crate::actors::graph::forms::{Made, ToEncode};
use crate::actors::graph::refusal::{self, Refusal};
use crate::actors::graph::subscribers::Subscription;
use crate::actors::node::{Completion, Interest, Publish, SetTap, Tapped, TopicMessage, Working};
use crate::actors::resources::long_work::{WorkKind, run_long_work};
use crate::actors::resources::memory::cover_message;
use crate::protocol::catalog::{Topic, types};
use crate::protocol::limits::MEDIUM;
use crate::protocol::messages::{self, Level};
use crate::protocol::names;
use crate::protocol::op::{Compression, Subscribe};
use crate::protocol::outbox::Throttle;
use crate::protocol::wire::json::Payload;
use crate::protocol::wire::series::Series;

impl Registry {
    // ---- advertisements and subscriptions ---------------------------------------------------------------------------

    pub(super) fn advertise(
        &mut self,
        origin: &FrameOrigin,
        topic: &str,
        type_name: Option<&str>,
    ) -> Result<(), Refusal> {
        let own = refusal::check_published(topic)?;
        let topic = &*names::absolute(topic);
        let Some(client) = self.clients.get_mut(&origin.from) else {
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

    pub(super) fn unadvertise(&mut self, origin: &FrameOrigin, topic: &str) {
        let Some(client) = self.clients.get_mut(&origin.from) else {
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
        let is_new = self.add_subscription(origin, subscribe)?;
        // Sent first, so that the client gets the status before the first message.
        let msg = format!("subscribed to {topic}");
        self.send_status(origin, Level::Info, &msg);
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
        origin: &FrameOrigin,
        subscribe: &Subscribe,
    ) -> Result<bool, Refusal> {
        let id: Option<Box<str>> = origin.id.as_ref().map(|id| id.get().into());
        let topic = subscribe.topic.as_str();
        let absolute = names::absolute(topic);
        let bytes = [id.as_deref(), subscribe.type_name.as_deref()];
        let bytes: usize = bytes.into_iter().flatten().map(str::len).sum();
        let Some(client) = self.clients.get_mut(&origin.from) else {
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

    pub(super) fn unsubscribe(&mut self, origin: &FrameOrigin, topic: &str) {
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
            if let Some(client) = self.clients.get_mut(&origin.from) {
                client.registered.subscribed.remove(topic);
            }
            self.drop_subscriber(topic, origin.from);
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
            && let Some(owner) = self.nodes.publishers.get(&topic)
        {
            owner.do_send(Interest { topic, wanted });
        }
    }

    /// Removes a subscriber from a topic, and notifies the topic's owner if it was the last one.
    pub(super) fn drop_subscriber(&mut self, topic: &str, connection: ConnectionId) {
        let name = names::absolute(topic);
        self.topics.remove_subscriber(&name, topic, connection);
        if let Some(client) = self.clients.get_mut(&connection)
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

    /// Delivers a client's message to the topic's subscribers, and to the runtime's own subscriber if there is one.
    pub(super) fn publish(
        &mut self,
        origin: FrameOrigin,
        topic: &str,
        msg: Payload,
        ctx: &mut Context<Self>,
    ) -> Completion {
        let own = match refusal::check_published(topic) {
            Ok(own) => own,
            Err(why) => {
                self.refuse(&origin, &why);
                return Completion::at_once();
            }
        };
        let topic = &*names::absolute(topic);
        let Some(client) = self.clients.get(&origin.from) else {
            return Completion::at_once();
        };
        let node = own
            .filter(|topic| !client.withdrawn.contains(topic))
            .and_then(|topic| Some((topic, self.nodes.subscribers.get(&topic)?)));
        if node.is_none() && !client.registered.advertised.contains_key(topic) {
            return Completion::at_once();
        }
        let encode = |spelling: &str| messages::publish_raw(spelling, &msg);
        let long = self.fan_out(topic, encode);
        let Some((topic, node)) = node else {
            return self.finish_delivery(long, ctx);
        };
        let (working, completion) = Completion::pending();
        self.encode_on_worker(long, &working, ctx);
        if let Some(tap) = &mut self.tap {
            let frame = messages::publish_raw(topic.name(), &msg);
            tap(Tapped::Published(topic, &frame));
        }
        node(TopicMessage {
            msg,
            link: client.link.clone(),
            listening: Arc::downgrade(&client.listening),
            id: origin.id,
            working,
        });
        completion
    }

    /// Delivers messages of a client unchanged, if it advertises the topic.
    pub(super) fn publish_lines(
        &self,
        from: ConnectionId,
        lines: &Series,
        ctx: &mut Context<Self>,
    ) -> Completion {
        let topic = &*lines.topic;
        let client = self.clients.get(&from);
        if client.is_none_or(|client| !client.registered.advertised.contains_key(topic)) {
            return Completion::at_once();
        }
        let encode = |spelling: &str| messages::respelled(topic, spelling, &lines.frames);
        self.finish_delivery(self.fan_out(topic, encode), ctx)
    }

    /// Delivers a message, or a series of messages, to every subscriber of `topic`, an absolute name, in all spellings.
    /// `encode` makes the JSON for a spelling. Returns the long messages that are still to be encoded in other forms.
    fn fan_out(&self, topic: &str, encode: impl Fn(&str) -> Bytes) -> Vec<ToEncode> {
        let now = Instant::now();
        let mut plain: Vec<(&str, Bytes)> = Vec::new();
        let mut others: Vec<ToEncode> = Vec::new();
        for subscriber in self.topics.subscribers(topic) {
            let (spelling, encoding) = (&*subscriber.spelling, subscriber.encoding);
            let known = plain.iter().find(|(known, _)| *known == spelling);
            let frame = match known {
                Some((_, frame)) => frame.clone(),
                None => {
                    let frame = cover_message(self.permit.as_ref(), encode(spelling));
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
                others.push(self.to_encode(subscriber, frame));
            }
        }
        let (long, short) = others.into_iter().partition(ToEncode::is_long);
        for message in short {
            self.deliver_made(&message, &message.make());
        }
        long
    }

    /// Ends the delivery of a client's message. The client waits for the encoding of a long one.
    fn finish_delivery(&self, long: Vec<ToEncode>, ctx: &mut Context<Self>) -> Completion {
        if long.is_empty() {
            return Completion::at_once();
        }
        let (working, completion) = Completion::pending();
        self.encode_on_worker(long, &working, ctx);
        completion
    }

    // ---- forms of a message -----------------------------------------------------------------------------------------

    /// A JSON frame, or a series of frames, to encode in the form that the subscriber requested.
    fn to_encode(&self, subscriber: &Subscriber, plain: Bytes) -> ToEncode {
        ToEncode {
            spelling: Arc::clone(&subscriber.spelling),
            plain,
            encoding: subscriber.encoding,
            recipients: vec![Arc::clone(&subscriber.spelling)],
            type_name: self.topics.known_type(&subscriber.spelling),
            fragmented: Arc::clone(&self.fragmented),
            permit: self.permit.clone(),
        }
    }

    /// Encodes long messages on worker threads, and delivers them.
    fn encode_on_worker(&self, long: Vec<ToEncode>, working: &Working, ctx: &mut Context<Self>) {
        for message in long {
            let working = working.clone();
            let kind = WorkKind::of(message.plain.len());
            let count = message.recipients.len() as u64;
            let making = run_long_work(kind, move || (message.make(), message));
            ctx.spawn(making.into_actor(self).map(move |made, registry, _| {
                match made {
                    Some((made, message)) => registry.deliver_made(&message, &made),
                    None => registry.gauges.add_dropped(count),
                }
                drop(working);
            }));
        }
    }

    /// Delivers a message in one form to its recipients that are still subscribed, even if they have requested another
    /// form since.
    fn deliver_made(&self, message: &ToEncode, made: &Made) {
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
            let message = self.to_encode(subscriber, plain);
            self.deliver_form(subscriber, &message.make());
        }
    }
}

impl Handler<Publish> for Registry {
    type Result = ();

    /// Delivers a message of a node. Stores it if its topic is latched. Messages that it outdates are discarded even
    /// if nobody subscribes to it, because an answer may follow.
    fn handle(&mut self, Publish { topic, frame }: Publish, _: &mut Context<Self>) {
        let name = topic.name();
        for subscriber in topic
            .supersedes()
            .iter()
            .flat_map(|one| self.topics.subscribers(one))
        {
            discard_held(subscriber);
        }
        if !self.is_wanted(name) {
            return;
        }
        let frame = frame();
        if let Some(tap) = &mut self.tap {
            tap(Tapped::Published(topic, &frame));
        }
        let encode = |spelling: &str| messages::respelled(name, spelling, &frame);
        // A node cannot wait, and its messages are short.
        for message in self.fan_out(name, encode) {
            self.deliver_made(&message, &message.make());
        }
        if topic.is_latched() {
            self.latched.insert(topic, frame);
        }
    }
}

impl Handler<SetTap> for Registry {
    type Result = ();

    fn handle(&mut self, SetTap(tap): SetTap, _: &mut Context<Self>) {
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
