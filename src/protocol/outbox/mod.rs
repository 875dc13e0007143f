//! The outbox of one connection holds what waits to be written: bounded, in order, throttled where the client asked
//! for it.
//!
//! Topic messages may be lost, oldest first; responses may not. Both leave in the order in which they were produced.
//! A message that `throttle_rate` holds back takes its place in that order when its time comes.
//!
//! A [series](crate::protocol::wire::series) is queued as one piece, and dropped and held back message by message.
//!
//! A message that has waited for longer than [`MAX_AGE`] is dropped, except the newest of its topic.
//!
//! It is told the time, and knows no socket and no clock.
//!
//! **Invariant:** dropping removes whole messages, never reorders; of topic messages, held back ones included, at most
//! [`MAX_TOPIC_BYTES`] wait.

mod throttle;

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::{Buf, Bytes};

use crate::protocol::limits::{MAX_FRAME, MEDIUM, SHORT};
use crate::protocol::wire::series::{first_message, first_messages, last_messages, messages};

/// Most bytes of topic messages that wait for one connection, each with [`MESSAGE_BYTES`]: ten seconds of the arm's
/// own. A longer message than [`MEDIUM`] has room elsewhere, and counts as one of these: no two of them wait.
pub const MAX_TOPIC_BYTES: usize = 304 * 1024;
/// The longest topic message: the longest that a client may send, and the newline behind it.
pub const MAX_MESSAGE: usize = MAX_FRAME + 1;
/// How long a topic message may wait before it is dropped, unless it is the newest of its topic.
pub const MAX_AGE: Duration = Duration::from_secs(1);
/// The same once a message has been too old, until nothing waits any more. The client is slower than its topics, and
/// its reading is late by this and by its unread bytes.
const MAX_AGE_BEHIND: Duration = Duration::from_millis(500);
/// Bytes that a waiting message counts beside its own: its reference count, its place, and what the allocator adds.
pub const MESSAGE_BYTES: usize = 160;

/// Microseconds since the outbox was first used: half the bytes of an [`Instant`].
type Timestamp = u64;

/// Bytes of a message, or of a series, that count.
fn counted(frame: &Bytes) -> usize {
    frame.len().min(MEDIUM)
}

/// A message that is queued without the series that it is part of, if it is: it keeps none of the others in memory.
fn by_itself(frame: Bytes, is_part: bool) -> Bytes {
    if is_part {
        Bytes::copy_from_slice(&frame)
    } else {
        frame
    }
}

/// The outgoing queue of one connection.
#[derive(Debug)]
pub struct Outbox {
    /// Topic messages in order, by their numbers.
    topics: BTreeMap<u64, QueuedMessage>,
    /// Every topic that has messages here, a bound or a throttle.
    queues: HashMap<Arc<str>, TopicQueue>,
    /// Messages with lower numbers have been looked at for their age. The messages that are left are the newest
    /// of their topics.
    looked_at: u64,
    /// Whether a message has been too old since the queue was last empty.
    is_behind: bool,
    /// Bytes of topic messages that may be taken, unless a response is behind them.
    room: usize,
    /// How old a topic message may be that is taken only because a response is behind it.
    fresh: Duration,
    /// The time that ages are counted from.
    epoch: Option<Instant>,
    /// Responses and statuses in order, each with its number.
    responses: VecDeque<(u64, Bytes)>,
    /// How many topics are throttled.
    throttled: usize,
    /// Messages that are held back, and the bytes of them that count.
    held_count: usize,
    held_bytes: usize,
    /// Numbers given so far. The lower number leaves first, and is the older where messages are dropped.
    produced: u64,
    /// Bytes of queued topic messages that count, without those held back.
    topic_bytes: usize,
    /// Bytes of responses that are queued or being written, and those of the short ones among them.
    response_bytes: usize,
    short_bytes: usize,
    /// The frames that are being written.
    in_flight: VecDeque<InFlight>,
    dropped: u64,
}

/// A topic message that waits, or a series of them.
#[derive(Debug)]
struct QueuedMessage {
    frame: Bytes,
    /// Its topic; feedback of a goal has none.
    topic: Option<Arc<str>>,
    /// When it was produced.
    since: Timestamp,
}

