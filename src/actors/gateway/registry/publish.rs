//! Published messages: the right to publish, and the fan-out. A message is encoded once for each spelling of its topic
//! and each requested encoding, and is delivered to every subscriber.
//!
//! **Invariant:** without subscribers nothing is encoded. Subscribers that requested the same encoding share the same
//! bytes. A long message delays only its publisher.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;

use super::forms::{Made, ToEncode};
use super::subscriptions::{is_listened_to, refuse_runtime_topic};
use super::topics::Subscriber;
use super::{FrameOrigin, Registry};
use crate::actors::ConnectionId;
use crate::actors::gateway::messages::{Handled, Publish, Tapped, ToClient};
use crate::actors::node::{Done, guard};
use crate::actors::resources::long_work::{WorkKind, run_long_work};
use crate::actors::resources::memory::cover_message;
use crate::actors::wire::TopicMessage;
use crate::protocol::catalog::Topic;
use crate::protocol::messages;
use crate::protocol::names;
use crate::protocol::op::{Compression, Encoding};
use crate::protocol::wire::json::Payload;
use crate::protocol::wire::series::Series;

impl Registry {
    /// Delivers a client's message to the topic's subscribers, and to the runtime's own subscriber if there is one.
    pub(super) fn publish(
        &mut self,
        origin: FrameOrigin,
        topic: &str,
        msg: Payload,
        ctx: &mut Context<Self>,
    ) -> Handled {
        if let Err(why) = refuse_runtime_topic(topic) {
            self.refuse(&origin, &why);
            return Handled::at_once();
        }
        let topic = &*names::absolute(topic);
        let Some(client) = self.clients.get(&origin.from) else {
            return Handled::at_once();
        };
        let listener = Topic::from_name(topic)
            .filter(|topic| is_listened_to(*topic) && !client.withdrawn.contains(topic))
            .and_then(|topic| Some((topic, self.nodes.listeners.get(&topic)?)));
        if listener.is_none() && !client.registered.advertised.contains_key(topic) {
            return Handled::at_once();
        }
        let (done, ended) = guard();
        let encode = |spelling: &str| messages::publish_raw(spelling, &msg);
        let handled = Handled::with(ended).delivered(self.fan_out(topic, Some(&done), encode, ctx));
        let Some((topic, listener)) = listener else {
            return handled;
        };
        if let Some(tap) = &mut self.tap {
            tap(Tapped::NodeMessage(topic, &msg));
        }
        listener(TopicMessage {
            msg,
            respond: ctx.address().recipient(),
            connection: origin.from,
            present: Arc::downgrade(&client.present),
            listening: Arc::downgrade(&client.listening),
            id: origin.id,
            done,
        });
        handled
    }

    /// Delivers messages of a client unchanged, if it advertises the topic.
    pub(super) fn publish_lines(
        &self,
        from: ConnectionId,
        lines: &Series,
        ctx: &mut Context<Self>,
    ) -> Handled {
        let topic = &*lines.topic;
        let client = self.clients.get(&from);
        if client.is_none_or(|client| !client.registered.advertised.contains_key(topic)) {
            return Handled::at_once();
        }
        let (done, ended) = guard();
        let encode = |spelling: &str| messages::respelled(topic, spelling, &lines.frames);
        Handled::with(ended).delivered(self.fan_out(topic, Some(&done), encode, ctx))
    }

    /// Delivers a message, or a series of messages, to every subscriber of `topic`, an absolute name, in all spellings.
    /// `encode` makes the JSON for a spelling. `done` belongs to a publisher that can wait for a worker thread. A node
    /// cannot wait. Returns the number of subscribers.
    fn fan_out(
        &self,
        topic: &str,
        done: Option<&Done>,
        encode: impl Fn(&str) -> Bytes,
        ctx: &mut Context<Self>,
    ) -> usize {
        let subscribers = self.topics.subscribers(topic);
        let mut plain: Vec<(&str, Bytes)> = Vec::new();
        let mut others: Vec<(&str, Bytes, Encoding)> = Vec::new();
        for subscriber in subscribers {
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
            let is_asked = |one: &(&str, Bytes, Encoding)| one.0 == spelling && one.2 == encoding;
            if is_sent_plain(encoding, frame.len()) {
                deliver(subscriber, frame);
            } else if !others.iter().any(is_asked) {
                others.push((spelling, frame, encoding));
            }
        }
        for (spelling, frame, encoding) in others {
            self.deliver_encoded(self.to_encode(spelling, frame, encoding), done, ctx);
        }
        subscribers.len()
    }

