//! Published messages: to the subscribers of their topic, and to the node that subscribes to it. A message is encoded
//! once for each spelling of its topic and each requested encoding.
//!
//! **Invariant:** without subscribers nothing is encoded. Subscribers that requested the same encoding share the same
//! bytes. A long message delays only its publisher.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use super::subscriptions::discard_held;
use super::{FrameOrigin, Handled, Registry, Subscriber, ToClient};
use crate::actors::ConnectionId;
use crate::actors::gateway::limits::MAX_LONG_FORMS;
use crate::actors::graph::forms::ToEncode;
use crate::actors::graph::refusal;
use crate::actors::node::{Publish, Tapped, TopicMessage, guard};
use crate::actors::resources::memory::cover_message;
use crate::protocol::limits::MEDIUM;
use crate::protocol::messages;
use crate::protocol::names;
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
        let own = match refusal::check_published(topic) {
            Ok(own) => own,
            Err(why) => {
                self.refuse(&origin, &why);
                return Handled::at_once();
            }
        };
        let topic = &*names::absolute(topic);
        let Some(client) = self.clients.get(&origin.from) else {
            return Handled::at_once();
        };
        let node = own
            .filter(|topic| !client.withdrawn.contains(topic))
            .and_then(|topic| Some((topic, self.nodes.subscribers.get(&topic)?)));
        if node.is_none() && !client.registered.advertised.contains_key(topic) {
            return Handled::at_once();
        }
        let encode = |spelling: &str| messages::publish_raw(spelling, &msg);
        let long = self.fan_out(topic, encode);
        let Some((topic, node)) = node else {
            return self.finish_delivery(long, ctx);
        };
        let (done, ended) = guard();
        self.encode_on_worker(long, &done, ctx);
        if let Some(tap) = &mut self.tap {
            let frame = messages::publish_raw(topic.name(), &msg);
            tap(Tapped::Published(topic, &frame));
        }
        node(TopicMessage {
            msg,
            link: client.link.clone(),
            listening: Arc::downgrade(&client.listening),
            id: origin.id,
            done,
        });
        Handled::with(ended)
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
    fn finish_delivery(&self, long: Vec<ToEncode>, ctx: &mut Context<Self>) -> Handled {
        if long.is_empty() {
            return Handled::at_once();
        }
        let (done, ended) = guard();
        self.encode_on_worker(long, &done, ctx);
        Handled::with(ended)
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

/// Sends a frame to the subscriber's connection.
pub(super) fn deliver(subscriber: &Subscriber, frame: Bytes, at: Instant) {
    let topic = Some(Arc::clone(&subscriber.spelling));
    let message = ToClient::Deliver { topic, frame, at };
    subscriber.mailbox.do_send(message);
}
