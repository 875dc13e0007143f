//! Cleanup: ends calls whose time is over, and the leftovers of clients that have gone.
//!
//! **Invariant:** however many end at one instant, all others have a turn after every few of them.

use actix::prelude::*;
use tokio::time::{Instant, sleep_until};

use crate::actors::gateway::registry::refusal::Refusal;
use crate::actors::gateway::registry::state::Registry;

/// Calls, goals and registrations that are ended in a row, which takes a third of a millisecond.
const ENDED_IN_A_ROW: usize = 128;

impl Registry {
    /// Schedules the next cleanup: at once if there are leftovers, else when the first call's time is over.
    pub(crate) fn schedule_cleanup(&mut self, ctx: &mut Context<Self>) {
        let left = (!self.pending_cleanup.is_empty()).then(Instant::now);
        let Some(due) = left.or_else(|| self.services.next_deadline()) else {
            return;
        };
        if let Some((at, waiting)) = self.next_cleanup {
            if at <= due {
                return;
            }
            ctx.cancel_future(waiting);
        }
        let wait = async move {
            tokio::task::yield_now().await;
            sleep_until(due).await;
        };
        let waiting = ctx.spawn(wait.into_actor(self).map(|(), registry, ctx| {
            registry.next_cleanup = None;
            registry.clean_up_some();
            registry.schedule_cleanup(ctx);
        }));
        self.next_cleanup = Some((due, waiting));
    }

    /// Ends some of what is to be ended: calls whose time is over first.
    fn clean_up_some(&mut self) {
        let now = Instant::now();
        for _ in 0..ENDED_IN_A_ROW {
            if let Some(call) = self.services.take_due(now) {
                let why = Refusal::TimedOut(call.service.to_string());
                self.answer_forwarded(&call, &why);
            } else if let Some(number) = self.pending_cleanup.next_goal() {
                self.end_goal(number);
            } else if let Some(number) = self.pending_cleanup.next_call() {
                self.end_call(number);
            } else if let Some((client, registration)) = self.pending_cleanup.next_registration() {
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

    /// A goal's action server has gone. It may have ended otherwise.
    fn end_goal(&mut self, number: u64) {
        if let Some(goal) = self.action_servers.take(number) {
            let why = Refusal::ProviderGone(goal.action.to_string());
            self.abort(&goal, &why);
        }
    }
}