/// The messages of one topic, which leave the oldest first.
#[derive(Debug, Default)]
struct TopicQueue {
    /// The number of the newest that is queued.
    newest: u64,
    /// How many messages, or series of them, are queued.
    count: usize,
    /// How many may be.
    bound: Option<usize>,
    /// The numbers of those that came while there was a bound.
    bounded: VecDeque<u64>,
    throttle: Option<TopicThrottle>,
    /// Messages that the throttle holds back.
    held: VecDeque<HeldMessage>,
}

/// `throttle_rate` and `queue_length` of one topic.
#[derive(Debug)]
struct TopicThrottle {
    /// Least time between deliveries.
    interval: Duration,
    /// How many messages may be held back, 1 or more.
    queue_length: usize,
    /// When the last message was let go.
    last: Option<Instant>,
}

/// A message that is held back.
#[derive(Debug)]
struct HeldMessage {
    number: u64,
    /// When it was produced.
    since: Timestamp,
    frame: Bytes,
}

impl TopicQueue {
    fn is_idle(&self) -> bool {
        self.count == 0 && self.bound.is_none() && self.throttle.is_none()
    }
}

impl Default for Outbox {
    fn default() -> Self {
        Self {
            topics: BTreeMap::new(),
            queues: HashMap::new(),
            looked_at: 0,
            is_behind: false,
            room: usize::MAX,
            fresh: MAX_AGE,
            epoch: None,
            responses: VecDeque::new(),
            throttled: 0,
            held_count: 0,
            held_bytes: 0,
            produced: 0,
            topic_bytes: 0,
            response_bytes: 0,
            short_bytes: 0,
            in_flight: VecDeque::new(),
            dropped: 0,
        }
    }
}

/// A frame that is being written.
#[derive(Debug)]
struct InFlight {
    /// Bytes that have not been written.
    left: usize,
    is_response: bool,
    /// Bytes of the whole.
    length: usize,
}

impl Outbox {
    /// An empty outbox.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a message on a topic, or a series: queued, or held back if the topic is throttled. If it does not fit,
    /// the oldest go.
    pub fn push(&mut self, topic: &Arc<str>, frame: Bytes, now: Instant) {
        let since = self.timestamp(now);
        self.release(now);
        self.drop_old(now);
        if !self.may_fit(&frame) {
            return;
        }
        match self.queues.get(topic) {
            Some(queue) if queue.throttle.is_some() => self.offer(topic, since, frame, now),
            Some(queue) if queue.bound.is_some() => {
                let is_series = first_message(&frame) < frame.len();
                for frame in messages(frame) {
                    let number = self.number();
                    self.enqueue(number, topic, since, by_itself(frame, is_series));
                }
            }
            _ => {
                let number = self.number();
                self.enqueue(number, topic, since, frame);
            }
        }
        self.keep_bounded();
    }

    /// Adds feedback of a goal. It may be lost as a message may, but no throttle holds it back, not even that of a
    /// topic with the action's name.
    pub fn push_feedback(&mut self, frame: Bytes, now: Instant) {
        let since = self.timestamp(now);
        if !self.may_fit(&frame) {
            return;
        }
        let number = self.number();
        self.topic_bytes += counted(&frame);
        let topic = None;
        let message = QueuedMessage {
            frame,
            topic,
            since,
        };
        self.topics.insert(number, message);
        self.keep_bounded();
    }

    /// Whether a topic is throttled.
    #[must_use]
    pub const fn is_throttled(&self) -> bool {
        self.throttled > 0
    }

    /// Adds a response or a status. Messages of the topics in `supersedes` that throttling holds back are older, and
    /// are discarded.
    pub fn push_response(&mut self, frame: Bytes, supersedes: &[&str]) {
        for topic in supersedes {
            self.take_held(topic);
        }
        self.response_bytes += frame.len();
        if frame.len() <= SHORT {
            self.short_bytes += frame.len();
        }
        let number = self.number();
        self.responses.push_back((number, frame));
    }

