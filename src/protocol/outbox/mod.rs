//! The outbox of one connection: the queue of messages to be written. It is bounded, in order, and throttled if the
//! client requested that.
//!
//! Topic messages may be dropped, the oldest first. Responses are never dropped. Both leave in the order in which
//! they were produced. A message that `throttle_rate` holds back enters that order when it is due.
//!
//! A [series](crate::protocol::wire::series) is queued as one piece, but dropped and held back message by message.
//!
//! A message that has waited for longer than [`MAX_AGE`], or for half of it if the client is behind, is dropped, except
//! the newest of its topic, and the ends of goals.
//!
//! The caller passes the time. The outbox has no socket and no clock.
//!
//! **Invariant:** dropping removes whole messages and never reorders. At most [`MAX_TOPIC_BYTES`] of topic messages
//! wait, including those held back.

mod counts;
mod dropping;
pub mod flow;
mod held;
mod message;
mod slow;
mod throttle;

use std::cmp::Ordering;
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::{Buf, Bytes};

pub use self::dropping::{MAX_AGE, MAX_MESSAGE, MAX_TOPIC_BYTES, MESSAGE_BYTES};
use self::message::{QueuedMessage, Waiting, counted};
pub use self::throttle::Throttle;
use self::throttle::TopicLimits;
use crate::protocol::limits::SHORT;
use crate::protocol::wire::lines::first_message;

/// The outgoing queue of one connection.
#[derive(Debug, Default)]
pub struct Outbox {
    /// Topic messages in order.
    topics: VecDeque<QueuedMessage>,
    /// The number of messages at the front that are too old. Each is the newest of its topic, or the end of a goal.
    kept_old: usize,
    /// Whether a message has been too old since the queue was last empty.
    is_behind: bool,
    /// Topic messages that may be taken, unless a response follows them. Only waiting messages have a limit.
    room: Room,
    /// Largest age of a topic message that is taken only because a response follows it.
    fresh: Duration,
    /// Responses and statuses in order, with their numbers.
    responses: VecDeque<(u64, Bytes)>,
    /// The client's limits, by topic.
    limits: HashMap<Arc<str>, TopicLimits>,
    /// The last number. A lower number leaves first, and is dropped first.
    produced: u64,
    waiting: Waiting,
    /// Bytes of responses that are queued or being written, and the bytes of the short ones.
    response_bytes: usize,
    short_bytes: usize,
    /// The frames that are being written.
    writing: VecDeque<Writing>,
    dropped: u64,
}

/// Bytes of topic messages that a client may be sent now.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Room {
    /// As many as its socket takes.
    #[default]
    Unlimited,
    /// The client is slow, and is sent so many bytes, and the rest of the message that the last one belongs to.
    Bytes(u64),
}

impl Room {
    const fn is_used_up(self) -> bool {
        matches!(self, Self::Bytes(0))
    }

    fn use_up(&mut self, bytes: usize) {
        if let Self::Bytes(left) = self {
            *left = left.saturating_sub(bytes as u64);
        }
    }
}

/// A frame that is being written.
#[derive(Debug)]
struct Writing {
    /// Its bytes that have not been written.
    rest: Bytes,
    is_response: bool,
    /// Bytes of the whole frame.
    length: usize,
}

impl Outbox {
    /// An empty outbox.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a message on a topic, or a series. It is queued, or held back if the topic is throttled. If it does
    /// not fit, the oldest messages are dropped.
    pub fn push(&mut self, topic: &Arc<str>, frame: Bytes, now: Instant) {
        self.advance(now);
        if !self.may_fit(&frame) {
            return;
        }
        if self.limits.contains_key(topic) {
            self.offer(topic, frame, now);
            self.keep_to_queue_length(topic);
        } else {
            self.enqueue(Some(topic), now, frame);
        }
        self.keep_bounded();
        self.check_sums();
    }

    /// Adds a response or a status. Held messages of the topics in `supersedes` are outdated by it, and are discarded.
    pub fn push_response(&mut self, frame: Bytes, supersedes: &[&str]) {
        self.discard_held(supersedes);
        self.response_bytes += frame.len();
        if frame.len() <= SHORT {
            self.short_bytes += frame.len();
        }
        self.produced += 1;
        self.responses.push_back((self.produced, frame));
    }

    /// Sets how much of the waiting topic messages may be taken from now on. Messages before a response are taken in
    /// any case, unless they are older than `fresh`. Older ones are dropped, except the newest of each topic.
    pub const fn allow(&mut self, room: Room, fresh: Duration) {
        self.room = room;
        self.fresh = fresh;
    }

