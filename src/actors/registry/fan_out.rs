//! How a message reaches everybody who subscribes: once encoded for each spelling of the topic and each encoding asked for.
//!
//! **Invariant:** without subscribers nothing is encoded, and all subscribers who asked for the same share the same bytes.

use std::sync::Arc;

use bytes::Bytes;
use serde_json::Value;

use super::Registry;
use super::topics::Subscriber;
use crate::actors::ConnectionId;
use crate::actors::connection::Deliver;
use crate::protocol::catalog::Topic;
use crate::protocol::op::{Compression, Encoding};
use crate::protocol::{cbor, fragments, messages, names, series};

impl Registry {
    /// Delivers a message, or a series of them, to everybody who subscribes to `topic`, an absolute name, under whichever spelling;
    /// `encode` makes the JSON for a spelling.
    pub(super) fn fan_out(&self, topic: &str, encode: impl Fn(&str) -> Bytes) {
        for spelling in names::spellings(topic) {
            let Some((name, subscribers)) = self.topics.subscribers(spelling) else {
                continue;
            };
            let plain = self.count(encode(spelling));
            let mut made: Vec<(Encoding, Vec<Bytes>)> = Vec::new();
            for subscriber in subscribers {
                let encoding = subscriber.encoding;
                if encoding == Encoding::default() && !subscriber.throttled {
                    deliver(subscriber, name, plain.clone());
                    continue;
                }
                if !made.iter().any(|(one, _)| *one == encoding) {
                    let encode = |message: Bytes| self.encoded(name, &message, encoding);
                    made.push((encoding, self.singly(&plain).filter_map(encode).collect()));
                }
                let made = made.iter().find(|(one, _)| *one == encoding);
                for frame in made.into_iter().flat_map(|(_, frames)| frames) {
                    deliver(subscriber, name, frame.clone());
                }
            }
        }
    }

    /// The messages of a series each by itself: who keeps one keeps none of the others in memory.
    fn singly(&self, frames: &Bytes) -> impl Iterator<Item = Bytes> {
        let all = frames.len();
        series::messages(frames.clone()).map(move |message| {
            if message.len() == all {
                return message;
            }
            self.count(Bytes::copy_from_slice(&message))
        })
    }

    /// A latched topic's last message, to a subscriber who came after it.
    pub(super) fn deliver_latched(&self, spelling: &Arc<str>, to: ConnectionId) {
        let latched =
            Topic::from_name(spelling).and_then(|topic| Some((topic, self.latched.get(&topic)?)));
        let subscriber = self
            .topics
            .subscribers(spelling)
            .and_then(|(_, all)| all.iter().find(|one| one.connection == to));
        if let (Some((topic, frame)), Some(subscriber)) = (latched, subscriber) {
            let plain = messages::respelled(topic.name(), spelling, frame);
            if let Some(frame) = self.encoded(spelling, &plain, subscriber.encoding) {
                deliver(subscriber, spelling, frame);
            }
        }
    }

    /// The type of a topic's messages, if anybody has said it.
    pub(super) fn type_of(&self, topic: &str) -> Option<&str> {
        match Topic::from_name(topic) {
            Some(topic) => Some(topic.type_name()),
            None => self.tally.type_of(&names::absolute(topic)),
        }
    }

    /// A JSON frame in another encoding; `None` where it can't be written so.
    fn encoded(&self, spelling: &str, plain: &Bytes, encoding: Encoding) -> Option<Bytes> {
        if encoding.compression == Compression::None {
            return Some(match encoding.fragment_size {
                Some(size) if plain.len() > size => self.count(self.in_fragments(plain, size)),
                _ => plain.clone(),
            });
        }
        let type_name = self.type_of(spelling);
        let msg = messages::message_text(spelling, plain);
        let msg: Value = serde_json::from_slice(msg).ok()?;
        let bytes = match encoding.compression {
            Compression::CborRaw => cbor::publish_raw(spelling, type_name?, &msg)?,
            _ => cbor::publish(spelling, type_name, &msg),
        };
        Some(self.count(Bytes::from(bytes)))
    }

    /// A message to be delivered counts in the total of messages until the last copy is gone.
    pub(super) fn count(&self, frame: Bytes) -> Bytes {
        self.gauges.totals().messages.count(frame)
    }

    fn in_fragments(&self, plain: &Bytes, size: usize) -> Bytes {
        let number = self.fragmented.get() + 1;
        self.fragmented.set(number);
        fragments::split(plain, size, &format!("pendularm:{number}"))
    }
}

fn deliver(subscriber: &Subscriber, topic: &Arc<str>, frame: Bytes) {
    subscriber.outlet.do_send(Deliver {
        topic: Arc::clone(topic),
        frame,
    });
}