    /// Sets how many messages of a topic may wait while the client does not take all that it is offered, the newest
    /// kept; `None` for any number.
    pub fn set_queue_length(&mut self, topic: &Arc<str>, queue_length: Option<usize>) {
        if queue_length.is_none() {
            return self.forget_bound(topic);
        }
        let queue = self.queues.entry(Arc::clone(topic)).or_default();
        queue.bound = queue_length;
    }

    /// Sets how many bytes of topic messages may be taken from now on. Messages ahead of a response are taken all
    /// the same, unless they are older than `fresh`. Then they are dropped, except the newest of its topic.
    pub const fn allow(&mut self, room: usize, fresh: Duration) {
        self.room = room;
        self.fresh = fresh;
    }

    /// Forgets a topic after an unsubscription: its throttle, and what is held back. Queued messages still leave.
    pub fn forget(&mut self, topic: &str) {
        self.lift_throttle(topic);
        self.forget_bound(topic);
    }

    fn forget_bound(&mut self, topic: &str) {
        if let Some(queue) = self.queues.get_mut(topic) {
            queue.bound = None;
            queue.bounded = VecDeque::new();
            self.tidy(topic);
        }
    }

    /// Forgets a topic that has neither messages nor a bound or a throttle.
    fn tidy(&mut self, topic: &str) {
        if self.queues.get(topic).is_some_and(TopicQueue::is_idle) {
            self.queues.remove(topic);
            if self.queues.capacity() > 4 * self.queues.len() + 32 {
                self.queues.shrink_to(2 * self.queues.len());
            }
        }
    }

    /// Moves the next frames into `frames`, at least one if any waits, as many as `max_frames` and `max_bytes` allow.
    /// They count as being written until [`written`](Self::written) says otherwise. A series counts as one, unless
    /// one frame is all that is asked for.
    pub fn take_frames(
        &mut self,
        now: Instant,
        max_frames: usize,
        max_bytes: usize,
        frames: &mut Vec<Bytes>,
    ) {
        self.release(now);
        self.drop_old(now);
        let mut bytes = 0;
        let mut taken = 0;
        while taken < max_frames.max(1) {
            let is_response = match (self.topics.first_key_value(), self.responses.front()) {
                (Some((topic, _)), Some((response, _))) => response < topic,
                (Some(_), None) => false,
                (None, Some(_)) => true,
                (None, None) => break,
            };
            if !is_response && !self.may_take_topic() {
                break;
            }
            if !is_response && self.room == 0 && self.drop_stale(now) {
                continue;
            }
            let next = if is_response {
                self.responses.front_mut().map(|(_, frame)| frame)
            } else {
                let first = self.topics.first_entry();
                first.map(|entry| &mut entry.into_mut().frame)
            };
            let Some(next) = next else {
                break;
            };
            let single = max_frames <= 1 && !is_response;
            let length = if single {
                first_message(next)
            } else {
                next.len()
            };
            bytes += length;
            if taken > 0 && bytes > max_bytes {
                break;
            }
            taken += 1;
            let frame = if length < next.len() {
                self.topic_bytes -= counted(next);
                let first = next.split_to(length);
                self.topic_bytes += counted(next);
                first
            } else if is_response {
                let Some((_, whole)) = self.responses.pop_front() else {
                    break;
                };
                whole
            } else {
                let Some(whole) = self.take_out_first() else {
                    break;
                };
                whole
            };
            if !is_response {
                self.room = self.room.saturating_sub(length);
            }
            self.in_flight.push_back(InFlight {
                left: length,
                is_response,
                length,
            });
            frames.push(frame);
        }
        self.is_behind &= !self.topics.is_empty();
    }

    /// Whether anything may be taken now.
    #[must_use]
    pub fn may_take(&self) -> bool {
        self.has_responses() || (!self.topics.is_empty() && self.room > 0)
    }

    /// Whether the next topic message may be taken.
    fn may_take_topic(&self) -> bool {
        self.room > 0 || self.has_responses()
    }

    /// Notes that the next `bytes` of what was taken have been written.
    pub fn written(&mut self, mut bytes: usize) {
        while let Some(frame) = self.in_flight.front_mut() {
            let done = bytes.min(frame.left);
            frame.left -= done;
            bytes -= done;
            if frame.is_response {
                self.response_bytes -= done;
                if frame.length <= SHORT {
                    self.short_bytes -= done;
                }
            }
            if frame.left > 0 {
                return;
            }
            self.in_flight.pop_front();
        }
    }

