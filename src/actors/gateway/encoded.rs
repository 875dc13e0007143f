//! A topic message in the form that some of its subscribers have asked for.
//!
//! **Invariant:** it is made once, whoever asked for it, and not before one of them has room for it; what takes long
//! is made on another thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use bytes::Bytes;
use tokio::sync::OnceCell;

use crate::actors::resources::aside::{Errand, aside};
use crate::actors::resources::budget::Memory;
use crate::protocol::messages;
use crate::protocol::names::OWN_ID_PREFIX;
use crate::protocol::op::{Compression, Encoding};
use crate::protocol::outbox::MAX_TOPIC_BYTES;
use crate::protocol::ros::tree::MessageTree;
use crate::protocol::ros::{cbor, stamps};
use crate::protocol::wire::{fragments, series};

/// Longest message, or series of them, that is encoded where it is heard: in one form it takes some tenth of a
/// millisecond, and each connection has a turn of its own.
const SHORT: usize = 16 * 1024;
/// Bytes of memory that encoding takes per byte of a message, beside its tree: the names of ROS 1 may double the
/// message, the buffer grows by doubling, and names are put in order.
const ENCODING_BYTES: usize = 4;

/// The messages in their form.
#[derive(Default)]
pub struct Made {
    pub(super) messages: Vec<Bytes>,
    /// How many could not be made: they are longer than any outbox takes, or do not fit their type.
    pub(super) lost: u64,
}

/// A message, or a series of them, in one form. Each message lies by itself, so that to keep one keeps no other in
/// memory.
pub struct Encoded {
    /// The topic, as the subscribers spell it.
    spelling: Arc<str>,
    plain: Bytes,
    encoding: Encoding,
    /// The type of the topic's messages, where it matters and is known.
    type_name: Option<Box<str>>,
    /// Messages that went out in fragments so far: their numbers make the fragments' ids.
    fragmented: Arc<AtomicU64>,
    /// Counts what is made.
    memory: Memory,
    made: OnceCell<Made>,
}

impl Encoded {
    pub(super) fn new(
        spelling: &Arc<str>,
        plain: Bytes,
        encoding: Encoding,
        type_name: Option<&str>,
        (fragmented, memory): (&Arc<AtomicU64>, &Memory),
    ) -> Self {
        let is_binary = encoding.compression != Compression::None;
        Self {
            spelling: Arc::clone(spelling),
            plain,
            encoding,
            type_name: type_name.filter(|_| is_binary).map(Into::into),
            fragmented: Arc::clone(fragmented),
            memory: memory.clone(),
            made: OnceCell::new(),
        }
    }

    /// The message or messages as they came.
    pub(super) fn plain(&self) -> &Bytes {
        &self.plain
    }

    /// The messages, if they have been made, or are short enough to be made at once.
    pub(super) fn at_hand(&self) -> Option<&Made> {
        if !self.made.initialized() && self.plain.len() <= SHORT {
            // This fails if another subscriber's task is making them, which is as good.
            let _ = self.made.set(self.make());
        }
        self.made.get()
    }

    /// The messages, once they have been made.
    pub(super) async fn messages(self: &Arc<Self>) -> &Made {
        let make = || async {
            let this = Arc::clone(self);
            let errand = Errand::writing(self.plain.len());
            let made = aside(errand, move || this.make()).await;
            made.unwrap_or_default()
        };
        self.made.get_or_init(make).await
    }

    fn make(&self) -> Made {
        let all = self.plain.len();
        let mut made = Made::default();
        for message in series::messages(self.plain.clone()) {
            let is_counted = message.len() == all;
            let counted = match self.encode(&message) {
                Some(Some(encoded)) => self.memory.count(encoded),
                Some(None) if is_counted => message,
                Some(None) => self.memory.count(Bytes::copy_from_slice(&message)),
                None => {
                    made.lost += 1;
                    continue;
                }
            };
            made.messages.push(counted);
        }
        made
    }

    /// One message: `None` where it can't be written so, `Some(None)` where it stays as it is.
    #[allow(clippy::option_option, reason = "one is dropped, the other is not")]
    fn encode(&self, plain: &Bytes) -> Option<Option<Bytes>> {
        let spelling = &*self.spelling;
        let type_name = self.type_name.as_deref();
        let mut working = self.memory.take(ENCODING_BYTES * plain.len());
        let renamed = (self.encoding.ros1_stamps).then(|| stamps::with_ros1_names(plain));
        let plain = renamed.as_ref().unwrap_or(plain);
        if self.encoding.compression == Compression::None {
            let size = self.encoding.fragment_size;
            let Some(size) = size.filter(|size| plain.len() > *size) else {
                return Some(renamed);
            };
            let number = self.fragmented.fetch_add(1, Ordering::Relaxed) + 1;
            let id = format!("{OWN_ID_PREFIX}{number}");
            return fragments::split(plain, size, &id, MAX_TOPIC_BYTES).map(Some);
        }
        let msg = messages::message_text(spelling, plain);
        working.resize(working.bytes() + MessageTree::room(msg));
        let tree = MessageTree::read(msg).ok()?;
        let msg = tree.root();
        let bytes = match self.encoding.compression {
            Compression::CborRaw => cbor::publish_raw(spelling, type_name?, msg, MAX_TOPIC_BYTES)?,
            _ => cbor::publish(spelling, type_name, msg, MAX_TOPIC_BYTES)?,
        };
        Some(Some(Bytes::from(bytes)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIB: usize = 1024 * 1024;

    /// A message that is encoded, and what it was made with.
    fn encoded(
        msg: &str,
        compression: Compression,
        type_name: Option<&str>,
        memory: &Memory,
    ) -> Made {
        let plain = Bytes::from(format!(
            "{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{msg}}}\n"
        ));
        let encoding = Encoding {
            compression,
            fragment_size: Some(64).filter(|_| compression == Compression::None),
            ros1_stamps: false,
        };
        let counters = (&Arc::default(), memory);
        Encoded::new(&"/t".into(), plain, encoding, type_name, counters).make()
    }

    /// A long text is one value, a list of numbers a value for every two bytes.
    #[test]
    fn a_tree_counts_while_it_stands() {
        for (msg, gives_way) in [
            (format!("\"{}\"", "x".repeat(MIB / 2)), 0),
            (format!("[{}1]", "1,".repeat(MIB / 4)), 1),
        ] {
            let memory = Memory::of(10 * MIB);
            let account = memory.open();
            let others = account.take(4 * MIB);
            let made = encoded(&msg, Compression::Cbor, None, &memory);
            assert_eq!((made.messages.len(), made.lost), (1, 0));
            assert_eq!(memory.cut_off(), gives_way);
            drop((others, account, made));
            assert_eq!(memory.held(), 0);
        }
    }

    #[test]
    fn what_no_outbox_takes_is_not_made_and_counts_as_lost() {
        let memory = Memory::default();
        let times = format!("{{\"transforms\":[{}{{}}]}}", "{},".repeat(200_000));
        let quotes = format!("\"{}\"", "\\\"".repeat(MIB));
        for (msg, compression) in [
            (times.as_str(), Compression::CborRaw),
            (&quotes, Compression::None),
            ("1e999", Compression::Cbor),
        ] {
            let made = encoded(msg, compression, Some("tf2_msgs/msg/TFMessage"), &memory);
            assert_eq!((made.messages.len(), made.lost), (0, 1), "{compression:?}");
        }
        assert_eq!(memory.held(), 0);
    }
}
