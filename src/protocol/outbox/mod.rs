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
//! **Invariant:** dropping removes whole messages and never reorders, and each dropped message is counted. At most
//! [`MAX_TOPIC_BYTES`] of topic messages wait, including those held back.

pub mod flow;
mod message;
mod throttle;

use std::cmp::Ordering;
use std::collections::{HashMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::{Buf, Bytes};

use self::message::{QueuedMessage, Waiting, counted};
pub use self::throttle::Throttle;
use self::throttle::TopicLimits;
use crate::protocol::limits::{MAX_FRAME, MEDIUM, SHORT};
use crate::protocol::wire::lines::{
    by_itself, first_message, first_messages, last_messages, messages,
};

/// Most bytes of topic messages that wait for one connection, each with [`MESSAGE_BYTES`]: ten seconds of the arm's
/// own. A message longer than [`MEDIUM`] uses the shared pool and counts as that many
/// bytes here, so at most one of them waits.
pub const MAX_TOPIC_BYTES: usize = 304 * 1024;
/// The longest topic message: the longest frame of a client, and the newline after it.
pub const MAX_MESSAGE: usize = MAX_FRAME + 1;
/// Largest age of a waiting topic message. Older ones are dropped, except the newest of its topic.
pub const MAX_AGE: Duration = Duration::from_secs(1);
/// The same after a message has been too old, until the queue is empty. The client is then slower than its topics.
/// Its messages are late by this time and by its unread bytes.
const MAX_AGE_BEHIND: Duration = Duration::from_millis(500);
/// Bytes counted for a waiting message besides its own: reference count, queue entry, and the allocator's overhead.
pub const MESSAGE_BYTES: usize = 160;

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

    // ---- throttles, `queue_length` and feedback ---------------------------------------------------------------------

    /// Sets the limits of a topic, or removes them after an unsubscription. Queued messages are still sent. If the
    /// throttle ends, held messages count as produced now.
    pub fn configure(&mut self, topic: &Arc<str>, throttle: Option<Throttle>) {
        let Some(throttle) = throttle else {
            self.take_held(topic);
            self.limits.remove(topic);
            return;
        };
        let limits = self.limits.entry(Arc::clone(topic)).or_default();
        limits.throttle = throttle;
        if limits.holds_back() {
            return limits.trim(&mut self.waiting);
        }
        limits.last = None;
        for held in self.take_held(topic) {
            self.enqueue(Some(topic), held.since, held.frame);
        }
        self.keep_to_queue_length(topic);
        if throttle.queue_length.is_none() {
            self.limits.remove(topic);
        }
    }

    /// Passes each message to the throttle separately. Once one is held back, the following ones are too, and only the
    /// newest of these remain.
    fn offer(&mut self, topic: &Arc<str>, mut frames: Bytes, now: Instant) {
        let is_series = first_message(&frames) < frames.len();
        while !frames.is_empty()
            && let Some(limits) = self.limits.get_mut(topic)
        {
            if limits.held.is_empty() && limits.is_due(now) {
                limits.last = limits.holds_back().then_some(now);
                let frame = frames.split_to(first_message(&frames));
                self.enqueue(Some(topic), now, by_itself(frame, is_series));
                continue;
            }
            if is_series {
                frames = last_messages(frames, limits.throttle.held_back);
            }
            for frame in messages(std::mem::take(&mut frames)) {
                if frame.len() > MEDIUM && !limits.may_hold_long(now) {
                    self.dropped += 1;
                    continue;
                }
                self.produced += 1;
                let message = QueuedMessage {
                    number: self.produced,
                    since: now,
                    topic: Some(Arc::clone(topic)),
                    frame: by_itself(frame, is_series),
                };
                self.waiting.add(&message);
                limits.held.push_back(message);
            }
            limits.trim(&mut self.waiting);
        }
    }

    /// Drops the oldest messages of a topic with more waiting messages than the client's `queue_length`, while the
    /// client is slow.
    fn keep_to_queue_length(&mut self, topic: &Arc<str>) {
        if self.writing.is_empty() && !self.room.is_used_up() {
            return;
        }
        let limits = self.limits.get(topic);
        let Some(most) = limits.and_then(|limits| limits.throttle.queue_length) else {
            return;
        };
        let waiting = self.topics.iter().filter(|message| message.is_on(topic));
        let mut surplus = waiting.count().saturating_sub(most);
        let (mut index, mut before) = (0, 0);
        self.topics.retain(|message| {
            let stays = surplus == 0 || !message.is_on(topic);
            if !stays {
                surplus -= 1;
                self.waiting.forget(message);
                self.dropped += message.count();
                before += usize::from(index < self.kept_old);
            }
            index += 1;
            stays
        });
        self.kept_old -= before;
    }

    /// Adds feedback of a goal. It may be dropped like a message, but no throttle holds it back, not even that of
    /// a topic with the action's name.
    pub fn push_feedback(&mut self, frame: Bytes, now: Instant) {
        if self.may_fit(&frame) {
            self.enqueue(None, now, frame);
            self.keep_bounded();
        }
    }

    /// Whether any message is held back.
    #[must_use]
    pub fn holds_back(&self) -> bool {
        self.waiting.count > self.topics.len()
    }

    /// Discards all that is held back of these topics.
    pub fn discard_held(&mut self, topics: &[&str]) {
        for topic in topics {
            self.take_held(topic);
        }
    }

    /// Takes all that is held back of a topic, oldest first; its throttle stays.
    fn take_held(&mut self, topic: &str) -> VecDeque<QueuedMessage> {
        let limits = self.limits.get_mut(topic);
        let held = limits.map_or_else(VecDeque::new, |limits| std::mem::take(&mut limits.held));
        held.iter().for_each(|message| self.waiting.forget(message));
        held
    }

    /// When the next held message is due, if any is held: the time to take frames again.
    #[must_use]
    pub fn next_release(&self) -> Option<Instant> {
        self.next_due().map(|(due, _)| due)
    }

    /// The topic with the earliest due message, and its time. A client has at most about 200 topics.
    fn next_due(&self) -> Option<(Instant, &Arc<str>)> {
        if !self.holds_back() {
            return None;
        }
        let limits = self.limits.iter();
        let due = limits.filter_map(|(topic, limits)| Some((limits.due()?, topic)));
        due.min()
    }

    /// Queues the held messages that are due. The client requested this delay, so their age counts from now.
    fn release(&mut self, now: Instant) {
        while let Some((_, topic)) = self.next_due().filter(|(due, _)| *due <= now) {
            let topic = Arc::clone(topic);
            let Some(limits) = self.limits.get_mut(&topic) else {
                return;
            };
            limits.last = Some(now);
            if let Some(held) = limits.held.pop_front() {
                self.waiting.forget(&held);
                self.enqueue(Some(&topic), now, held.frame);
            }
            self.keep_to_queue_length(&topic);
        }
    }

    // ---- drops, the oldest first: too many, too old, or too long ----------------------------------------------------

    /// Whether a message fits into an empty outbox. If not, it counts as dropped.
    fn may_fit(&mut self, frame: &Bytes) -> bool {
        let fits = frame.len() <= MAX_MESSAGE;
        self.dropped += u64::from(!fits);
        fits
    }

    /// Queues held messages that are due. Drops queued ones that are too old, except the newest of each topic.
    fn advance(&mut self, now: Instant) {
        self.release(now);
        while let Some(next) = self.topics.get(self.kept_old) {
            let age = if self.is_behind {
                MAX_AGE_BEHIND
            } else {
                MAX_AGE
            };
            if !next.is_older(age, now) {
                return;
            }
            let dropped = self.dropped;
            if !self.drop_but_newest(self.kept_old) {
                self.kept_old += 1;
            }
            self.is_behind |= self.dropped > dropped;
        }
    }

    /// Drops the first topic message if it is too old to be taken only because a response follows it. Returns `false`
    /// if it is not too old, or is the newest of its topic.
    fn drop_stale(&mut self, now: Instant) -> bool {
        let is_stale = |first: &QueuedMessage| first.is_older(self.fresh, now);
        self.topics.front().is_some_and(is_stale) && self.drop_but_newest(0)
    }

    /// Drops a message, or a whole series, except the newest of the topic and the end of a goal. Returns `true` if nothing is left.
    fn drop_but_newest(&mut self, index: usize) -> bool {
        let mut rest = self.topics.range_mut(index..);
        let Some(message) = rest.next() else {
            return true;
        };
        if message.is_end_of_goal() {
            return false;
        }
        let is_newest = |topic: &Arc<str>| !rest.any(|newer| newer.is_on(topic));
        if !message.topic.as_ref().is_some_and(is_newest) {
            self.drop_message(index);
            return true;
        }
        // The pieces of a message are dropped together.
        if first_message(&message.frame) < message.frame.len() {
            let newest = by_itself(last_messages(message.frame.clone(), 1), true);
            self.dropped += message.count() - 1;
            self.waiting.bytes -= counted(&message.frame);
            self.waiting.bytes += counted(&newest);
            message.frame = newest;
        }
        false
    }

    /// Drops topic messages, the oldest first, until at most [`MAX_TOPIC_BYTES`] are left. The oldest is the first in
    /// the queue or the first held one. A series loses as many messages at once as necessary. Ends of goals are dropped
    /// after all others.
    fn keep_bounded(&mut self) {
        loop {
            let cost = self.topic_bytes() + self.topic_count() * MESSAGE_BYTES;
            let excess = cost.saturating_sub(MAX_TOPIC_BYTES);
            if excess == 0 {
                return;
            }
            let mut queue = self.topics.iter();
            let first = queue.position(|message| !message.is_end_of_goal());
            let first = first.unwrap_or(0);
            let queued = self.topics.get(first);
            let queued = queued.map_or(u64::MAX, |first| first.number);
            let held = self.limits.values_mut();
            let held = held.filter(|one| one.first_held().is_some_and(|held| held < queued));
            let held = held.min_by_key(|limits| limits.first_held());
            if let Some(oldest) = held.and_then(|limits| limits.held.pop_front()) {
                self.waiting.forget(&oldest);
                self.dropped += 1;
            } else if first > 0 {
                self.drop_message(first);
            } else if let Some(QueuedMessage { frame, .. }) = self.topics.front() {
                let (bytes, count) = first_messages(frame, excess);
                self.dropped += count as u64;
                self.take_first(bytes);
            } else {
                debug_assert!(false, "bytes are counted that no message has");
                return;
            }
        }
    }

    // ---- numbers and bytes ------------------------------------------------------------------------------------------

    /// Bytes of waiting responses, including those being written.
    #[must_use]
    pub const fn response_bytes(&self) -> usize {
        self.response_bytes
    }

    /// The same without responses that have a permit.
    #[must_use]
    pub const fn short_bytes(&self) -> usize {
        self.short_bytes
    }

    /// The number of waiting topic messages or series, including held ones.
    #[must_use]
    pub const fn topic_count(&self) -> usize {
        self.waiting.count
    }

    /// Counted bytes of waiting topic messages, including held ones.
    #[must_use]
    pub const fn topic_bytes(&self) -> usize {
        self.waiting.bytes
    }

    /// Topic messages dropped so far because of the limits. A message that throttling replaces by a newer one
    /// is not counted.
    #[must_use]
    pub const fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Compares the sums with the messages. Builds without debug assertions omit it.
    fn check_sums(&self) {
        if !cfg!(debug_assertions) {
            return;
        }
        let held = self.limits.values().flat_map(|limits| &limits.held);
        let mut waiting = Waiting::default();
        held.chain(&self.topics).for_each(|one| waiting.add(one));
        debug_assert_eq!(self.waiting, waiting);
        debug_assert!(self.kept_old <= self.topics.len());
        let queued = self.responses.iter();
        let queued = queued.map(|(_, frame)| (frame.len(), frame.len()));
        let writing = self.writing.iter().filter(|frame| frame.is_response);
        let writing = writing.map(|frame| (frame.rest.len(), frame.length));
        let responses = || queued.clone().chain(writing.clone());
        let short = responses().filter(|(_, length)| *length <= SHORT);
        debug_assert_eq!(self.short_bytes, short.map(|(rest, _)| rest).sum::<usize>());
        debug_assert_eq!(
            self.response_bytes,
            responses().map(|(rest, _)| rest).sum::<usize>()
        );
    }
}
