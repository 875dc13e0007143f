//! Ends of calls and goals that nobody will answer, their time being over or their provider gone, and of what those who
//! have gone had registered.
//!
//! **Invariant:** however many end at one instant, everybody else has a turn after every few of them.

use actix::prelude::*;
use tokio::time::{Instant, sleep_until};

use super::refusal::Refusal;
use super::state::Registry;

/// Calls, goals and registrations that are ended in a row: a third of a millisecond's.
const ENDED_IN_A_ROW: usize = 128;

impl Registry {
    /// Has a look taken at what is to be ended, in time for the next.
    pub(super) fn look_at_endings(&mut self, ctx: &mut Context<Self>) {
        let left = (!self.left.is_empty()).then(Instant::now);
        let Some(due) = left.or_else(|| self.services.next_deadline()) else {
            return;
        };
        if let Some((look, waiting)) = self.look {
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
            registry.look = None;
            registry.end_some();
            registry.look_at_endings(ctx);
        }));
        self.look = Some((due, waiting));
    }

    /// Ends some of what is to be ended.
    fn end_some(&mut self) {
        let now = Instant::now();
        for _ in 0..ENDED_IN_A_ROW {
            if let Some(call) = self.services.take_due(now) {
                let why = Refusal::TimedOut(call.service.to_string());
                self.answer_forwarded(&call, &why);
            } else if let Some(number) = self.left.next_goal() {
                self.end_goal(number);
            } else if let Some(number) = self.left.next_call() {
                self.end_call(number);
            } else if let Some((client, registration)) = self.left.next_registration() {
                self.withdraw_one(client, registration);
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
