//! The end of a seed: every required frame arrives, and the runtime holds nothing once all clients have left.

use std::time::Duration;

use tokio::time::Instant;

use super::Course;
use crate::court::Verdict;
use crate::honest::{Expect, Honest, Phase, Subscription};
use crate::workload::waits;

/// Virtual time after the last fault within which all required frames arrive.
const LIVENESS: Duration = Duration::from_secs(40);
/// Virtual time after the last disconnection after which no client's memory is held.
const EMPTY: Duration = Duration::from_secs(100);

impl Course {
    /// Without faults and hostile clients, all waiting messages arrive.
    pub(super) async fn come_to_rest(&mut self) {
        self.hostile.clear();
        self.resume();
        // Earlier bytes arrive before later ones.
        self.pass(Duration::from_millis(500)).await;
        // A goal ends when the arm is reset, and time passes when it is not paused.
        let mut sober = self.enter();
        for (id, service, args) in [
            ("\"end1\"", "/arm_sim/pause", "{\"data\":false}"),
            (
                "\"end2\"",
                "/arm_sim/set_integrator",
                "{\"method\":\"rk4\",\"timestep\":0.001}",
            ),
            ("\"end3\"", "/ik_trial/stop", "{}"),
            ("\"end4\"", "/arm_sim/reset", "{}"),
        ] {
            sober.send(&format!("{{\"op\":\"call_service\",\"id\":{id},\"service\":\"{service}\",\"args\":{args}}}"), 0);
            let expect = match service {
                "/ik_trial/stop" => Expect::Anything,
                _ => Expect::Success,
            };
            sober.note_call(id, service, expect, true, &self.court);
        }
        self.honest.push(sober);
        let began = Instant::now();
        while began.elapsed() < LIVENESS && self.court.failure().is_none() && !self.is_at_rest() {
            self.pass(Duration::from_millis(100)).await;
        }
        if self.court.failure().is_some() {
            return;
        }
        let waiting = self.honest.iter().filter(|one| !self.has_all(one));
        let waiting: Vec<String> = waiting.map(waits).collect();
        if !waiting.is_empty() {
            let words = format!(
                "{LIVENESS:?} after the last fault clients wait: {}",
                waiting.join(" | ")
            );
            return self.court.fail(Verdict::NoProgress, words);
        }
        self.check_messages();
    }

    /// Whether every required answer has arrived. Calls that may wait for a day do not count, nor do clients that have
    /// stopped sending.
    fn has_all(&self, one: &Honest) -> bool {
        let may_wait = |call: &Expect| match call {
            Expect::Forwarded(number) => self
                .model
                .forwards
                .get(number)
                .is_some_and(|one| one.timeout > LIVENESS),
            _ => false,
        };
        let is_answered = one.calls.values().all(|call| may_wait(&call.expect));
        one.is_excused || one.has_finished || (is_answered && one.news.is_empty())
    }

    fn is_at_rest(&self) -> bool {
        let is_quiet =
            |one: &Honest| self.has_all(one) && missing(one).is_empty() && stale(one).is_none();
        let mut all = self.honest.iter();
        all.all(|one| one.is_excused || one.has_finished || is_quiet(one))
            && self.world.pool.is_idle()
    }

    /// Every required message has arrived, and of a throttled topic the newest.
    fn check_messages(&mut self) {
        for one in self
            .honest
            .iter()
            .filter(|one| !one.is_excused && !one.has_finished)
        {
            // A hostile client's message may be newer.
            let is_quiet = !one.is_hampered && !self.plan.scarce && self.plan.hostile == 0;
            if let Some((topic, subscription)) = stale(one).filter(|_| is_quiet) {
                let (last, newest) = (subscription.last, &subscription.newest);
                self.court.wrong(format!(
                    "client {} has not received the newest on {topic}: {last:?}, not {newest:?}",
                    one.who
                ));
            }
            for (topic, numbers) in missing(one) {
                let which = format!("{numbers:?} on {topic}");
                self.model.miss(&self.court, one, numbers.len(), &which);
            }
        }
        self.check_dropped();
    }

    /// All disconnect, some with a close frame; no memory is held afterwards.
    pub(super) async fn leave(&mut self) {
        for at in 0..self.honest.len() {
            if self.court.chance(0.5) {
                self.honest[at].client.finish();
            }
        }
        self.world.turns(20).await;
        self.honest.clear();
        let began = Instant::now();
        while began.elapsed() < EMPTY && !self.world.is_empty() && self.court.failure().is_none() {
            self.world.glance(Duration::from_millis(100)).await;
        }
        if !self.world.is_empty() {
            let (taken, connections) = (self.world.taken(), self.world.gauges.connections());
            let idle = self.world.pool.is_idle();
            self.court.wrong(format!(
                "{EMPTY:?} after all have left {connections} are connected, {taken} permits are taken, and the pool is idle: {idle}"
            ));
        }
    }
}

/// The required messages that have not arrived, by topic.
fn missing(one: &Honest) -> Vec<(&String, Vec<u64>)> {
    let required = |one: &Subscription| -> Vec<u64> {
        let pending = one.pending.values().flatten().filter(|(_, must)| *must);
        pending.map(|(number, _)| *number).collect()
    };
    let all = one.subscriptions.iter();
    let mut all: Vec<_> = all.map(|(topic, one)| (topic, required(one))).collect();
    all.retain(|(_, numbers)| !numbers.is_empty());
    all
}

/// A throttled subscription without the newest message.
fn stale(one: &Honest) -> Option<(&String, &Subscription)> {
    let mut all = one.subscriptions.iter();
    all.find(|(_, one)| one.throttle.is_some() && !has_newest(one))
}

/// Whether the last received message is the last one of its publisher.
fn has_newest(one: &Subscription) -> bool {
    let last = one.last.map(|(number, _)| number);
    // A message from before the subscription, or of a disconnected client, may be handled after newer ones of others.
    let is_from_before = one
        .last_from
        .is_some_and(|from| !one.newest.contains_key(&from));
    one.phase != Phase::On
        || one.newest.is_empty()
        || is_from_before
        || one.newest.values().any(|newest| Some(*newest) <= last)
}
