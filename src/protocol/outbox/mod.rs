//! The outbox of one connection holds what waits to be written: bounded, in order, throttled where the client asked
//! for it.
//!
//! Topic messages may be lost, oldest first; responses may not. Both leave in the order in which they were produced.
//! A message that `throttle_rate` holds back takes its place in that order when its time comes.
//!
//! A [series](crate::protocol::wire::series) is queued as one piece, and dropped and held back message by message.
//!
//! It is told the time, and knows no socket and no clock.
//!
//! **Invariant:** dropping removes whole messages, never reorders; at most [`MAX_TOPIC_BYTES`] of topic messages
//! wait, held back ones included.

pub(crate) mod blocks;
mod dropping;
mod throttle;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;

use crate::protocol::limits::MAX_FRAME;
use crate::protocol::outbox::blocks::Blocks;
use crate::protocol::outbox::throttle::Throttles;
use crate::protocol::wire::series::{first_message, last_messages, messages};

/// Most bytes of topic messages that wait for one connection: the longest message that a client may send (and the
/// newline behind it), or minutes of the arm's own.
pub const MAX_TOPIC_BYTES: usize = MAX_FRAME + 1;
/// Bytes that a frame takes beside its own: its reference count, its place in a queue that may be twice as long as what
/// is in it, and what the allocator adds to each.
pub const FRAME_BYTES: usize = 192;
/// Bytes of a place in the queue of topic messages, or among those that are held back or to be encoded. The queue may
/// be twice as long as what is in it, and three times while it grows.
pub const PLACE_BYTES: usize = 128;

/// The outgoing queue of one connection.
#[derive(Debug, Default)]
pub struct Outbox {
    /// Topic messages in order, each with its number.
    topics: Blocks<(u64, Bytes)>,
    /// Responses and statuses in order, each with its number.
    responses: Blocks<(u64, Bytes)>,
    throttles: Throttles,
    /// Numbers given so far. The lower number leaves first, and is the older where messages are dropped.
    produced: u64,
    /// Bytes of queued topic messages, without those held back.
    topic_bytes: usize,
    /// Bytes of responses that are queued or being written.
    response_bytes: usize,
    /// The frames that are being written.
    in_flight: VecDeque<InFlight>,
    /// Bytes of the topic messages among them, each whole, their places included.
    writing_cost: usize,
    /// Responses that are queued or being written.
    response_count: usize,
    dropped: u64,
    /// Topic messages that are wanted no more.
    given_up: Vec<Bytes>,
}

