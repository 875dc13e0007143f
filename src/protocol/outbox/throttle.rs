//! What a client asks for by `throttle_rate` and `queue_length`, and the messages that are held back for that.
//!
//! **Invariant:** between two messages of a topic that are let go at least its interval passes, and of those held back
//! the newest remain.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;

use super::{Outbox, by_itself, counted};
use crate::protocol::limits::MEDIUM;
use crate::protocol::wire::series::{first_message, last_messages, messages};

/// How long a message of more than [`MEDIUM`] may be held back: it takes room that others wait for.
const MAX_HELD_BACK: Duration = Duration::from_secs(20);

/// What a client has asked for of one topic.
#[derive(Debug, Default)]
pub(super) struct TopicLimits {
    /// How many messages may wait while the client does not take all that it is offered.
    pub(super) queue_length: Option<usize>,
    throttle: Option<TopicThrottle>,
    /// Messages that the throttle holds back.
    held: VecDeque<HeldMessage>,
}

/// The least time between two messages of a topic.
#[derive(Debug)]
struct TopicThrottle {
    interval: Duration,
    /// How many messages may be held back, 1 or more.
    most_held: usize,
    /// When the last message was let go.
    last: Option<Instant>,
}

/// A message that is held back.
#[derive(Debug)]
pub(super) struct HeldMessage {
    number: u64,
    /// When it was produced.
    since: Instant,
    frame: Bytes,
}

impl TopicLimits {
    pub(super) const fn is_throttled(&self) -> bool {
        self.throttle.is_some()
    }

    /// The number of the message that was held back first.
    pub(super) fn first_held(&self) -> Option<u64> {
        self.held.front().map(|held| held.number)
    }

    /// Takes the message that was held back first.
    pub(super) fn pop_held(&mut self) -> Option<HeldMessage> {
        self.held.pop_front()
    }

    /// When the next message that is held back is due, if there is one.
    fn due(&self) -> Option<Instant> {
        let throttle = self.throttle.as_ref().filter(|_| !self.held.is_empty());
        throttle?.next()
    }

    /// Takes what is held back beyond what may be, the oldest.
    fn trim(&mut self) -> Vec<HeldMessage> {
        let most = self.throttle.as_ref().map_or(0, |one| one.most_held);
        let surplus = self.held.len().saturating_sub(most);
        self.held.drain(..surplus).collect()
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
        let limits = self.limits.entry(Arc::clone(topic)).or_default();
        let before = limits.throttle.take();
        if let Some((interval, most_held)) = throttle.filter(|(interval, _)| !interval.is_zero()) {
            limits.throttle = Some(TopicThrottle {
                interval,
                most_held: most_held.max(1),
                last: before.and_then(|before| before.last),
            });
            let surplus = limits.trim();
            self.forget_held(&surplus);
            return;
        }
        for held in self.take_held(topic) {
            self.enqueue(Some(topic), held.since, held.frame);
        }
        self.keep_to_queue_length(topic);
        self.tidy(topic);
    }

    /// Sets how many messages of a topic may wait while the client does not take all that it is offered, the newest
    /// kept; `None` for any number.
    pub fn set_queue_length(&mut self, topic: &Arc<str>, queue_length: Option<usize>) {
        let limits = self.limits.entry(Arc::clone(topic)).or_default();
        limits.queue_length = queue_length;
        self.tidy(topic);
    }

    /// Forgets a topic after an unsubscription: its throttle, and what is held back. Queued messages still leave.
    pub fn forget(&mut self, topic: &str) {
        self.take_held(topic);
        self.limits.remove(topic);
    }

    /// Forgets the limits of a topic that has none.
    fn tidy(&mut self, topic: &str) {
        let limits = self.limits.get(topic);
        if limits.is_some_and(|one| one.throttle.is_none() && one.queue_length.is_none()) {
            self.limits.remove(topic);
        }
    }

    /// Gives the throttle each message by itself. Once one is held back, those behind it are too, and of these only the
    /// newest would be left.
    pub(super) fn offer(&mut self, topic: &Arc<str>, mut frames: Bytes, now: Instant) {
        let is_series = first_message(&frames) < frames.len();
        while !frames.is_empty() {
            let frame = by_itself(frames.split_to(first_message(&frames)), is_series);
            if !self.offer_one(topic, frame, now) {
                let throttle = self.limits.get(topic).and_then(|one| one.throttle.as_ref());
                let left = throttle.map_or(0, |throttle| throttle.most_held);
                for frame in messages(last_messages(frames, left)) {
                    self.offer_one(topic, by_itself(frame, true), now);
                }
                return;
            }
        }
    }

    /// Gives the throttle a message; false if it is held back.
    fn offer_one(&mut self, topic: &Arc<str>, frame: Bytes, now: Instant) -> bool {
        let number = self.number();
        let Some(limits) = self.limits.get_mut(topic) else {
            return true;
        };
        let Some(throttle) = &mut limits.throttle else {
            return true;
        };
        if limits.held.is_empty() && throttle.is_due(now) {
            throttle.last = Some(now);
            self.enqueue(Some(topic), now, frame);
            return true;
        }
        let is_long = frame.len() > MEDIUM;
        if is_long && throttle.next().is_some_and(|due| due > now + MAX_HELD_BACK) {
            self.dropped += 1;
            return false;
        }
        self.held_count += 1;
        self.held_bytes += counted(&frame);
        limits.held.push_back(HeldMessage {
            number,
            since: now,
            frame,
        });
        let surplus = limits.trim();
        self.forget_held(&surplus);
        false
    }

    /// These messages are no longer held back.
    pub(super) fn forget_held(&mut self, held: &[HeldMessage]) {
        self.held_count -= held.len();
        self.held_bytes -= held.iter().map(|held| counted(&held.frame)).sum::<usize>();
    }

    /// Takes all that is held back of a topic, oldest first; its throttle stays.
    pub(super) fn take_held(&mut self, topic: &str) -> Vec<HeldMessage> {
        let limits = self.limits.get_mut(topic);
        let held = limits.map_or_else(Vec::new, |limits| std::mem::take(&mut limits.held).into());
        self.forget_held(&held);
        held
    }

    /// When the next held back message is due, if any is held back: the time to take frames again.
    #[must_use]
    pub fn next_release(&self) -> Option<Instant> {
        self.next_due().map(|(due, _)| due)
    }

    /// The topic of which a message is due first, and when. A client has at most some 200 topics.
    fn next_due(&self) -> Option<(Instant, &Arc<str>)> {
        let limits = self.limits.iter();
        let due = limits.filter_map(|(topic, limits)| Some((limits.due()?, topic)));
        due.min()
    }

    /// Queues the held back messages whose time has come. The client has asked for that wait: their age counts from
    /// now.
    pub(super) fn release(&mut self, now: Instant) {
        if !self.holds_back() {
            return;
        }
        while let Some((_, topic)) = self.next_due().filter(|(due, _)| *due <= now) {
            let topic = Arc::clone(topic);
            let Some(limits) = self.limits.get_mut(&topic) else {
                return;
            };
            if let Some(throttle) = &mut limits.throttle {
                throttle.last = Some(now);
            }
            let held = limits.pop_held();
            self.forget_held(held.as_slice());
            if let Some(held) = held {
                self.enqueue(Some(&topic), now, held.frame);
            }
            self.keep_to_queue_length(&topic);
        }
    }
}
