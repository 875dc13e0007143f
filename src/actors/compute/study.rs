//! `/study/*`, predictions and offline runs, and `/arm_sim/integration_step`, on the worker pool. None has an effect on
//! the live arm.
//!
//! A missing value is requested from the arm when the computation begins. The arm itself does not change. A connection
//! submits one computation at a time.
//!
//! **Invariant:** a call is answered once, and blocks neither the arm nor another client. It waits for memory for its answer,
//! and stops when its caller disconnects.

use std::time::Duration;

use actix::prelude::*;
use tokio::sync::oneshot;

use super::workers::{Computation, Progress, WorkerPool};
use crate::actors::arm::sim::{ArmSettings, HeldLimit};
use crate::actors::node::{Call, Nodes, Reply, Unserved};
use crate::actors::resources::work_clock;
use crate::protocol::catalog::Service;
pub use crate::services::study::{
    AnalyseMethod, Beside, Changed, FindHeldLimit, IntegrationStep, PlanRun, PlannedRun,
    PredictStability, Predicted, Ran, Refused, RunOffline, SuggestGains, Suggested,
};
use crate::services::study::{Computed, Integrating, Work};
use crate::study::clocks::{ClockLimits, clock_limits};
use crate::study::control_loop::ControlLoop;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `study` for an arm of `N` links.
pub struct Study<const N: usize> {
    arm: Recipient<ArmSettings<N>>,
    workers: WorkerPool,
}

impl<const N: usize> Study<N> {
    /// A node that requests settings from `arm` and computes on `workers`.
    #[must_use]
    pub fn new(arm: Recipient<ArmSettings<N>>, workers: WorkerPool) -> Self {
        Self { arm, workers }
    }

    /// Enters this node's services into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<PredictStability<N>>(Service::Stability, address.clone());
        nodes.serve::<FindHeldLimit>(Service::HeldLimit, address.clone());
        nodes.serve::<AnalyseMethod<N>>(Service::Method, address.clone());
        nodes.serve::<Beside<RunOffline<N>>>(Service::Rollout, address.clone());
        nodes.serve::<SuggestGains<N>>(Service::SuggestGains, address.clone());
        nodes.serve::<Beside<PlanRun<N>>>(Service::Plan, address.clone());
        nodes.serve::<IntegrationStep>(Service::IntegrationStep, address.clone());
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for Study<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

/// Asks the arm for its present settings, then hands the work to the workers.
impl<const N: usize, A: Computed<N>> Handler<Call<A>> for Study<N> {
    type Result = ();

    fn handle(&mut self, call: Call<A>, ctx: &mut Context<Self>) {
        let Call { ask, mut reply } = call;
        let present = self.arm.send(ArmSettings);
        let workers = self.workers.clone();
        let answered = async move {
            match present.await {
                Ok(present) => answer(workers, reply, ask.work(present)).await,
                Err(_) => reply.refuse(Unserved::NO_ARM),
            }
        };
        ctx.spawn(answered.into_actor(self));
    }
}

/// It does not depend on the arm.
impl<const N: usize> Handler<Call<IntegrationStep>> for Study<N> {
    type Result = ();

    fn handle(&mut self, call: Call<IntegrationStep>, ctx: &mut Context<Self>) {
        let work = Integrating::Asked(call.ask);
        let answered = answer(self.workers.clone(), call.reply, work);
        ctx.spawn(answered.into_actor(self));
    }
}

impl<const N: usize> Handler<HeldLimit<N>> for Study<N> {
    type Result = ResponseFuture<Option<ClockLimits>>;

    fn handle(&mut self, HeldLimit(control): HeldLimit<N>, _: &mut Context<Self>) -> Self::Result {
        let (asker, answered) = oneshot::channel();
        let computing = answer(
            self.workers.clone(),
            Reply::to_node(asker, None),
            Limiting(control),
        );
        Box::pin(async move {
            computing.await;
            answered.await.ok()?.ok()
        })
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

/// The arm's request for its limit: one slice.
struct Limiting<const N: usize>(ControlLoop<N>);

impl<const N: usize> Work<ClockLimits> for Limiting<N> {
    fn most_bytes(&self) -> usize {
        0
    }

    fn advance(&mut self, _: fn() -> Duration) -> Option<ClockLimits> {
        Some(clock_limits(&self.0))
    }
}

/// Passes a call to the workers, once there is memory for its answer.
async fn answer<T: Send + 'static>(
    workers: WorkerPool,
    mut reply: Reply<T>,
    work: impl Work<T> + 'static,
) {
    if reply.reserve(work.most_bytes()).await {
        workers.submit(Box::new(Answering { reply, work }));
    }
}

struct Answering<T, W> {
    reply: Reply<T>,
    work: W,
}

impl<T: Send, W: Work<T>> Computation for Answering<T, W> {
    fn advance(&mut self, deadline: Duration) -> Progress {
        loop {
            if self.reply.caller_is_gone() {
                self.reply.refuse(Unserved::CALLER_GONE);
                return Progress::Finished;
            }
            if let Some(answer) = self.work.advance(work_clock::now) {
                // Megabytes take a worker some tenths of a second, in which it does nothing else.
                self.reply.answer(answer);
                return Progress::Finished;
            }
            if work_clock::now() >= deadline {
                return Progress::Unfinished;
            }
        }
    }

    fn refuse(&mut self, why: &'static str) {
        self.reply.refuse(Unserved(why));
    }
}
