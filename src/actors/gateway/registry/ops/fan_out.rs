//! Fan-out: a message is encoded once for each spelling of its topic and each encoding asked for, and goes to every
//! subscriber.
//!
//! **Invariant:** without subscribers nothing is encoded, and all subscribers who asked for the same share the same
//! bytes. A message that takes long to encode holds up its publisher alone.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;
use tokio::sync::oneshot;

use crate::actors::ConnectionId;
use crate::actors::gateway::encoded::{Made, ToEncode};
use crate::actors::gateway::messages::{Deliver, DeliveryGuard, Handled, Publish, Tapped};
use crate::actors::gateway::registry::state::Registry;
use crate::actors::gateway::registry::tables::topics::Subscriber;
use crate::actors::resources::aside::{WorkKind, aside};
use crate::actors::resources::memory::cover_message;
use crate::protocol::catalog::Topic;
use crate::protocol::messages;
use crate::protocol::names;
use crate::protocol::op::{Compression, Encoding};

/// Holds a publisher back until its message has been offered to the socket of every subscriber.
#[derive(Default)]
pub(crate) struct Backpressure {
    underway: Option<(DeliveryGuard, oneshot::Receiver<()>)>,
}

impl Backpressure {
    /// Makes the guard that goes with the message to a subscriber.
    fn underway(&mut self) -> DeliveryGuard {
        let (underway, _) = self.underway.get_or_insert_with(|| {
            let (underway, end) = oneshot::channel();
            (Arc::new(underway), end)
        });
        Arc::clone(underway)
    }

    /// Has the message's publisher wait for `handled`, and until every subscriber has the message.
    pub(crate) fn and(self, handled: Handled) -> Handled {
        let end = self.underway.map(|(_, end)| end);
        handled.and_by_subscribers(end)
    }
}

impl Registry {
    /// Delivers a message of a node, and keeps it if its topic is latched.
    pub(crate) fn publish_own(
        &mut self,
        Publish { topic, frame }: Publish,
        ctx: &mut Context<Self>,
    ) {
        let name = topic.name();
        if !self.is_wanted(name) {
            return;
        }
        let frame = frame.write();
        self.tap.pass(Tapped::Published(topic, &frame));
        let encode = |spelling: &str| messages::respelled(name, spelling, &frame);
        self.fan_out(name, None, encode, ctx);
        if topic.is_latched() {
            self.latched.insert(topic, frame);
        }
    }

    /// Delivers a message, or a series of them, to every subscriber of `topic`, an absolute name, whatever its
    /// spelling. `encode` makes the JSON for a spelling. `pace` is for a publisher that can wait; a live arm can't.
    pub(crate) fn fan_out(
        &self,
        topic: &str,
        mut pace: Option<&mut Backpressure>,
        encode: impl Fn(&str) -> Bytes,
        ctx: &mut Context<Self>,
    ) {
        for spelling in names::spellings(topic) {
            let Some((name, subscribers)) = self.topics.subscribers(spelling) else {
                continue;
            };
            let plain = cover_message(self.permit.as_ref(), encode(spelling));
            let mut encodings = Vec::new();
            for subscriber in subscribers {
                if is_sent_plain(subscriber.encoding, &plain) {
                    let underway = pace.as_deref_mut().map(Backpressure::underway);
                    deliver(subscriber, name, plain.clone(), underway);
                } else if !encodings.contains(&subscriber.encoding) {
                    encodings.push(subscriber.encoding);
                }
            }
            if !encodings.is_empty() {
                let message = self.to_encode(name, plain, encodings);
                let underway = pace.as_deref_mut().map(Backpressure::underway);
                self.deliver_encoded(message, underway, ctx);
            }
        }
    }

    /// Delivers a message in other forms, where it takes long once another thread has made them.
    fn deliver_encoded(
        &self,
        message: ToEncode,
        underway: Option<DeliveryGuard>,
        ctx: &mut Context<Self>,
    ) {
        let spelling = Arc::clone(&message.spelling);
        // A node does not wait, and none of its messages is long.
        if underway.is_none() || !message.is_long() {
            return self.deliver_made(&spelling, &message.make(), underway.as_ref());
        }
        let made = aside(WorkKind::writing(message.plain.len()), move || {
            message.make()
        });
        ctx.spawn(made.into_actor(self).map(move |made, registry, _| {
            registry.deliver_made(&spelling, &made.unwrap_or_default(), underway.as_ref());
        }));
    }

    fn deliver_made(
        &self,
        spelling: &str,
        made: &[(Encoding, Made)],
        underway: Option<&DeliveryGuard>,
    ) {
        let Some((name, subscribers)) = self.topics.subscribers(spelling) else {
            return;
        };
        for subscriber in subscribers {
            let of_form = made.iter().find(|(form, _)| *form == subscriber.encoding);
            if let Some((_, made)) = of_form {
                self.deliver_form(subscriber, name, made, underway);
            }
        }
    }

    /// Delivers the forms that could be made of a message. The others count as dropped.
    fn deliver_form(
        &self,
        subscriber: &Subscriber,
        name: &Arc<str>,
        made: &Made,
        underway: Option<&DeliveryGuard>,
    ) {
        self.gauges.add_dropped(made.lost);
        for frame in &made.messages {
            deliver(subscriber, name, frame.clone(), underway.cloned());
        }
    }

    /// Delivers a latched topic's last message for a subscription that came after it.
    pub(crate) fn deliver_latched(&self, spelling: &Arc<str>, to: ConnectionId) {
        let latched =
            Topic::from_name(spelling).and_then(|topic| Some((topic, self.latched.get(&topic)?)));
        let subscriber = self
            .topics
            .subscribers(spelling)
            .and_then(|(_, all)| all.iter().find(|one| one.connection == to));
        if let (Some((topic, frame)), Some(subscriber)) = (latched, subscriber) {
            let plain = messages::respelled(topic.name(), spelling, frame);
            if is_sent_plain(subscriber.encoding, &plain) {
                return deliver(subscriber, spelling, plain, None);
            }
            let message = self.to_encode(spelling, plain, vec![subscriber.encoding]);
            for (_, made) in message.make() {
                self.deliver_form(subscriber, spelling, &made, None);
            }
        }
    }

    /// The type of a topic's messages, if anybody has said it and it is known.
    pub(crate) fn known_type(&self, topic: &str) -> Option<&'static str> {
        match Topic::from_name(topic) {
            Some(topic) => Some(topic.type_name()),
            None => Some(self.tally.known_type(&names::absolute(topic))?.name),
        }
    }

    /// A JSON frame, or a series of them, that is to be made in other forms.
    fn to_encode(&self, spelling: &Arc<str>, plain: Bytes, encodings: Vec<Encoding>) -> ToEncode {
        ToEncode {
            spelling: Arc::clone(spelling),
            plain,
            encodings,
            type_name: self.known_type(spelling).map(Into::into),
            fragmented: Arc::clone(&self.fragmented),
            permit: self.permit.clone(),
        }
    }
}

/// Whether frames are sent as they are to whoever has asked for `encoding`.
fn is_sent_plain(encoding: Encoding, plain: &Bytes) -> bool {
    let size = encoding.fragment_size;
    let is_short = size.is_none_or(|size| plain.len() <= size);
    encoding.compression == Compression::None && is_short && !encoding.ros1_stamps
}

fn deliver(
    subscriber: &Subscriber,
    topic: &Arc<str>,
    frame: Bytes,
    underway: Option<DeliveryGuard>,
) {
    subscriber.outlet.do_send(Deliver {
        topic: Some(Arc::clone(topic)),
        frame,
        underway,
    });
}
