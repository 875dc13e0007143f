//! Advertisements and subscriptions of clients, and the tap of the recorder.
//!
//! **Invariant:** a refused op changes nothing. The node that publishes a topic is notified of its first subscriber and
//! of the end of its last one.

use std::sync::Arc;

use actix::prelude::*;

use super::{FrameOrigin, Registry, Subscriber, ToClient};
use crate::actors::ConnectionId;
use crate::actors::graph::refusal::{self, Refusal};
use crate::actors::graph::subscribers::Subscription;
use crate::actors::node::{Interest, SetTap, Tapped};
use crate::protocol::catalog::Topic;
use crate::protocol::catalog::types;
use crate::protocol::messages::Level;
use crate::protocol::names;
use crate::protocol::op::{Compression, Subscribe};
use crate::protocol::outbox::Throttle;
use crate::protocol::wire::json::Payload;

impl Registry {
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
    pub(super) fn is_wanted(&self, topic: &str) -> bool {
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

/// Sends the throttle of the subscriber's topic to its connection.
fn configure(subscriber: &Subscriber, throttle: Option<Throttle>) {
    let topic = Arc::clone(&subscriber.spelling);
    let message = ToClient::Configure { topic, throttle };
    subscriber.mailbox.do_send(message);
}

/// Discards what a throttle holds back of the subscriber's topic.
pub(super) fn discard_held(subscriber: &Subscriber) {
    let topic = Arc::clone(&subscriber.spelling);
    subscriber.mailbox.do_send(ToClient::Discard { topic });
}