/// A frame that is being written.
#[derive(Debug)]
struct InFlight {
    /// Bytes of the whole.
    length: usize,
    /// Bytes of it that have not been written.
    left: usize,
    is_response: bool,
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
        self.release(now);
        if !self.may_fit(&frame) {
            return;
        }
        if self.throttles.concerns(topic) {
            self.offer(topic, frame, now);
        } else {
            let number = self.number();
            self.enqueue(number, frame);
        }
        self.keep_bounded();
    }

    /// Adds feedback of a goal. It may be lost as a message may, but no throttle holds it back, not even that of a
    /// topic with the action's name.
    pub fn push_feedback(&mut self, frame: Bytes) {
        if !self.may_fit(&frame) {
            return;
        }
        let number = self.number();
        self.enqueue(number, frame);
        self.keep_bounded();
    }

    /// Whether [`push`](Self::push) and [`take_frames`](Self::take_frames) look at the time that they are given.
    #[must_use]
    pub fn is_throttled(&self) -> bool {
        !self.throttles.is_empty()
    }

    /// Adds a response or a status. Messages of the topics in `supersedes` that throttling holds back are older, and
    /// are discarded.
    pub fn push_response(&mut self, frame: Bytes, supersedes: &[&str]) {
        for topic in supersedes {
            let held = self.throttles.discard(topic);
            self.give_up(held);
        }
        self.response_bytes += frame.len();
        self.response_count += 1;
        let number = self.number();
        self.responses.push_back((number, frame));
    }

    /// Sets the least time between deliveries on a topic and how many messages that may hold back, or lifts both
    /// (`None`, or no time at all). What is held back then counts as produced now.
    pub fn set_throttle(&mut self, topic: &Arc<str>, throttle: Option<(Duration, usize)>) {
        match throttle.filter(|(interval, _)| !interval.is_zero()) {
            Some((interval, queue_length)) => {
                let given_up = &mut self.given_up;
                self.throttles.set(topic, interval, queue_length, given_up);
            }
            None => {
                for (_, frame) in self.throttles.forget(topic) {
                    let number = self.number();
                    self.enqueue(number, frame);
                }
            }
        }
    }

    /// Forgets a topic after an unsubscription: its throttle, and what is held back. What is queued still leaves.
    pub fn forget(&mut self, topic: &str) {
        let held = self.throttles.forget(topic);
        self.give_up(held);
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
        let mut bytes = 0;
        for taken in 0..max_frames.max(1) {
            let is_response = match (self.topics.front(), self.responses.front()) {
                (Some((topic, _)), Some((response, _))) => response < topic,
                (Some(_), None) => false,
                (None, Some(_)) => true,
                (None, None) => break,
            };
            let queue = if is_response {
                &mut self.responses
            } else {
                &mut self.topics
            };
            let Some((_, next)) = queue.front_mut() else {
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
            let frame = if length < next.len() {
                next.split_to(length)
            } else {
                let Some((_, whole)) = queue.pop_front() else {
                    break;
                };
                whole
            };
            if !is_response {
                self.topic_bytes -= length;
                self.writing_cost += length + FRAME_BYTES;
            }
            self.in_flight.push_back(InFlight {
                length,
                left: length,
                is_response,
            });
            frames.push(frame);
        }
    }

    /// Notes that the next `bytes` of what was taken have been written.
    pub fn written(&mut self, mut bytes: usize) {
        while let Some(frame) = self.in_flight.front_mut() {
            let done = bytes.min(frame.left);
            frame.left -= done;
            bytes -= done;
            if frame.is_response {
                self.response_bytes -= done;
            }
            if frame.left > 0 {
                return;
            }
            if frame.is_response {
                self.response_count -= 1;
            } else {
                self.writing_cost -= frame.length + FRAME_BYTES;
            }
            self.in_flight.pop_front();
        }
    }

    /// Moves out all that waits. What is being written stays, and counts until it has been.
    #[must_use]
    pub fn take_waiting(&mut self) -> Self {
        let responses = || self.in_flight.iter().filter(|frame| frame.is_response);
        let left = Self {
            response_bytes: responses().map(|frame| frame.left).sum(),
            response_count: responses().count(),
            writing_cost: self.writing_cost,
            in_flight: std::mem::take(&mut self.in_flight),
            ..Self::default()
        };
        std::mem::replace(self, left)
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

    /// Bytes of the waiting responses, their places included.
    #[must_use]
    pub const fn response_cost(&self) -> usize {
        self.response_bytes + self.response_count * FRAME_BYTES
    }

    /// How many topic messages, or series of them, wait, those held back included.
    #[must_use]
    pub fn topic_count(&self) -> usize {
        self.topics.len() + self.throttles.count()
    }

    /// Bytes of the topic messages that are being written, their places included. They can't be dropped any more, and
    /// each is there until its last byte has been taken.
    #[must_use]
    pub const fn writing_cost(&self) -> usize {
        self.writing_cost
    }

    /// Bytes of topic messages that wait, those held back included; at most [`MAX_TOPIC_BYTES`].
    #[must_use]
    pub const fn topic_bytes(&self) -> usize {
        self.topic_bytes + self.throttles.bytes()
    }

    /// Bytes of topic messages that may be taken now: without those held back.
    #[must_use]
    pub const fn queued_bytes(&self) -> usize {
        self.topic_bytes
    }

    /// Topic messages dropped so far for want of room. What throttling replaces by something newer is not counted.
    #[must_use]
    pub const fn dropped(&self) -> u64 {
        self.dropped
    }

    fn number(&mut self) -> u64 {
        self.produced += 1;
        self.produced
    }

    /// Gives the throttle each message by itself. Once one is held back, those behind it are too, and of these only the
    /// newest would be left.
    fn offer(&mut self, topic: &Arc<str>, mut frames: Bytes, now: Instant) {
        while !frames.is_empty() {
            let frame = frames.split_to(first_message(&frames));
            if !self.offer_one(topic, frame, now) {
                let left = self.throttles.queue_length(topic);
                for frame in messages(last_messages(frames, left)) {
                    self.offer_one(topic, frame, now);
                }
                return;
            }
        }
    }

    /// Gives the throttle a message; false if it is held back.
    fn offer_one(&mut self, topic: &Arc<str>, frame: Bytes, now: Instant) -> bool {
        let number = self.number();
        let frame = self.throttles.offer(topic, number, frame, now);
        let goes = frame.is_some();
        if let Some(frame) = frame {
            self.enqueue(number, frame);
        }
        goes
    }

    fn enqueue(&mut self, number: u64, frame: Bytes) {
        self.topic_bytes += frame.len();
        self.topics.push_back((number, frame));
    }

    /// Queues the held back messages whose time has come.
    fn release(&mut self, now: Instant) {
        if !self.is_throttled() {
            return;
        }
        while let Some(frame) = self.throttles.release(now) {
            let number = self.number();
            self.enqueue(number, frame);
        }
    }
}
