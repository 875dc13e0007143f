//! `throttle_rate` and `queue_length`: the messages that one connection asked to have held back, topic by topic.
//!
//! **Invariant:** between two messages of a topic that are let go at least its interval passes, and of those held back
//! the newest remain.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;

use super::{HeldMessage, Outbox, Timestamp, TopicQueue, TopicThrottle, by_itself, counted};
use crate::protocol::limits::MEDIUM;
use crate::protocol::wire::series::{first_message, last_messages, messages};

/// How long a message of more than [`MEDIUM`] may be held back: it takes room that others wait for.
const MAX_HELD_BACK: Duration = Duration::from_secs(20);

impl TopicQueue {
    /// When the next message that is held back is due, if there is one.
    fn due(&self) -> Option<Instant> {
        let throttle = self.throttle.as_ref().filter(|_| !self.held.is_empty());
        throttle?.next()
    }
}

impl TopicThrottle {
    /// When the next message may go; `None`: at once.
    fn next(&self) -> Option<Instant> {
        self.last.and_then(|last| last.checked_add(self.interval))
    }

    fn is_due(&self, now: Instant) -> bool {
        self.next().is_none_or(|next| next <= now)
    }
}

impl Outbox {
    /// Sets the least time between deliveries on a topic and how many messages that may hold back, or lifts both
    /// (`None`, or no time at all). Messages held back then count as produced now.
    pub fn set_throttle(&mut self, topic: &Arc<str>, throttle: Option<(Duration, usize)>) {
        let Some((interval, queue_length)) = throttle.filter(|(interval, _)| !interval.is_zero())
        else {
            for held in self.lift_throttle(topic) {
                let number = self.number();
                self.enqueue(number, topic, held.since, held.frame);
            }
            return;
        };
        let queue = self.queues.entry(Arc::clone(topic)).or_default();
        let before = queue.throttle.take();
        self.throttled += usize::from(before.is_none());
        queue.throttle = Some(TopicThrottle {
            interval,
            queue_length: queue_length.max(1),
            last: before.and_then(|before| before.last),
        });
        self.trim_held(topic);
    }

    /// Gives the throttle each message by itself. Once one is held back, those behind it are too, and of these only the
    /// newest would be left.
    pub(super) fn offer(
        &mut self,
        topic: &Arc<str>,
        since: Timestamp,
        mut frames: Bytes,
        now: Instant,
    ) {
        let is_series = first_message(&frames) < frames.len();
        while !frames.is_empty() {
            let frame = by_itself(frames.split_to(first_message(&frames)), is_series);
            if !self.offer_one(topic, since, frame, now) {
                let throttle = self.queues.get(topic).and_then(|one| one.throttle.as_ref());
                let left = throttle.map_or(0, |throttle| throttle.queue_length);
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
        let number = self.number();
        let Some(queue) = self.queues.get_mut(topic) else {
            return true;
        };
        let Some(throttle) = &mut queue.throttle else {
            return true;
        };
        if queue.held.is_empty() && throttle.is_due(now) {
            throttle.last = Some(now);
            self.enqueue(number, topic, since, frame);
            return true;
        }
        let is_long = frame.len() > MEDIUM;
        if is_long && throttle.next().is_some_and(|due| due > now + MAX_HELD_BACK) {
            self.dropped += 1;
            return false;
        }
        self.held_count += 1;
        self.held_bytes += counted(&frame);
        queue.held.push_back(HeldMessage {
            number,
            since,
            frame,
        });
        self.trim_held(topic);
        false
    }

    /// Discards what is held back of a topic beyond its `queue_length`, the oldest first.
    fn trim_held(&mut self, topic: &str) {
        while self.queues.get(topic).is_some_and(|queue| {
            let throttle = queue.throttle.as_ref();
            throttle.is_some_and(|throttle| queue.held.len() > throttle.queue_length)
        }) {
            self.pop_held(topic);
        }
    }

    /// Takes the oldest message of a topic that is held back.
    pub(super) fn pop_held(&mut self, topic: &str) -> Option<HeldMessage> {
        let held = self.queues.get_mut(topic)?.held.pop_front()?;
        self.held_count -= 1;
        self.held_bytes -= counted(&held.frame);
        Some(held)
    }

    /// Takes all that is held back of a topic, oldest first; its throttle stays.
    pub(super) fn take_held(&mut self, topic: &str) -> VecDeque<HeldMessage> {
        let queue = self.queues.get_mut(topic);
        let held = queue.map(|queue| std::mem::take(&mut queue.held));
        let held = held.unwrap_or_default();
        self.held_count -= held.len();
        self.held_bytes -= held.iter().map(|held| counted(&held.frame)).sum::<usize>();
        held
    }

    /// Lifts the throttle of a topic and gives what was held back, oldest first.
    pub(super) fn lift_throttle(&mut self, topic: &str) -> VecDeque<HeldMessage> {
        let held = self.take_held(topic);
        if let Some(queue) = self.queues.get_mut(topic)
            && queue.throttle.take().is_some()
        {
            self.throttled -= 1;
            self.tidy(topic);
        }
        held
    }

    /// The topic of which a message is due first, and when. A client has at most some 200 topics.
    pub(super) fn next_due(&self) -> Option<(Instant, Arc<str>)> {
        if self.held_count == 0 {
            return None;
        }
        let queues = self.queues.iter();
        let due = queues.filter_map(|(topic, queue)| Some((queue.due()?, topic)));
        due.min().map(|(due, topic)| (due, Arc::clone(topic)))
    }

    /// Queues the held back messages whose time has come. The client has asked for that wait: their age counts from
    /// now.
    pub(super) fn release(&mut self, now: Instant) {
        if !self.is_throttled() {
            return;
        }
        let since = self.timestamp(now);
        while let Some((_, topic)) = self.next_due().filter(|(due, _)| *due <= now) {
            let Some(held) = self.pop_held(&topic) else {
                return;
            };
            let queue = self.queues.get_mut(&topic);
            if let Some(throttle) = queue.and_then(|queue| queue.throttle.as_mut()) {
                throttle.last = Some(now);
            }
            let number = self.number();
            self.enqueue(number, &topic, since, held.frame);
        }
    }

    /// The number and the topic of the message that was held back first.
    pub(super) fn oldest_held(&self) -> Option<(u64, Arc<str>)> {
        let queues = self.queues.iter();
        let oldest = queues.filter_map(|(topic, queue)| Some((queue.held.front()?.number, topic)));
        oldest
            .min()
            .map(|(number, topic)| (number, Arc::clone(topic)))
    }
}
