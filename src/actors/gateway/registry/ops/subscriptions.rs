//! Subscriptions of clients: how one is taken, changed and ended.
//!
//! **Invariant:** what is refused is answered by an error status, and changes nothing.

use std::sync::Arc;

use super::is_listened_to;
use crate::actors::gateway::messages::{Configure, Throttle};
use crate::actors::gateway::registry::refusal::Refusal;
use crate::actors::gateway::registry::state::{FrameOrigin, Registry};
use crate::actors::gateway::registry::tables::census::Use;
use crate::actors::gateway::registry::tables::topics::{Subscription, throttle_of};
use crate::protocol::catalog::{Topic, types};
use crate::protocol::limits::MAX_NAME;
use crate::protocol::messages::Level;
use crate::protocol::names;
use crate::protocol::op::{Compression, Encoding, Subscribe};
use crate::protocol::ros::stamps::is_ros1_name;

impl Registry {
    pub(crate) fn subscribe(
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
        let client = self.clients.get(&origin.from);
        let before = client.and_then(|client| client.subscription(topic, id.as_deref()));
        let is_new = before.is_none();
        let entry = client.map(|client| {
            let instead = before.map(|one| &one.entry);
            client.kept.enter(topic.len() + bytes, instead)
        });
        let Some(entry) = entry.transpose()? else {
            return Ok(());
        };
        let size = subscribe.encoding.fragment_size.map(|size| {
            let given_up = before.and_then(|one| one.size.as_ref());
            self.topics.share_size(&absolute, size, given_up)
        });
        let first = !self.is_wanted(&absolute);
        let Some(client) = self.clients.get_mut(&origin.from) else {
            return Ok(());
        };
        let (name, new) = self
            .topics
            .add(topic, origin.from, client.outlets.deliver.clone());
        let type_name = subscribe.type_name.as_deref();
        if new {
            self.tally.add(&absolute, Use::Subscribed, type_name);
        } else if let Some(type_name) = type_name {
            self.tally.note_type(&absolute, type_name);
        }
        let subscriptions = client.subscriptions.entry(name.clone()).or_default();
        subscriptions.retain(|one| one.id != id);
        subscriptions.push(Subscription {
            id,
            throttle: subscribe.throttle,
            queue_length: subscribe.queue_length,
            encoding: Encoding {
                fragment_size: size.as_deref().copied(),
                ..encoding_for(subscribe)
            },
            size,
            entry,
        });
        let throttle = throttle_of(subscriptions);
        self.topics.configure(&name, origin.from, subscriptions);
        let shared = Arc::clone(&name);
        if is_new && Topic::from_name(topic).is_some_and(Topic::is_latched) {
            // The throttle of an earlier subscription must not hold back the latched message of this one.
            client.outlets.configure.do_send(Configure {
                topic: Arc::clone(&name),
                throttle: Some(Throttle::NONE),
            });
        }
        client.outlets.configure.do_send(Configure {
            topic: name,
            throttle,
        });
        // The status leaves before the first message: the topic's owner hears of the subscriber after it.
        let msg = format!("subscribed to {topic}");
        self.send_status(origin.from, Level::Info, &msg, origin.id.as_ref());
        if first {
            self.tell_owner(topic, true);
        } else if is_new {
            self.deliver_latched(&shared, origin.from);
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

    pub(crate) fn unsubscribe(&mut self, origin: &FrameOrigin, topic: &str) {
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
        let throttle = throttle_of(&left);
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
}

/// The encoding that a subscription asks for. Stamps have the names of ROS 1 too on a topic of the runtime's own that
/// is asked for by its type of ROS 1. CDR has no names.
fn encoding_for(subscribe: &Subscribe) -> Encoding {
    let own = Topic::from_name(&subscribe.topic).filter(|topic| !is_listened_to(*topic));
    let mut asked = own.zip(subscribe.type_name.as_deref()).into_iter();
    let is_ros1 = asked.any(|(topic, asked)| is_ros1_name(asked, topic.type_name()));
    Encoding {
        ros1_stamps: is_ros1 && subscribe.encoding.compression != Compression::CborRaw,
        ..subscribe.encoding
    }
}
