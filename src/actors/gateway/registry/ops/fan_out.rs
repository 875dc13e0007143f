//! Fan-out: a message is encoded once for each spelling of its topic and each encoding asked for, and goes to every
//! subscriber.
//!
//! **Invariant:** without subscribers nothing is encoded, and all subscribers who asked for the same share the same
//! bytes.

use std::sync::Arc;

use bytes::Bytes;
use tokio::sync::oneshot;

use crate::actors::ConnectionId;
use crate::actors::gateway::encoded::Encoded;
use crate::actors::gateway::messages::{Deliver, Frames, Handled, Publish, Tapped, Underway};
use crate::actors::gateway::registry::state::Registry;
use crate::actors::gateway::registry::tables::topics::Subscriber;
use crate::protocol::catalog::Topic;
use crate::protocol::messages;
use crate::protocol::names;
use crate::protocol::op::{Compression, Encoding};
use crate::protocol::wire::series;

/// Holds a publisher back until its message has been offered to the socket of every subscriber.
#[derive(Default)]
pub(crate) struct Pace {
    underway: Option<(Underway, oneshot::Receiver<()>)>,
    deliveries: usize,
}

impl Pace {
    /// Makes the guard that goes with the message to a subscriber.
    fn underway(&mut self) -> Underway {
        self.deliveries += 1;
        let (underway, _) = self.underway.get_or_insert_with(|| {
            let (underway, end) = oneshot::channel();
            (Arc::new(underway), end)
        });
        Arc::clone(underway)
    }

    /// Has the message's publisher wait for `handled`, and until every subscriber has the message.
    pub(crate) fn and(self, handled: Handled) -> Handled {
        let end = self.underway.map(|(_, end)| end);
        handled.and_by_subscribers(end, self.deliveries)
    }
}

impl Registry {
    /// Delivers a message of a node, and keeps it if its topic is latched.
    pub(crate) fn publish_own(
        &mut self,
        Publish { topic, frame }: Publish,
        pace: Option<&mut Pace>,
    ) {
        let name = topic.name();
        if !self.is_wanted(name) {
            return;
        }
        let frame = frame.write();
        self.tap.pass(Tapped::Published(topic, &frame));
        self.fan_out(name, pace, |spelling| {
            messages::respelled(name, spelling, &frame)
        });
        if topic.is_latched() {
            self.latched.insert(topic, frame);
        }
    }

    /// Delivers a message, or a series of them, to every subscriber of `topic`, an absolute name, whatever its
    /// spelling. `encode` makes the JSON for a spelling. `pace` is for a publisher that can wait; a live arm can't.
    pub(crate) fn fan_out(
        &self,
        topic: &str,
        mut pace: Option<&mut Pace>,
        encode: impl Fn(&str) -> Bytes,
    ) {
        for spelling in names::spellings(topic) {
            let Some((name, subscribers)) = self.topics.subscribers(spelling) else {
                continue;
            };
            let plain = self.count(encode(spelling));
            let is_series = series::first_message(&plain) < plain.len();
            let mut made: Vec<(Encoding, Arc<Encoded>)> = Vec::new();
            for subscriber in subscribers {
                let encoding = subscriber.encoding;
                // Some messages of a series may not be wanted.
                let is_apart = is_series && subscriber.newest.is_some();
                let frames = if !is_apart && is_sent_plain(encoding, &plain) {
                    Frames::Plain(plain.clone())
                } else {
                    let known = made.iter().find(|(one, _)| *one == encoding);
                    let encoded = if let Some((_, encoded)) = known {
                        Arc::clone(encoded)
                    } else {
                        let encoded = Arc::new(self.encoded(name, plain.clone(), encoding));
                        made.push((encoding, Arc::clone(&encoded)));
                        encoded
                    };
                    Frames::Encoded(encoded, subscriber.newest)
                };
                let underway = pace.as_deref_mut().map(Pace::underway);
                deliver(subscriber, name, frames, underway);
            }
        }
    }

    /// Delivers a latched topic's last message to a subscriber who came after it.
    pub(crate) fn deliver_latched(&self, spelling: &Arc<str>, to: ConnectionId) {
        let latched =
            Topic::from_name(spelling).and_then(|topic| Some((topic, self.latched.get(&topic)?)));
        let subscriber = self
            .topics
            .subscribers(spelling)
            .and_then(|(_, all)| all.iter().find(|one| one.connection == to));
        if let (Some((topic, frame)), Some(subscriber)) = (latched, subscriber) {
            let mut plain = messages::respelled(topic.name(), spelling, frame);
            // Under the topic's own name it is one frame for all, else a copy for this one.
            if **spelling != *topic.name() {
                plain = self.count(plain);
            }
            let frames = if is_sent_plain(subscriber.encoding, &plain) {
                Frames::Plain(plain)
            } else {
                let encoded = self.encoded(spelling, plain, subscriber.encoding);
                Frames::Encoded(Arc::new(encoded), subscriber.newest)
            };
            deliver(subscriber, spelling, frames, None);
        }
    }

    /// The type of a topic's messages, if anybody has said it and it is known.
    pub(crate) fn known_type(&self, topic: &str) -> Option<&'static str> {
        match Topic::from_name(topic) {
            Some(topic) => Some(topic.type_name()),
            None => Some(self.tally.known_type(&names::absolute(topic))?.name),
        }
    }

    /// A JSON frame, or a series of them, in another encoding.
    fn encoded(&self, spelling: &Arc<str>, plain: Bytes, encoding: Encoding) -> Encoded {
        let type_name = self.known_type(spelling);
        let counters = (&self.fragmented, self.gauges.memory());
        Encoded::new(spelling, plain, encoding, type_name, counters)
    }

    /// A message that is being delivered counts once, until the last copy is gone.
    pub(crate) fn count(&self, frame: Bytes) -> Bytes {
        self.gauges.memory().count(frame)
    }
}

/// Whether frames are sent as they are to whoever has asked for `encoding`.
fn is_sent_plain(encoding: Encoding, plain: &Bytes) -> bool {
    let size = encoding.fragment_size;
    let is_short = size.is_none_or(|size| plain.len() <= size);
    encoding.compression == Compression::None && is_short && !encoding.ros1_stamps
}

fn deliver(subscriber: &Subscriber, topic: &Arc<str>, frames: Frames, underway: Option<Underway>) {
    subscriber.outlet.do_send(Deliver {
        topic: Arc::clone(topic),
        frames,
        underway,
    });
}