    /// Moves the next frames to [those being written](Self::writing): as many as `max_frames` and `max_bytes`
    /// allow, and at least one if any waits. A series counts as one frame, unless `max_frames` is 1.
    pub fn take_frames(&mut self, now: Instant, max_frames: usize, max_bytes: usize) {
        self.advance(now);
        let (mut bytes, mut taken) = (0, 0);
        while taken < max_frames.max(1) {
            let topic = self.topics.front().map_or(u64::MAX, |topic| topic.number);
            let response = self.responses.front();
            let response = response.map_or(u64::MAX, |(number, _)| *number);
            let is_response = match response.cmp(&topic) {
                Ordering::Less => true,
                Ordering::Greater => false,
                // Neither waits.
                Ordering::Equal => break,
            };
            if !is_response && self.room.is_used_up() {
                if !self.has_responses() {
                    break;
                }
                if self.drop_stale(now) {
                    continue;
                }
            }
            let next = if is_response {
                self.responses.front().map(|(_, frame)| frame)
            } else {
                self.topics.front().map(|message| &message.frame)
            };
            let length = next.map_or(0, |next| match max_frames {
                0 | 1 if !is_response => first_message(next),
                _ => next.len(),
            });
            bytes += length;
            if taken > 0 && bytes > max_bytes {
                break;
            }
            taken += 1;
            let frame = if is_response {
                self.responses.pop_front().map(|(_, frame)| frame)
            } else {
                self.take_first(length)
            };
            if !is_response {
                self.room.use_up(length);
            }
            if let Some(rest) = frame {
                self.writing.push_back(Writing {
                    rest,
                    is_response,
                    length,
                });
            }
        }
        if !self.has_topics() {
            (self.is_behind, self.room) = (false, Room::Unlimited);
        }
        self.check_sums();
    }

    /// Whether frames are being written.
    #[must_use]
    pub fn is_writing(&self) -> bool {
        !self.writing.is_empty()
    }

    /// The unwritten bytes of the frames that are being written.
    pub fn writing(&self) -> impl ExactSizeIterator<Item = &Bytes> {
        self.writing.iter().map(|frame| &frame.rest)
    }

    /// Records that the next `bytes` of the taken frames have been written.
    pub fn note_written(&mut self, mut bytes: usize) {
        while let Some(frame) = self.writing.front_mut() {
            let done = bytes.min(frame.rest.len());
            frame.rest.advance(done);
            bytes -= done;
            if frame.is_response {
                self.response_bytes -= done;
                if frame.length <= SHORT {
                    self.short_bytes -= done;
                }
            }
            if !frame.rest.is_empty() {
                break;
            }
            self.writing.pop_front();
        }
        self.check_sums();
    }

    /// Whether no frame can be taken now. Held messages that are not due do not count.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.topics.is_empty() && self.responses.is_empty()
    }

    /// Whether a response waits.
    #[must_use]
    pub fn has_responses(&self) -> bool {
        !self.responses.is_empty()
    }

    /// Whether topic messages wait, without held ones.
    #[must_use]
    pub fn has_topics(&self) -> bool {
        !self.topics.is_empty()
    }

    /// Queues a message or a series. An old message of its topic is dropped.
    fn enqueue(&mut self, topic: Option<&Arc<str>>, since: Instant, frame: Bytes) {
        self.produced += 1;
        let message = QueuedMessage {
            number: self.produced,
            since,
            topic: topic.cloned(),
            frame,
        };
        let replaced = topic.filter(|_| self.kept_old > 0 && !message.is_end_of_goal());
        let replaced = replaced.and_then(|topic| {
            let mut old = self.topics.range(..self.kept_old);
            old.position(|message| message.is_on(topic))
        });
        self.waiting.add(&message);
        self.topics.push_back(message);
        if let Some(replaced) = replaced {
            self.drop_message(replaced);
        }
    }

    /// Takes the first `length` bytes of the queue, which are whole messages of its first entry.
    fn take_first(&mut self, length: usize) -> Option<Bytes> {
        let first = &mut self.topics.front_mut()?.frame;
        if length >= first.len() {
            return self.take_out(0).map(|message| message.frame);
        }
        self.waiting.bytes -= counted(first);
        let taken = first.split_to(length);
        self.waiting.bytes += counted(first);
        Some(taken)
    }

    /// Drops the message or the whole series at that index.
    fn drop_message(&mut self, index: usize) {
        if let Some(message) = self.take_out(index) {
            self.dropped += message.count();
        }
    }

    fn take_out(&mut self, index: usize) -> Option<QueuedMessage> {
        let message = match index {
            0 => self.topics.pop_front(),
            _ => self.topics.remove(index),
        }?;
        self.waiting.forget(&message);
        if index < self.kept_old {
            self.kept_old -= 1;
        }
        Some(message)
    }
}
