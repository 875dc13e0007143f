//! Faults: clients that stall, disconnect or panic, and jumps of the clock.

use std::time::Duration;

use tokio::time::Instant;

use super::Course;
use crate::honest::{Expect, Honest};
use crate::model::Provided;
use crate::pipe::Fate;
use crate::plan::Fault;

impl Course {
    /// A client reads nothing for some time.
    pub(super) fn stall(&mut self, at: usize) {
        let time = Duration::from_millis(100 + self.court.below(12_000) as u64);
        let one = &mut self.honest[at];
        one.client.pause(true);
        one.is_hampered = true;
        one.stalled_until = Some(Instant::now() + time);
    }

    /// Replaces a disconnected client. The last messages of the old client may not have arrived.
    pub(super) fn replace(&mut self, at: usize) -> Honest {
        self.abandon(at);
        self.enter()
    }

    /// Ends the connection of a client so that no answers to it are required.
    pub(super) fn abandon(&mut self, at: usize) {
        let one = &mut self.honest[at];
        for call in one.calls.values() {
            // Its provider may be notified that the call was cancelled.
            if let Expect::Forwarded(number) = call.expect {
                self.model.forwards.remove(&number);
                self.model.orphans += 1;
            }
        }
        one.excuse();
        let (who, handled) = (one.who, one.handled);
        let mut doubtful = one.published.clone();
        doubtful.retain(|_, order| *order >= handled);
        for other in &mut self.honest {
            for subscription in other.subscriptions.values_mut() {
                subscription.newest.remove(&who);
                let pending = subscription.pending.get_mut(&who).into_iter().flatten();
                pending.for_each(|(number, must)| *must &= !doubtful.contains_key(number));
            }
        }
        self.lose_provider(who);
    }

    /// A client provides nothing any more.
    fn lose_provider(&mut self, who: u64) {
        let forwards = self.model.forwards.values_mut();
        for one in forwards.filter(|one| one.heard_by == Some(who) && one.answered.is_none()) {
            one.orphaned.get_or_insert(Instant::now());
        }
        let changed = self.court.turns.get();
        let services = self.model.services.values_mut();
        for provided in services.filter(|one| one.provider == Some(who)) {
            *provided = Provided::none(changed);
        }
    }

    pub(super) async fn fault(&mut self, fault: Fault) {
        self.court.note("fault", format!("{fault:?}").as_bytes());
        let at = self.court.below(self.honest.len());
        match fault {
            Fault::Stall => self.stall(at),
            Fault::Vanish => self.honest[at] = self.replace(at),
            Fault::ResetMidFrame => {
                self.abandon(at);
                self.honest[at]
                    .client
                    .send_bytes(b"{\"op\":\"publish\",\"topic\":\"/t0\",\"msg\":{\"unfin".to_vec());
                self.world.turns(3).await;
                self.look();
                self.honest[at] = self.replace(at);
            }
            Fault::PanicInPipe => {
                self.abandon(at);
                self.honest[at].fate.set(Fate::Panics);
                // An unused pipe would not reach that byte.
                self.honest[at].client.send_bytes(b" ".to_vec());
            }
            Fault::HalfClose => {
                let one = &mut self.honest[at];
                one.client.finish();
                one.has_finished = true;
                one.is_hampered = true;
                let who = one.who;
                // Its calls may be forgotten before their providers answer.
                self.model.orphans += one.calls.len() as u64;
                self.lose_provider(who);
            }
            Fault::Jump => {
                // Sent bytes arrive first, because a frame that is incomplete at the jump would exceed its time.
                self.resume();
                self.world.until_quiet().await;
                self.look();
                // The latest answers of providers also arrive first. Providers give no others until then.
                self.world.until_quiet().await;
                self.listen(false);
                let time =
                    Duration::from_millis(self.court.among(&[250, 300, 1000, 9_000, 14_000]));
                self.world.jump(time).await;
                // Providers now give the answers that were due in the meantime.
                let now = Instant::now();
                for (due, number, _) in self.honest.iter().flat_map(|one| &one.due_answers) {
                    if let Some(forward) = self.model.forwards.get_mut(number)
                        && let Some((when, ..)) = &mut forward.answered
                    {
                        *when = now.max(*due);
                    }
                }
                self.world.turns(100).await;
            }
            Fault::PanicInComputation => self.world.submit_panic(),
            Fault::ProviderLost => {
                let mut providers = self.model.services.values().filter_map(|one| one.provider);
                let lost =
                    providers.find_map(|who| self.honest.iter().position(|one| one.who == who));
                if let Some(lost) = lost {
                    self.honest[lost] = self.replace(lost);
                }
            }
        }
    }

    /// All stalled clients read again.
    pub(super) fn resume(&mut self) {
        for one in &mut self.honest {
            one.client.pause(false);
            one.stalled_until = None;
        }
    }
}