    /// Whether a long topic message waits or is being written, what is held back aside.
    #[must_use]
    pub fn has_long(&self) -> bool {
        let mut waiting = self.topics.values();
        let mut writing = self.in_flight.iter();
        waiting.any(|message| message.frame.len() > MEDIUM)
            || writing.any(|frame| frame.length > MEDIUM && !frame.is_response)
    }

    /// When the next held back message is due, if any is held back: the time to take frames again.
    #[must_use]
    pub fn next_release(&self) -> Option<Instant> {
        self.next_due().map(|(due, _)| due)
    }

    /// Whether there is nothing to be taken now (held back messages that are not due do not count).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.topics.is_empty() && self.responses.is_empty()
    }

    /// Whether a response is to be taken.
    #[must_use]
    pub fn has_responses(&self) -> bool {
        !self.responses.is_empty()
    }

    /// Bytes of responses that wait, those being written included.
    #[must_use]
    pub const fn response_bytes(&self) -> usize {
        self.response_bytes
    }

    /// The same without those that take a permit.
    #[must_use]
    pub const fn short_bytes(&self) -> usize {
        self.short_bytes
    }

    /// How many topic messages, or series of them, wait, those held back included.
    #[must_use]
    pub fn topic_count(&self) -> usize {
        self.topics.len() + self.held_count
    }

    /// Bytes of topic messages that wait, as they count, those held back included.
    #[must_use]
    pub const fn topic_bytes(&self) -> usize {
        self.topic_bytes + self.held_bytes
    }

    /// Topic messages dropped so far for want of room. A message that throttling replaces by a newer one is not
    /// counted.
    #[must_use]
    pub const fn dropped(&self) -> u64 {
        self.dropped
    }

    /// Whether topic messages wait, without those held back.
    #[must_use]
    pub fn has_topics(&self) -> bool {
        !self.topics.is_empty()
    }

    fn number(&mut self) -> u64 {
        self.produced += 1;
        self.produced
    }

    fn timestamp(&mut self, time: Instant) -> Timestamp {
        let epoch = *self.epoch.get_or_insert(time);
        let since = time.saturating_duration_since(epoch).as_micros();
        Timestamp::try_from(since).unwrap_or(Timestamp::MAX)
    }

    fn enqueue(&mut self, number: u64, topic: &Arc<str>, since: Timestamp, frame: Bytes) {
        let queue = self.queues.entry(Arc::clone(topic)).or_default();
        let before = (queue.count > 0).then_some(queue.newest);
        queue.newest = number;
        queue.count += 1;
        if queue.bound.is_some() {
            queue.bounded.push_back(number);
        }
        if before.is_some_and(|before| before < self.looked_at) {
            // It was too old, and is the newest no more.
            self.drop_message(before);
        }
        self.topic_bytes += counted(&frame);
        let message = QueuedMessage {
            frame,
            topic: Some(Arc::clone(topic)),
            since,
        };
        self.topics.insert(number, message);
        if !self.in_flight.is_empty() || self.room == 0 {
            while let Some(surplus) = self.surplus(topic) {
                self.drop_message(Some(surplus));
            }
        }
    }

    /// The oldest message of a topic, if more wait than may.
    fn surplus(&self, topic: &str) -> Option<u64> {
        let TopicQueue { bound, bounded, .. } = self.queues.get(topic)?;
        (bounded.len() > (*bound)?).then(|| bounded.front().copied())?
    }
}

// ---- dropping: the oldest messages go first, whole ------------------------------------------------------------------

impl Outbox {
    /// Whether there is room for a message once all else has gone; if not, it counts as dropped.
    fn may_fit(&mut self, frame: &Bytes) -> bool {
        let fits = frame.len() <= MAX_MESSAGE;
        self.dropped += u64::from(!fits);
        fits
    }

