//! Topic messages in the forms that subscribers requested.
//!
//! **Invariant:** a form is made once for all clients.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bytes::Bytes;
use serde_json::value::RawValue;

use super::subscribers::Subscriber;
use crate::actors::resources::long_work::SHORT_WORK;
use crate::actors::resources::memory::{Permit, cover_message};
use crate::protocol::messages;
use crate::protocol::names::own_id;
use crate::protocol::op::{Compression, Encoding};
use crate::protocol::outbox::MAX_MESSAGE;
use crate::protocol::ros::{cbor, stamps};
use crate::protocol::wire::{fragments, lines};

/// The messages in one form.
#[derive(Default)]
pub struct Made {
    /// The encoded messages.
    pub messages: Vec<Bytes>,
    /// Number of messages that could not be made: too long for every outbox, or not of their type.
    pub lost: u64,
}

/// A message, or a series of messages, to encode in another form.
pub struct ToEncode {
    /// The topic, as the subscribers spell it.
    pub spelling: Arc<str>,
    /// The JSON frames.
    pub plain: Bytes,
    /// The form.
    pub encoding: Encoding,
    /// The `spelling` of each subscriber that requested this form when the message was published. It is the
    /// subscriber's own allocation, so one that unsubscribes and subscribes again is another.
    pub recipients: Vec<Arc<str>>,
    /// The type of the topic's messages, if it is known.
    pub type_name: Option<&'static str>,
    /// Number of messages sent in fragments. It is part of the fragments' ids.
    pub fragmented: Arc<AtomicU64>,
    /// The memory permit of a long message. All its forms share it.
    pub permit: Option<Permit>,
}

impl ToEncode {
    /// Whether the subscriber requested this form.
    pub fn suits<M>(&self, subscriber: &Subscriber<M>) -> bool {
        (&*self.spelling, self.encoding) == (&*subscriber.spelling, subscriber.encoding)
    }

    /// Whether it is so long that a worker thread must encode it.
    pub fn is_long(&self) -> bool {
        self.plain.len() > SHORT_WORK
    }

    /// Makes the form.
    pub fn make(&self) -> Made {
        let mut made = Made::default();
        for message in lines::messages(self.plain.clone()) {
            match self.encode(&message) {
                Some(encoded) => {
                    let covered = cover_message(self.permit.as_ref(), encoded);
                    made.messages.push(covered);
                }
                None => made.lost += 1,
            }
        }
        made
    }

    /// Encodes one message. Returns `None` if that is impossible.
    fn encode(&self, message: &Bytes) -> Option<Bytes> {
        let (encoding, spelling, type_name) = (self.encoding, &*self.spelling, self.type_name);
        let renamed = (encoding.ros1_stamps).then(|| stamps::with_ros1_names(message));
        let plain = renamed.as_ref().unwrap_or(message);
        if encoding.compression == Compression::None {
            let size = encoding.fragment_size;
            let Some(size) = size.filter(|size| plain.len() > *size) else {
                let is_part = message.len() < self.plain.len();
                let unchanged = || lines::by_itself(message.clone(), is_part);
                return Some(renamed.unwrap_or_else(unchanged));
            };
            let number = self.fragmented.fetch_add(1, Ordering::Relaxed) + 1;
            return fragments::split(plain, size, &own_id(number), MAX_MESSAGE);
        }
        let msg = messages::message_text(spelling, plain);
        let msg: &RawValue = serde_json::from_slice(msg).ok()?;
        let bytes = match encoding.compression {
            Compression::CborRaw => cbor::publish_raw(spelling, type_name?, msg, MAX_MESSAGE)?,
            _ => cbor::publish(spelling, type_name, msg, MAX_MESSAGE)?,
        };
        Some(Bytes::from(bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_that_fits_no_outbox_is_not_encoded_and_counts_as_dropped() {
        let numbers = "0,".repeat(600_000);
        let plain =
            format!("{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{{\"data\":[{numbers}0]}}}}\n");
        for compression in [Compression::Cbor, Compression::CborRaw] {
            let message = ToEncode {
                spelling: "/t".into(),
                plain: plain.clone().into(),
                encoding: Encoding {
                    compression,
                    ..Encoding::default()
                },
                recipients: Vec::new(),
                type_name: Some("std_msgs/msg/Float64MultiArray"),
                fragmented: Arc::default(),
                permit: None,
            };
            let made = message.make();
            assert_eq!((made.messages.len(), made.lost), (0, 1), "{compression:?}");
        }
    }
}
