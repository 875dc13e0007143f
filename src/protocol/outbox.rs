//! What waits to be written to one connection: bounded, in order, throttled where the client asked for it.
//!
//! Topic messages may be lost, oldest first; responses may not. Both leave in the order in which they were produced. A message
//! that `throttle_rate` holds back takes its place in that order when its time comes.
//!
//! Told the time; knows no socket and no clock.
//!
//! **Invariant:** dropping removes, never reorders; at most [`MAX_TOPIC_BYTES`] of topic messages wait, held back ones included.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;

use super::throttle::Throttles;

/// Most bytes of topic messages that wait for one connection: the longest message that a client may send (and the newline
/// behind it), or minutes of the arm's own.
pub const MAX_TOPIC_BYTES: usize = super::frame::MAX_FRAME + 1;
/// Room for this many frames is kept while nothing waits: a tick's worth.
const KEPT_FRAMES: usize = 64;

/// The outgoing queue of one connection.
#[derive(Debug, Default)]
pub struct Outbox {
    /// Topic messages in order, each with its number.
    topics: VecDeque<(u64, Bytes)>,
    /// Responses and statuses in order, each with its number.
    responses: VecDeque<(u64, Bytes)>,
    throttles: Throttles,
    /// Numbers given so far. Of what is queued the lower leaves first; of what may be dropped the lower is the older.
    produced: u64,
    /// Bytes of queued topic messages, without those held back.
    topic_bytes: usize,
    /// Bytes of responses that are queued or being written.
    response_bytes: usize,
    /// What is being written: bytes left of each frame, and whether it is a response.
    in_flight: VecDeque<(usize, bool)>,
    dropped: u64,
    /// Fewer bytes of topic messages than usual may wait.
    scarce: Option<usize>,
}

impl Outbox {
    /// An empty outbox.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// From the next message on at most so many bytes of topic messages wait, and never more than [`MAX_TOPIC_BYTES`].
    pub fn limit_topics(&mut self, bytes: usize) {
        self.scarce = Some(bytes).filter(|bytes| *bytes < MAX_TOPIC_BYTES);
    }

    fn most_topic_bytes(&self) -> usize {
        self.scarce.unwrap_or(MAX_TOPIC_BYTES)
    }

    /// Adds a message on a topic: queued, or held back if the topic is throttled. If it does not fit, the oldest go.
    pub fn push(&mut self, topic: &Arc<str>, frame: Bytes, now: Instant) {
        self.release(now);
        if frame.len() > self.most_topic_bytes() {
            self.dropped += 1;
            return;
        }
        let number = self.number();
        if let Some(frame) = self.throttles.offer(topic, number, frame, now) {
            self.enqueue(number, frame);
        }
        self.make_room();
    }

    /// Adds a response or a status. What throttling holds back of the topics in `supersedes` is discarded: it is from before.
    pub fn push_response(&mut self, frame: Bytes, supersedes: &[&str]) {
        for topic in supersedes {
            self.throttles.discard(topic);
        }
        self.response_bytes += frame.len();
        let number = self.number();
        self.responses.push_back((number, frame));
    }

    /// Sets the least time between deliveries on a topic and how many messages that may hold back, or lifts both (`None`, or
    /// no time at all). What is held back then counts as produced now.
    pub fn set_throttle(&mut self, topic: &Arc<str>, throttle: Option<(Duration, usize)>) {
        for (_, frame) in self.throttles.set(topic, throttle) {
            let number = self.number();
            self.enqueue(number, frame);
        }
    }

    /// After an unsubscription: discards what is held back of a topic, and its throttle. What is queued leaves as it would have.
    pub fn forget(&mut self, topic: &str) {
        self.throttles.forget(topic);
    }

    /// Moves the next frames into `batch`, at least one if any waits, as many as `max_frames` and `max_bytes` allow. They count as being
    /// written until [`written`](Self::written) says otherwise.
    pub fn take_batch(
        &mut self,
        now: Instant,
        max_frames: usize,
        max_bytes: usize,
        batch: &mut Vec<Bytes>,
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
            let length = queue.front().map_or(0, |(_, frame)| frame.len());
            bytes += length;
            if taken > 0 && bytes > max_bytes {
                break;
            }
            let Some((_, frame)) = queue.pop_front() else {
                break;
            };
            if !is_response {
                self.topic_bytes -= length;
            }
            self.in_flight.push_back((length, is_response));
            batch.push(frame);
        }
        self.shrink();
    }

    /// The next `bytes` of what was taken have been written.
    pub fn written(&mut self, mut bytes: usize) {
        while let Some((left, is_response)) = self.in_flight.front_mut() {
            let done = bytes.min(*left);
            *left -= done;
            bytes -= done;
            if *is_response {
                self.response_bytes -= done;
            }
            if *left > 0 {
                return;
            }
            self.in_flight.pop_front();
        }
    }

    /// When the next held back message is due, if any is held back: the time to take a batch again.
    pub fn next_release(&mut self) -> Option<Instant> {
        self.throttles.next_release()
    }

    /// Whether there is nothing to be taken now (held back messages that are not due do not count).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.topics.is_empty() && self.responses.is_empty()
    }

    /// Bytes of responses that wait, those in the batch being written included.
    #[must_use]
    pub const fn response_bytes(&self) -> usize {
        self.response_bytes
    }

    /// Bytes of topic messages that wait, those held back included; at most [`MAX_TOPIC_BYTES`].
    #[must_use]
    pub const fn topic_bytes(&self) -> usize {
        self.topic_bytes + self.throttles.bytes()
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

    fn enqueue(&mut self, number: u64, frame: Bytes) {
        self.topic_bytes += frame.len();
        self.topics.push_back((number, frame));
    }

    /// Queues the held back messages whose time has come.
    fn release(&mut self, now: Instant) {
        while let Some(frame) = self.throttles.release(now) {
            let number = self.number();
            self.enqueue(number, frame);
        }
    }

    /// Drops the oldest topic messages until what is left fits: of the queue's first and the longest held back, the older.
    fn make_room(&mut self) {
        while self.topic_bytes() > self.most_topic_bytes() {
            let queued = self.topics.front().map(|(number, _)| *number);
            let held = self.throttles.oldest();
            if held.is_some_and(|held| queued.is_none_or(|queued| held < queued)) {
                self.throttles.drop_oldest();
            } else if let Some((_, frame)) = self.topics.pop_front() {
                self.topic_bytes -= frame.len();
            } else {
                debug_assert!(false, "bytes are counted that no message has");
                return;
            }
            self.dropped += 1;
        }
    }

    /// Gives back the memory of a burst once it has been taken.
    fn shrink(&mut self) {
        for queue in [&mut self.topics, &mut self.responses] {
            if queue.is_empty() && queue.capacity() > 4 * KEPT_FRAMES {
                queue.shrink_to(KEPT_FRAMES);
            }
        }
    }
}
