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

mod dropping;
mod queues;
mod throttle;

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;

use crate::protocol::limits::{MAX_FRAME, MEDIUM, SHORT};
use crate::protocol::outbox::queues::{Queues, Timestamp, counted};
use crate::protocol::outbox::throttle::{HeldMessage, Throttles};
use crate::protocol::wire::series::{first_message, last_messages, messages};

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
    /// The topics of these, and how many messages of each may wait.
    queues: Queues,
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
    throttles: Throttles,
    /// The number of the last response.
    last_response: u64,
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

impl Default for Outbox {
    fn default() -> Self {
        Self {
            topics: BTreeMap::new(),
            queues: Queues::default(),
            looked_at: 0,
            is_behind: false,
            room: usize::MAX,
            fresh: MAX_AGE,
            epoch: None,
            responses: VecDeque::new(),
            throttles: Throttles::default(),
            last_response: 0,
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
        if self.throttles.concerns(topic) {
            self.offer(topic, since, frame, now);
        } else if self.queues.bound(topic).is_some() {
            let is_series = first_message(&frame) < frame.len();
            for frame in messages(frame) {
                let number = self.number();
                self.enqueue(number, topic, since, by_itself(frame, is_series));
            }
        } else {
            let number = self.number();
            self.enqueue(number, topic, since, frame);
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
    pub fn is_throttled(&self) -> bool {
        !self.throttles.is_empty()
    }

    /// Adds a response or a status. Messages of the topics in `supersedes` that throttling holds back are older, and
    /// are discarded.
    pub fn push_response(&mut self, frame: Bytes, supersedes: &[&str]) {
        for topic in supersedes {
            self.throttles.discard(topic);
        }
        self.response_bytes += frame.len();
        if frame.len() <= SHORT {
            self.short_bytes += frame.len();
        }
        self.last_response = self.number();
        self.responses.push_back((self.last_response, frame));
    }

    /// Sets the least time between deliveries on a topic and how many messages that may hold back, or lifts both
    /// (`None`, or no time at all). Messages held back then count as produced now.
    pub fn set_throttle(&mut self, topic: &Arc<str>, throttle: Option<(Duration, usize)>) {
        match throttle.filter(|(interval, _)| !interval.is_zero()) {
            Some((interval, queue_length)) => {
                self.throttles.set(topic, interval, queue_length);
            }
            None => {
                for held in self.throttles.forget(topic) {
                    let number = self.number();
                    self.enqueue(number, topic, held.since, held.frame);
                }
            }
        }
    }

    /// Sets how many messages of a topic may wait while the client does not take all that it is offered, the newest
    /// kept; `None` for any number.
    pub fn set_queue_length(&mut self, topic: &Arc<str>, queue_length: Option<usize>) {
        self.queues.set_bound(topic, queue_length);
    }

    /// Sets how many bytes of topic messages may be taken from now on. Messages ahead of a response are taken all
    /// the same, unless they are older than `fresh`. Then they are dropped, except the newest of its topic.
    pub const fn allow(&mut self, room: usize, fresh: Duration) {
        self.room = room;
        self.fresh = fresh;
    }

    /// Forgets a topic after an unsubscription: its throttle, and what is held back. Queued messages still leave.
    pub fn forget(&mut self, topic: &str) {
        self.throttles.forget(topic);
        self.queues.forget_bound(topic);
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
    pub fn next_release(&mut self) -> Option<Instant> {
        self.throttles.next_release()
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
        self.topics.len() + self.throttles.count()
    }

    /// Bytes of topic messages that wait, as they count, those held back included.
    #[must_use]
    pub const fn topic_bytes(&self) -> usize {
        self.topic_bytes + self.throttles.bytes()
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

    /// Gives the throttle each message by itself. Once one is held back, those behind it are too, and of these only the
    /// newest would be left.
    fn offer(&mut self, topic: &Arc<str>, since: Timestamp, mut frames: Bytes, now: Instant) {
        let is_series = first_message(&frames) < frames.len();
        while !frames.is_empty() {
            let frame = by_itself(frames.split_to(first_message(&frames)), is_series);
            if !self.offer_one(topic, since, frame, now) {
                let left = self.throttles.queue_length(topic);
                for frame in messages(last_messages(frames, left)) {
                    self.offer_one(topic, since, by_itself(frame, true), now);
                }
                return;
            }
        }
    }

    /// Gives the throttle a message; false if it is held back.
    fn offer_one(
        &mut self,
        topic: &Arc<str>,
        since: Timestamp,
        frame: Bytes,
        now: Instant,
    ) -> bool {
        if self.throttles.holds_for_long(topic, &frame, now) {
            self.dropped += 1;
            return false;
        }
        let number = self.number();
        let held = HeldMessage {
            number,
            since,
            frame,
        };
        let given_back = self.throttles.offer(topic, held, now);
        let goes = given_back.is_some();
        if let Some(message) = given_back {
            self.enqueue(number, topic, since, message.frame);
        }
        goes
    }

    fn enqueue(&mut self, number: u64, topic: &Arc<str>, since: Timestamp, frame: Bytes) {
        let before = self.queues.enter(topic, number);
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
            while let Some(surplus) = self.queues.surplus(topic) {
                self.drop_message(Some(surplus));
            }
        }
    }

    /// Queues the held back messages whose time has come. The client has asked for that wait: their age counts from
    /// now.
    fn release(&mut self, now: Instant) {
        if !self.is_throttled() {
            return;
        }
        let since = self.timestamp(now);
        while let Some((topic, held)) = self.throttles.release(now) {
            let number = self.number();
            self.enqueue(number, &topic, since, held.frame);
        }
    }
}
