//! Messages that a client receives on a topic: the expected ones, unchanged, in order and within the throttle.

use std::time::Duration;

use tokio::time::Instant;

use super::Model;
use super::body::Body;
use crate::court::Court;
use crate::honest::{Honest, Phase};

/// Longest virtual time between two checks of the received messages.
const LOOKS_APART: Duration = Duration::from_millis(25);

impl Model {
    pub(super) fn hear_message(
        &mut self,
        court: &Court,
        honest: &mut Honest,
        topic: &str,
        body: Body<'_>,
    ) {
        let who = honest.who;
        let Some(subscription) = honest.subscriptions.get_mut(topic) else {
            if !honest.watched.contains(topic) {
                court.wrong(format!("client {who} has not subscribed to {topic}"));
            }
            return;
        };
        if subscription.is_binary != matches!(body, Body::Binary(_)) {
            // Messages already on their way when the encoding changed have the old encoding.
            if subscription.phase == Phase::On {
                court.wrong(format!(
                    "client {who} got a message on {topic} in the wrong encoding"
                ));
            }
        }
        // A hostile client's message has no number.
        let Some((from, number)) = body.origin() else {
            return;
        };
        let expected = self
            .messages
            .get(&number)
            .map_or("", |message| &message.body);
        if !body.is(expected) {
            return court.wrong(format!(
                "message {number} came to client {who} changed: {body:?} instead of {expected}"
            ));
        }
        let pending = subscription.pending.entry(from).or_default();
        let Some(place) = pending.iter().position(|(one, _)| *one == number) else {
            return court.wrong(format!(
                "message {number} of client {from} came to client {who} twice, out of order or unasked; its last was {:?}",
                subscription.last
            ));
        };
        let skipped = pending
            .drain(..=place)
            .take(place)
            .filter(|(_, must)| *must)
            .count();
        if let (Some(interval), Some((_, before))) = (subscription.throttle, subscription.last)
            && subscription.phase == Phase::On
            && !honest.is_hampered
            && before.elapsed() + LOOKS_APART < interval
        {
            court.wrong(format!(
                "client {who} received {topic} after {:?}, not {interval:?}",
                before.elapsed()
            ));
        }
        subscription.last = Some((number, Instant::now()));
        subscription.last_from = Some(from);
        court.count("messages received");
        if skipped > 0 {
            self.miss(
                court,
                honest,
                skipped,
                &format!("before message {number} on {topic}"),
            );
        }
    }

    /// A client misses messages: allowed only if it did not read, if memory was scarce, or if its pipe was too narrow.
    pub fn miss(&mut self, court: &Court, honest: &Honest, count: usize, which: &str) {
        self.missed += count as u64;
        if !honest.is_hampered && !self.is_scarce && !self.is_overrun {
            court.wrong(format!(
                "client {} lacks {count} messages {which}",
                honest.who
            ));
        }
    }
}