    /// Delivers a message in another form. A worker thread encodes a long one first.
    fn deliver_encoded(&self, message: ToEncode, done: Option<&Done>, ctx: &mut Context<Self>) {
        // A node cannot wait, and its messages are short.
        if done.is_none() || !message.is_long() {
            return self.deliver_made(&message, &message.make());
        }
        let done = done.cloned();
        let kind = WorkKind::of(message.plain.len());
        let making = run_long_work(kind, move || (message.make(), message));
        ctx.spawn(making.into_actor(self).map(move |made, registry, _| {
            if let Some((made, message)) = made {
                registry.deliver_made(&message, &made);
            }
            drop(done);
        }));
    }

    /// Delivers a message in one form to the subscribers that requested that form.
    fn deliver_made(&self, message: &ToEncode, made: &Made) {
        let topic = names::absolute(&message.spelling);
        for subscriber in self.subscribers_as(&topic, &message.spelling) {
            if subscriber.encoding == message.encoding {
                self.deliver_form(subscriber, made);
            }
        }
    }

    /// The subscribers to `topic`, an absolute name, under this spelling.
    fn subscribers_as(&self, topic: &str, spelling: &str) -> impl Iterator<Item = &Subscriber> {
        let subscribers = self.topics.subscribers(topic).iter();
        subscribers.filter(move |one| *one.spelling == *spelling)
    }

    /// Delivers the messages of a form. Messages that could not be made count as dropped.
    fn deliver_form(&self, subscriber: &Subscriber, made: &Made) {
        self.gauges.add_dropped(made.lost);
        for frame in &made.messages {
            deliver(subscriber, frame.clone());
        }
    }

    /// Delivers a latched topic's last message to a new subscription.
    pub(super) fn deliver_latched(&self, spelling: &str, to: ConnectionId) {
        let latched = Topic::from_name(spelling).map(|topic| (topic, self.latched.get(&topic)));
        let Some((topic, Some(frame))) = latched else {
            return;
        };
        let mut subscribers = self.subscribers_as(topic.name(), spelling);
        if let Some(subscriber) = subscribers.find(|one| one.connection == to) {
            let plain = messages::respelled(topic.name(), spelling, frame);
            if is_sent_plain(subscriber.encoding, plain.len()) {
                return deliver(subscriber, plain);
            }
            let message = self.to_encode(spelling, plain, subscriber.encoding);
            self.deliver_form(subscriber, &message.make());
        }
    }

    /// The type of a topic's messages: the runtime's own, or a known type that a client has given.
    pub(super) fn known_type(&self, topic: &str) -> Option<&'static str> {
        match Topic::from_name(topic) {
            Some(topic) => Some(topic.type_name()),
            None => Some(self.topics.known_type(&names::absolute(topic))?.name),
        }
    }

    /// A JSON frame, or a series of frames, to encode in another form.
    fn to_encode(&self, spelling: &str, plain: Bytes, encoding: Encoding) -> ToEncode {
        ToEncode {
            spelling: spelling.into(),
            plain,
            encoding,
            type_name: self.known_type(spelling),
            fragmented: Arc::clone(&self.fragmented),
            permit: self.permit.clone(),
        }
    }
}

impl Handler<Publish> for Registry {
    type Result = ();

    /// Delivers a message of a node. Stores it if its topic is latched.
    fn handle(&mut self, Publish { topic, frame }: Publish, ctx: &mut Context<Self>) {
        let name = topic.name();
        if !self.is_wanted(name) {
            return;
        }
        let frame = frame();
        if let Some(tap) = &mut self.tap {
            tap(Tapped::Published(topic, &frame));
        }
        let encode = |spelling: &str| messages::respelled(name, spelling, &frame);
        self.fan_out(name, None, encode, ctx);
        if topic.is_latched() {
            self.latched.insert(topic, frame);
        }
    }
}

/// Whether frames of `length` bytes are sent unchanged to a subscriber that requested `encoding`.
fn is_sent_plain(encoding: Encoding, length: usize) -> bool {
    let is_short = encoding.fragment_size.is_none_or(|size| length <= size);
    encoding.compression == Compression::None && is_short && !encoding.ros1_stamps
}

fn deliver(subscriber: &Subscriber, frame: Bytes) {
    let topic = Some(Arc::clone(&subscriber.spelling));
    subscriber
        .mailbox
        .do_send(ToClient::Deliver { topic, frame });
}
