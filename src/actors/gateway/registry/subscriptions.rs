//! Advertisements and subscriptions of clients: how one begins, changes and ends.
//!
//! **Invariant:** a refused op changes nothing.

use std::sync::Arc;

use super::refusal::Refusal;
use super::topics::{Subscriber, Subscription};
use super::{FrameOrigin, Registry};
use crate::protocol::catalog::{Direction, Topic, types};
use crate::protocol::limits::MAX_NAME;
use crate::protocol::messages::Level;
use crate::protocol::names;
use crate::protocol::op::{Compression, Encoding, Subscribe};
use crate::protocol::outbox::Throttle;
use crate::protocol::ros::stamps::is_ros1_name;
use crate::protocol::wire::json::Payload;

impl Registry {
    pub(super) fn advertise(
        &mut self,
        origin: &FrameOrigin,
        topic: &str,
        type_name: Option<&str>,
    ) -> Result<(), Refusal> {
        refuse_runtime_topic(topic)?;
        let topic = &*names::absolute(topic);
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        let before = client.registered.advertised.get(topic);
        let is_new = before.is_none();
        let bytes = topic.len() + type_name.map_or(0, str::len);
        let entry = client.kept.enter(bytes, before)?;
        if is_new {
            self.topics.add_publisher(topic);
        }
        let is_noted = type_name.is_some_and(|name| self.topics.note_type(topic, name));
        if is_new || is_noted {
            client.registered.advertised.insert(topic.into(), entry);
        }
        if let Some(topic) = Topic::from_name(topic) {
            client.withdrawn.remove(&topic);
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
        if let Some(topic) = Topic::from_name(topic).filter(|topic| is_listened_to(*topic)) {
            client.withdrawn.insert(topic);
        }
    }

    pub(super) fn subscribe(
        &mut self,
        origin: &FrameOrigin,
        subscribe: &Subscribe,
    ) -> Result<(), Refusal> {
        let id: Option<Box<str>> = origin.id.as_ref().map(|id| id.get().into());
        self.may_subscribe(id.as_deref(), subscribe)?;
        let topic = subscribe.topic.as_str();
        let absolute = names::absolute(topic);
        let bytes = [id.as_deref(), subscribe.type_name.as_deref()];
        let bytes: usize = bytes.into_iter().flatten().map(str::len).sum();
        let first = !self.is_wanted(&absolute);
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        let known = self.topics.subscriber(&absolute, topic, origin.from);
        let before = known
            .as_ref()
            .and_then(|one| one.subscription(id.as_deref()));
        let is_new = before.is_none();
        let instead = before.map(|one| &one.entry);
        let entry = client.kept.enter(topic.len() + bytes, instead)?;
        let subscription = Subscription {
            id: id.clone(),
            throttle: subscribe.throttle,
            queue_length: subscribe.queue_length,
            encoding: encoding_for(subscribe),
            entry,
        };
        if let Some(known) = known {
            known.change(|one| one.id != id, Some(subscription));
        } else {
            let spelling: Arc<str> = topic.into();
            client.registered.subscribed.insert(Arc::clone(&spelling));
            let mailbox = client.outlets.mailbox.clone();
            let new = Subscriber::new(origin.from, spelling, mailbox, subscription);
            self.topics.add_subscriber(&absolute, new);
        }
        if let Some(type_name) = subscribe.type_name.as_deref() {
            self.topics.note_type(&absolute, type_name);
        }
        if let Some(subscriber) = self.topics.subscriber(&absolute, topic, origin.from) {
            if is_new && Topic::from_name(topic).is_some_and(Topic::is_latched) {
                // The throttle of an earlier subscription must not delay this one's latched message.
                subscriber.configure(Some(Throttle::NONE));
            }
            subscriber.configure(subscriber.throttle());
        }
        // Sent first, so that the client gets the status before the first message.
        let msg = format!("subscribed to {topic}");
        self.send_status(origin.from, Level::Info, &msg, origin.id.as_ref());
        if first {
            self.tell_owner(topic, true);
        } else if is_new {
            self.deliver_latched(topic, origin.from);
        }
        Ok(())
    }

    fn may_subscribe(&self, id: Option<&str>, subscribe: &Subscribe) -> Result<(), Refusal> {
        if id.is_some_and(|id| id.len() > MAX_NAME) {
            return Err(Refusal::LongSubscriptionId(MAX_NAME));
        }
        let topic = subscribe.topic.as_str();
        if subscribe.encoding.compression == Compression::CborRaw {
            let own = || subscribe.type_name.as_deref().and_then(types::find);
            if self.known_type(topic).is_none() && own().is_none() {
                return Err(Refusal::UnknownType);
            }
        }
        Ok(())
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
        subscriber.configure(throttle);
        if throttle.is_none() {
            if let Some(client) = self.clients.get_mut(&origin.from) {
                client.registered.subscribed.remove(topic);
            }
            self.drop_subscriber(topic, origin.from);
        }
    }
}

/// The encoding that a subscription requests. If it names the ROS 1 type of a topic of the runtime, stamps also have
/// the names of ROS 1. CDR has no names.
fn encoding_for(subscribe: &Subscribe) -> Encoding {
    let own = Topic::from_name(&subscribe.topic).filter(|topic| !is_listened_to(*topic));
    let mut asked = own.zip(subscribe.type_name.as_deref()).into_iter();
    let is_ros1 = asked.any(|(topic, asked)| is_ros1_name(asked, topic.type_name()));
    Encoding {
        ros1_stamps: is_ros1 && subscribe.encoding.compression != Compression::CborRaw,
        ..subscribe.encoding
    }
}

/// Refuses the topics that only the runtime may publish.
pub(super) fn refuse_runtime_topic(topic: &str) -> Result<(), Refusal> {
    match Topic::from_name(topic) {
        Some(own) if !is_listened_to(own) => Err(Refusal::RuntimeTopic(topic.to_owned())),
        _ => Ok(()),
    }
}

/// Whether the runtime itself subscribes to the topic.
pub(super) fn is_listened_to(topic: Topic) -> bool {
    topic.direction() == Direction::Subscribed
}
