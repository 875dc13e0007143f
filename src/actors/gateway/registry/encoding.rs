//! Makes each requested form of a message once, and delivers it to all its subscribers. `actors/graph/forms.rs`
//! encodes.
//!
//! **Invariant:** a client's long message is encoded on a worker thread and delays only its publisher.

use std::sync::Arc;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use super::publishing::deliver;
use super::{Registry, Subscriber};
use crate::actors::ConnectionId;
use crate::actors::graph::forms::{Made, ToEncode};
use crate::actors::node::Done;
use crate::actors::resources::long_work::{WorkKind, run_long_work};
use crate::protocol::catalog::Topic;
use crate::protocol::messages;
use crate::protocol::names;

impl Registry {
    /// A JSON frame, or a series of frames, to encode in the form that the subscriber requested.
    pub(super) fn to_encode(&self, subscriber: &Subscriber, plain: Bytes) -> ToEncode {
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
    pub(super) fn encode_on_worker(
        &self,
        long: Vec<ToEncode>,
        done: &Done,
        ctx: &mut Context<Self>,
    ) {
        for message in long {
            let done = Done::clone(done);
            let kind = WorkKind::of(message.plain.len());
            let count = message.recipients.len() as u64;
            let making = run_long_work(kind, move || (message.make(), message));
            ctx.spawn(making.into_actor(self).map(move |made, registry, _| {
                match made {
                    Some((made, message)) => registry.deliver_made(&message, &made),
                    None => registry.gauges.add_dropped(count),
                }
                drop(done);
            }));
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
    pub(super) fn deliver_latched(&self, spelling: &str, to: ConnectionId) {
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
