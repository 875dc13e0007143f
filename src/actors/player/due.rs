//! The part of the record that is due, and its way to the subscribers.
//!
//! **Invariant:** what is published next waits until what was has been offered to every subscriber.

use std::collections::BTreeSet;
use std::time::Duration;

use actix::prelude::*;
use tokio::time::Instant;

use super::{MAX_AT_ONCE, Player};
use crate::actors::gateway::messages::PublishInTurn;
use crate::actors::node::Publish;
use crate::protocol::catalog::Topic;
use crate::record::{Moment, ReadError};

/// After a longer stall the record goes on from where it stood.
const CATCH_UP: Duration = Duration::from_millis(250);
/// While the record stands, its present messages are published again so often, for who comes late.
const REPEAT: Duration = Duration::from_secs(1);
/// A message is present for so long: the slowest topic has one a second.
const PRESENT: Duration = Duration::from_millis(1500);
/// At the record's beginning a topic's first message is present already, if it comes so soon.
const SOON: Duration = Duration::from_millis(100);
/// Messages that are under way at once: at the largest speed, the way to the gateway's thread and back would else be
/// what holds the record up.
const UNDERWAY: usize = 8;
/// Where they had more subscribers together than this, the next goes alone.
const FEW: usize = 64;

impl<const N: usize> Player<N> {
    /// Computes where the record is to be by now.
    pub(super) fn tick(&mut self) {
        let now = Instant::now();
        let passed = (now - self.ticked).min(CATCH_UP);
        self.ticked = now;
        if !self.is_paused && (self.target.is_some() || !self.is_over()) {
            let passed = passed.mul_f64(self.rate.abs()).as_nanos();
            let passed = u64::try_from(passed).unwrap_or(u64::MAX);
            self.target = Some(if self.rate > 0.0 {
                let end = self.tape.reel.duration();
                self.position.saturating_add(passed).min(end)
            } else {
                self.position.saturating_sub(passed)
            });
            self.attempt(Self::queue_latched);
        } else if now >= self.repeat {
            self.repeat = now + REPEAT;
            self.attempt(Self::queue_all_present);
        }
    }

    /// Publishes what is due, as much of it as may be under way at once, and goes on when that has been offered to
    /// every subscriber.
    pub(super) fn go_on(&mut self, ctx: &mut Context<Self>) {
        if self.is_underway {
            return;
        }
        let mut messages = Vec::new();
        while messages.len() < self.at_once {
            let Some(moment) = self.attempt(Self::next_due).flatten() else {
                break;
            };
            match moment.frame() {
                Ok(frame) => messages.push(Publish {
                    topic: moment.topic,
                    frame: frame.into(),
                }),
                Err(error) => tracing::warn!(%error, "a message of the record is left out"),
            }
        }
        if messages.is_empty() {
            return;
        }
        self.is_underway = true;
        let publish = self.publish.send(PublishInTurn(messages));
        let offered = async move {
            let handled = publish.await.unwrap_or_default();
            let deliveries = handled.deliveries();
            handled.effect().await;
            deliveries
        };
        ctx.spawn(offered.into_actor(self).map(|deliveries, player, ctx| {
            player.is_underway = false;
            player.at_once = if deliveries > FEW { 1 } else { UNDERWAY };
            player.go_on(ctx);
        }));
    }

    /// The next message that is due: one that is pending, or else the record's next up to where it is to be.
    fn next_due(&mut self) -> Result<Option<Moment>, ReadError> {
        if let Some(moment) = self.pending.pop_front() {
            return Ok(Some(moment));
        }
        while let Some(target) = self.target
            && self.left > 0
        {
            self.left -= 1;
            let moment = if self.rate > 0.0 {
                self.tape.reel.forward(target)?
            } else {
                self.tape.reel.backward(target)?
            };
            let Some(moment) = moment else {
                self.position = target;
                self.target = None;
                break;
            };
            self.position = moment.time;
            if !moment.topic.is_latched() && self.wanted.contains(&moment.topic) {
                self.fresh.remove(&moment.topic);
                return Ok(Some(moment));
            }
        }
        Ok(None)
    }

    /// Queues the present messages of topics that have a new subscriber or were wound to another place. One look back
    /// costs as much for all of them as for one, so there is one a tick: nobody holds the record up by coming and
    /// going, or by winding it.
    pub(super) fn queue_fresh(&mut self) {
        if self.has_looked || self.fresh.is_empty() {
            return;
        }
        self.has_looked = true;
        let fresh = std::mem::take(&mut self.fresh);
        self.attempt(|player| {
            player.queue_latched()?;
            player.queue_present(&fresh)
        });
    }

    /// Drops the messages that are pending.
    pub(super) fn drop_pending(&mut self) {
        for moment in self.pending.drain(..) {
            // It has not been published.
            self.latched.remove(&moment.topic);
        }
    }

    /// Queues the messages that are present, and nothing else.
    pub(super) fn queue_all_present(&mut self) -> Result<(), ReadError> {
        self.drop_pending();
        self.queue_latched()?;
        self.fresh.clear();
        let wanted = self.wanted.clone();
        self.queue_present(&wanted)
    }

    /// Queues the last message of each of these topics, oldest first.
    pub(super) fn queue_present(&mut self, topics: &BTreeSet<Topic>) -> Result<(), ReadError> {
        let present = self.present(topics)?;
        self.pending.extend(present.into_iter().rev());
        Ok(())
    }

    /// The last message of each of these topics, newest first, as far as they have one that is not long past.
    pub(super) fn present(&mut self, topics: &BTreeSet<Topic>) -> Result<Vec<Moment>, ReadError> {
        let mut missing: BTreeSet<Topic> = topics
            .iter()
            .copied()
            .filter(|topic| !topic.is_latched() && self.tape.reel.holds(*topic))
            .collect();
        let place = self.tape.reel.place();
        let past = u64::try_from(PRESENT.as_nanos()).unwrap_or(u64::MAX);
        let past = self.position.saturating_sub(past);
        let mut found = Vec::new();
        for _ in 0..MAX_AT_ONCE {
            if missing.is_empty() {
                break;
            }
            let Some(moment) = self.tape.reel.backward(past)? else {
                break;
            };
            if missing.remove(&moment.topic) {
                found.push(moment);
            }
        }
        self.tape.reel.come_back(place);
        let soon = u64::try_from(SOON.as_nanos()).unwrap_or(u64::MAX);
        if self.position < soon {
            for _ in 0..MAX_AT_ONCE {
                if missing.is_empty() {
                    break;
                }
                let Some(moment) = self.tape.reel.forward(soon)? else {
                    break;
                };
                if missing.remove(&moment.topic) {
                    found.insert(0, moment);
                }
            }
            self.tape.reel.come_back(place);
        }
        Ok(found)
    }

    /// Queues the messages of latched topics that hold here and did not before.
    pub(super) fn queue_latched(&mut self) -> Result<(), ReadError> {
        let wanted: Vec<Topic> = self
            .wanted
            .iter()
            .copied()
            .filter(|topic| topic.is_latched())
            .collect();
        for topic in wanted {
            let place = self.tape.reel.latched(topic, self.position);
            if let Some(place) = place
                && self.latched.get(&topic) != Some(&place)
            {
                self.latched.insert(topic, place);
                if let Some(moment) = self.tape.reel.moment(place)? {
                    self.pending.retain(|waiting| waiting.topic != topic);
                    self.pending.push_back(moment);
                }
            }
        }
        Ok(())
    }
}
