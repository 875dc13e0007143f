//! The runtime's nodes on one thread. The recorder is missing, because it needs a disk.

use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use pendularm::actors::arm::sim::ArmSim;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::registry::{Attach, Registry};
use pendularm::actors::node::Nodes;
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::start::start_arm;

/// Starts all nodes and hands them to the registry. Computations wait for the turns of the pool.
pub async fn start_whole<const N: usize>(
    registry: &Addr<Registry>,
    gauges: &Arc<Gauges>,
    seed: u64,
) -> (Addr<ArmSim<N>>, WorkerPool) {
    let mut nodes = Nodes::default();
    let pool = WorkerPool::without_threads();
    let arm = start_arm(registry, gauges, &pool, seed, &mut nodes);
    registry.send(Attach(nodes)).await.unwrap();
    (arm, pool)
}

/// Does the work of a pool without threads in this thread, every millisecond.
pub fn work_in_this_thread(pool: WorkerPool) {
    actix_rt::spawn(async move {
        loop {
            while pool.turn() {}
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    });
}
