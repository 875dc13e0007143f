//! Throttled topics: which messages are held back, and when they enter the queue. Also `queue_length`, and feedback of
//! goals, which is never held.
//!
//! **Invariant:** a held message gets its place in the queue when it is released.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Instant;

use bytes::Bytes;

use super::Outbox;
use super::message::QueuedMessage;
use super::throttle::Throttle;
use crate::protocol::limits::MEDIUM;
use crate::protocol::wire::lines::{by_itself, first_message, last_messages, messages};

impl Outbox {
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
    pub(super) fn offer(&mut self, topic: &Arc<str>, mut frames: Bytes, now: Instant) {
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
    pub(super) fn keep_to_queue_length(&mut self, topic: &Arc<str>) {
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
    pub(super) fn release(&mut self, now: Instant) {
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
}
