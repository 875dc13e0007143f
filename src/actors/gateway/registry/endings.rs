//! Ends of calls and goals that nobody will answer: their time is over, or their provider has gone.
//!
//! **Invariant:** however many end at one instant, everybody else has a turn after every few of them.

use std::collections::{BTreeSet, VecDeque};

use actix::prelude::*;
use tokio::time::{Instant, sleep_until};

use super::refusal::Refusal;
use super::state::Registry;

/// Calls and goals that are ended in a row: a third of a millisecond's.
const ENDED_IN_A_ROW: usize = 128;

/// What is to be ended, beside the calls whose time will be over. Numbers stand together as they were left.
#[derive(Default)]
pub(super) struct Endings {
    /// Calls whose providers have gone.
    calls: VecDeque<BTreeSet<u64>>,
    /// Goals whose pursuers have gone.
    goals: VecDeque<BTreeSet<u64>>,
    /// When the registry looks at it next, and the task that waits for that.
    look: Option<(Instant, SpawnHandle)>,
}

impl Endings {
    /// Somebody has gone who pursued these goals and provided these calls.
    pub(super) fn leave(&mut self, goals: BTreeSet<u64>, calls: BTreeSet<u64>) {
        self.goals.push_back(goals);
        self.calls.push_back(calls);
    }

    fn is_empty(&self) -> bool {
        self.goals.is_empty() && self.calls.is_empty()
    }
}

/// Takes the next number out.
fn next(left: &mut VecDeque<BTreeSet<u64>>) -> Option<u64> {
    while let Some(numbers) = left.front_mut() {
        if let Some(number) = numbers.pop_first() {
            return Some(number);
        }
        left.pop_front();
    }
    None
}

impl Registry {
    /// Has a look taken at what is to be ended, in time for the next.
    pub(super) fn look_at_endings(&mut self, ctx: &mut Context<Self>) {
        let left = (!self.endings.is_empty()).then(Instant::now);
        let Some(due) = left.or_else(|| self.services.next_deadline()) else {
            return;
        };
        if let Some((look, waiting)) = self.endings.look {
            if look <= due {
                return;
            }
            ctx.cancel_future(waiting);
        }
        let wait = async move {
            tokio::task::yield_now().await;
            sleep_until(due).await;
        };
        let waiting = ctx.spawn(wait.into_actor(self).map(|(), registry, ctx| {
            registry.endings.look = None;
            registry.end_some();
            registry.look_at_endings(ctx);
        }));
        self.endings.look = Some((due, waiting));
    }

    /// Ends some of what is to be ended.
    fn end_some(&mut self) {
        let now = Instant::now();
        for _ in 0..ENDED_IN_A_ROW {
            if let Some(call) = self.services.take_due(now) {
                let why = Refusal::TimedOut(call.service.to_string());
                self.answer_forwarded(&call, &why);
            } else if let Some(number) = next(&mut self.endings.goals) {
                self.end_goal(number);
            } else if let Some(number) = next(&mut self.endings.calls) {
                self.end_call(number);
            } else {
                return;
            }
        }
    }

    /// A call's provider has gone. It may have ended otherwise.
    fn end_call(&mut self, number: u64) {
        if let Some(call) = self.services.take(number) {
            let why = Refusal::ProviderGone(call.service.to_string());
            self.answer_forwarded(&call, &why);
        }
    }

    /// A goal's pursuer has gone. It may have ended otherwise.
    fn end_goal(&mut self, number: u64) {
        if let Some(goal) = self.pursuers.take(number) {
            let why = Refusal::ProviderGone(goal.action.to_string());
            self.abort(&goal, &why);
        }
    }
}
