//! The environment of the arm in a page: a clock, and one client with its subscriptions.
//!
//! **Invariant:** nothing is encoded for a topic without a subscription. Frames leave in the order of writing.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::time::Duration;

use bytes::Bytes;
use pendularm::live::{GoalProgress, World};
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::messages;
use pendularm::protocol::wire::json::Payload;

use super::Clock;

/// A subscription of the client.
struct Subscription {
    topic: Topic,
    /// The topic's name as the client spelled it.
    spelling: String,
    /// Least time between two messages.
    throttle: Duration,
    /// The time of the latest message.
    latest: Option<Duration>,
}

/// The clock, and the queue for the client.
pub(super) struct Surroundings<const N: usize> {
    clock: Clock,
    subscriptions: RefCell<Vec<Subscription>>,
    frames: RefCell<Vec<u8>>,
    progress: RefCell<VecDeque<GoalProgress<N>>>,
}

impl<const N: usize> Surroundings<N> {
    pub(super) fn new(clock: Clock) -> Self {
        Self {
            clock,
            subscriptions: RefCell::default(),
            frames: RefCell::default(),
            progress: RefCell::default(),
        }
    }

    pub(super) fn clock(&self) -> Clock {
        self.clock
    }

    pub(super) fn subscribe(&self, topic: Topic, spelling: &str, throttle: Duration) {
        self.unsubscribe(topic);
        self.subscriptions.borrow_mut().push(Subscription {
            topic,
            spelling: spelling.to_owned(),
            throttle,
            latest: None,
        });
    }

    pub(super) fn unsubscribe(&self, topic: Topic) {
        let mut all = self.subscriptions.borrow_mut();
        all.retain(|one| one.topic != topic);
    }

    /// Sends the message of `write`, if a subscription is due.
    fn deliver(&self, topic: Topic, write: impl FnOnce() -> Bytes) {
        let mut all = self.subscriptions.borrow_mut();
        let Some(one) = all.iter_mut().find(|one| one.topic == topic) else {
            return;
        };
        let now = (self.clock)();
        let is_early = |latest: Duration| now.saturating_sub(latest) < one.throttle;
        if !one.latest.is_some_and(is_early) {
            one.latest = Some(now);
            let frame = messages::respelled(topic.name(), &one.spelling, &write());
            self.send(&frame);
        }
    }

    /// Sends the client its own message.
    pub(super) fn pass_on(&self, topic: Topic, msg: &Payload) {
        self.deliver(topic, || messages::publish_raw(topic.name(), msg));
    }

    pub(super) fn send(&self, frame: &[u8]) {
        self.frames.borrow_mut().extend_from_slice(frame);
    }

    pub(super) fn take_frames(&self) -> Vec<u8> {
        self.frames.take()
    }

    pub(super) fn next_progress(&self) -> Option<GoalProgress<N>> {
        self.progress.borrow_mut().pop_front()
    }
}

impl<const N: usize> World<N> for Surroundings<N> {
    fn now(&self) -> Duration {
        (self.clock)()
    }

    fn work_time(&self) -> Duration {
        (self.clock)()
    }

    fn publish(&self, topic: Topic, write: impl FnOnce() -> Bytes + Send + 'static) {
        self.deliver(topic, write);
    }

    fn tell(&self, progress: GoalProgress<N>) {
        self.progress.borrow_mut().push_back(progress);
    }

    fn clients(&self) -> (u64, u64) {
        (1, 0)
    }
}
