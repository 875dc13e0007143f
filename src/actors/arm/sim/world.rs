//! The environment of the arm in the runtime: its clocks, the registry, the owner of its goal.
//!
//! **Invariant:** the registry encodes published messages, not the arm's thread.

use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use tokio::time::Instant;

use crate::actors::node::Publish;
use crate::actors::resources::gauges::Gauges;
use crate::actors::resources::work_clock;
use crate::live::{GoalProgress, World};
use crate::math::simulation::Divergence;
use crate::protocol::catalog::Topic;

/// The environment of an arm of `N` links.
pub(super) struct ArmWorld<const N: usize> {
    /// The start time of the pacer and the ticks.
    pub(super) epoch: Instant,
    pub(super) publish: Recipient<Publish>,
    pub(super) gauges: Arc<Gauges>,
    /// The receiver of the tracked goal's news.
    pub(super) owner: Option<Recipient<GoalProgress<N>>>,
}

impl<const N: usize> World<N> for ArmWorld<N> {
    fn now(&self) -> Duration {
        self.epoch.elapsed()
    }

    fn work_time(&self) -> Duration {
        work_clock::now()
    }

    fn publish(&self, topic: Topic, write: impl FnOnce() -> Bytes + Send + 'static) {
        let frame = Box::new(write);
        self.publish.do_send(Publish { topic, frame });
    }

    fn tell(&self, progress: GoalProgress<N>) {
        if let Some(owner) = &self.owner {
            owner.do_send(progress);
        }
    }

    fn clients(&self) -> (u64, u64) {
        (self.gauges.connections(), self.gauges.messages_dropped())
    }

    fn note_divergence(&self, divergence: Divergence) {
        tracing::warn!(
            step = divergence.step,
            time = divergence.time,
            "the simulation has diverged"
        );
    }

    fn count_estimate(&self) {
        self.gauges.add_estimate();
    }
}
