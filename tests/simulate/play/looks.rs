//! Checks: received frames agree with the model, and no client is disconnected or waits too long.

use std::time::Duration;

use tokio::time::Instant;

use super::Course;
use crate::court::Verdict;
use crate::honest::Expect;

/// Turns within which a light call is answered if its caller reads. They include the turns for all other frames.
const LIGHT_TURNS: u64 = 30_000;
/// Turns within which a computation ends, counted from the end of the client's previous one, for each client that
/// computes. The longest computation of honest clients takes some 1,000 turns if no other client computes.
const COMPUTED_TURNS: u64 = 2_000;
/// The same for a short computation. In 2,000 seeds the longest took 43 turns, during a flood, and all others fewer
/// than 40.
const SHORT_TURNS: u64 = 80;
/// Longest wait of a light call in virtual time.
const LIGHT_TIME: Duration = Duration::from_secs(1);

impl Course {
    /// Lets virtual time pass, with regular checks.
    pub(super) async fn pass(&mut self, time: Duration) {
        let mut left = time;
        while !left.is_zero() && self.court.failure().is_none() {
            left -= self.world.glance(left).await;
            self.look();
        }
    }

    /// Compares received frames with the model; providers answer.
    pub(super) fn look(&mut self) {
        self.listen(true);
    }

    pub(super) fn listen(&mut self, answers: bool) {
        let now = Instant::now();
        for at in 0..self.honest.len() {
            let one = &mut self.honest[at];
            if one.stalled_until.is_some_and(|until| until <= now) {
                one.stalled_until = None;
                one.client.pause(false);
            }
            for received in one.client.take() {
                self.model.hear(&self.court, &mut self.honest[at], received);
            }
            if answers {
                self.workload(at).answer_calls();
            }
            self.check_end(at);
            self.check_patience(at);
        }
        for one in &mut self.hostile {
            if !one.client.is_paused() {
                one.client.take_anything();
            }
        }
        self.check_dropped();
    }

    /// Every missing message is counted.
    pub(super) fn check_dropped(&self) {
        let (missed, dropped) = (self.model.missed, self.world.gauges.messages_dropped());
        if missed > dropped {
            let words = format!("{missed} messages are missing, and {dropped} counted as dropped");
            self.court.wrong(words);
        }
    }

    /// No client is disconnected.
    fn check_end(&mut self, at: usize) {
        let one = &self.honest[at];
        if one.is_excused || one.has_finished || !one.client.has_ended() {
            return;
        }
        let (who, rest) = (one.who, one.client.rest());
        self.court
            .wrong(format!("client {who} was cut off: {rest}"));
    }

    fn check_patience(&mut self, at: usize) {
        let one = &self.honest[at];
        let (court, turns) = (&self.court, self.court.turns.get());
        if one.is_excused || one.is_hampered || self.plan.scarce {
            return;
        }
        for call in one.calls.values() {
            let Expect::Forwarded(number) = call.expect else {
                continue;
            };
            let forward = self.model.forwards.get(&number);
            let late = forward.is_some_and(|one| one.since.elapsed() > one.timeout + LIGHT_TIME);
            if late && court.jumps.get() == 0 {
                let words = format!("{} has taken longer than its caller waits", call.what);
                court.fail(Verdict::NoProgress, words);
            }
        }
        // Its computations run one after the other.
        let computations = one.calls.values().filter(|call| call.is_computation());
        if let Some(next) = computations.min_by_key(|call| call.order)
            && let Expect::Computed { is_short, .. } = next.expect
        {
            let taken = turns - next.turns.max(one.computed);
            let clients = (self.honest.len() + self.hostile.len()) as u64;
            // Without long frames a short computation gets its turns soon, for any load by others. Frames in small
            // pieces delay the client's next frame.
            let is_wide = self.plan.room >= 1 << 16 && self.plan.piece >= 1 << 16;
            let each = if is_wide && is_short {
                SHORT_TURNS
            } else {
                COMPUTED_TURNS
            };
            if taken > each * (1 + clients) {
                let words = format!(
                    "{:.80} has waited for {taken} turns beside {clients} clients",
                    next.what
                );
                court.fail(Verdict::NoProgress, words);
            }
        }
        for (id, call) in one.calls.iter().filter(|(_, call)| call.is_light) {
            let (time, taken) = (call.since.elapsed(), turns - call.turns);
            if (time > LIGHT_TIME && court.jumps.get() == 0) || taken > LIGHT_TURNS {
                let words = format!(
                    "{} with id {id} is unanswered after {time:?} and {taken} turns",
                    call.what
                );
                court.fail(Verdict::NoProgress, words);
            }
        }
    }
}