    /// Drops the messages that have waited for too long, except the newest of each topic.
    fn drop_old(&mut self, now: Instant) {
        loop {
            let age = if self.is_behind {
                MAX_AGE_BEHIND
            } else {
                MAX_AGE
            };
            let oldest = self.oldest_at(now, age);
            let next = self.topics.range(self.looked_at..).next();
            let Some((&number, _)) = next.filter(|(_, message)| message.since < oldest) else {
                return;
            };
            self.looked_at = number + 1;
            let dropped = self.dropped;
            self.drop_but_newest(number);
            self.is_behind |= self.dropped > dropped;
        }
    }

    /// Drops the first topic message if it is too old to be taken only because a response is behind it; false if it is
    /// not.
    fn drop_stale(&mut self, now: Instant) -> bool {
        let oldest = self.oldest_at(now, self.fresh);
        let first = self.topics.first_key_value();
        let Some((&number, _)) = first.filter(|(_, message)| message.since < oldest) else {
            return false;
        };
        self.drop_but_newest(number)
    }

    /// Drops a message, or all of a series, except the newest of the topic; true if nothing is left.
    fn drop_but_newest(&mut self, number: u64) -> bool {
        let Some(message) = self.topics.get_mut(&number) else {
            return true;
        };
        let queue = message
            .topic
            .as_ref()
            .and_then(|topic| self.queues.get(topic));
        if queue.is_none_or(|queue| queue.newest != number) {
            self.drop_message(Some(number));
            return true;
        }
        if first_message(&message.frame) == message.frame.len() {
            // The pieces of a message stay together.
            return false;
        }
        let newest = by_itself(last_messages(message.frame.clone(), 1), true);
        let older = message.frame.len() - newest.len();
        self.dropped += messages(message.frame.slice(..older)).count() as u64;
        self.topic_bytes -= counted(&message.frame);
        self.topic_bytes += counted(&newest);
        message.frame = newest;
        false
    }

    /// Drops a message, or all of a series, if there is one with that number.
    fn drop_message(&mut self, number: Option<u64>) {
        let message = number.and_then(|number| self.take_out(number));
        if let Some(frame) = message {
            self.dropped += messages(frame.clone()).count() as u64;
        }
    }

    /// Takes the first topic message out of the queue.
    fn take_out_first(&mut self) -> Option<Bytes> {
        let number = *self.topics.first_key_value()?.0;
        self.take_out(number)
    }

    fn take_out(&mut self, number: u64) -> Option<Bytes> {
        let QueuedMessage { frame, topic, .. } = self.topics.remove(&number)?;
        self.topic_bytes -= counted(&frame);
        if let Some(topic) = topic
            && let Some(queue) = self.queues.get_mut(&topic)
        {
            queue.count -= 1;
            if queue.bounded.front() == Some(&number) {
                queue.bounded.pop_front();
            }
            self.tidy(&topic);
        }
        Some(frame)
    }

    /// The least time of a message that is not older than `age`.
    fn oldest_at(&mut self, now: Instant, age: Duration) -> Timestamp {
        let age = Timestamp::try_from(age.as_micros()).unwrap_or(Timestamp::MAX);
        self.timestamp(now).saturating_sub(age)
    }

    /// Drops topic messages, the oldest first, until what is left takes at most [`MAX_TOPIC_BYTES`]. The oldest is the
    /// queue's first or the one that was held back first. A series loses as many messages at once as have to go.
    fn keep_bounded(&mut self) {
        loop {
            let cost = self.topic_bytes() + self.topic_count() * MESSAGE_BYTES;
            let excess = cost.saturating_sub(MAX_TOPIC_BYTES);
            if excess == 0 {
                return;
            }
            let first = self.topics.first_key_value();
            let queued = first.map_or(u64::MAX, |(number, _)| *number);
            let held = self.oldest_held().filter(|(held, _)| *held < queued);
            if let Some((_, topic)) = held {
                self.pop_held(&topic);
                self.dropped += 1;
            } else if let Some(mut first) = self.topics.first_entry() {
                let frames = &mut first.get_mut().frame;
                let (bytes, count) = first_messages(frames, excess);
                self.dropped += count as u64;
                if bytes < frames.len() {
                    self.topic_bytes -= counted(frames);
                    frames.advance(bytes);
                    self.topic_bytes += counted(frames);
                } else {
                    self.take_out_first();
                }
            } else {
                debug_assert!(false, "bytes are counted that no message has");
                return;
            }
        }
    }
}
