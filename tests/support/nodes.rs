//! The runtime's nodes on one thread, connected as in `actors/runtime.rs`. The recorder is missing, because it needs a
//! disk.

use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use pendularm::actors::arm::follow::{PathArm, PathFollower};
use pendularm::actors::arm::ik::Ik;
use pendularm::actors::arm::ik_action::{GoalTracker, IkAction};
use pendularm::actors::arm::ik_trial::{GoalClient, IkTrial};
use pendularm::actors::arm::sim::{AddBarrier, ArmPose, ArmSim};
use pendularm::actors::compute::integration::Integration;
use pendularm::actors::compute::study::Study;
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::registry::{Attach, Registry};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::ros::rosapi::RosapiNode;
use pendularm::actors::ros::tf_web::TfRepublisher;
use pendularm::actors::wire::Nodes;
use pendularm::math::arm::Arm;
use pendularm::math::pid::Gains;

/// The nodes that tests call without a client.
pub struct Started<const N: usize> {
    pub arm: Addr<ArmSim<N>>,
    pub study: Addr<Study<N>>,
    pub pool: WorkerPool,
}

/// Starts all nodes and hands them to the registry. Computations wait for the turns of the pool.
pub async fn start_whole<const N: usize>(
    registry: &Addr<Registry>,
    gauges: &Arc<Gauges>,
    seed: u64,
) -> Started<N> {
    let mut nodes = Nodes::default();
    let pool = WorkerPool::without_threads();
    let started = start_nodes(registry, gauges, &pool, seed, &mut nodes);
    registry.send(Attach(nodes)).await.unwrap();
    started
}

/// Starts all nodes for this registry and attaches them to `nodes`. Computations wait for the turns of `pool`.
pub fn start_nodes<const N: usize>(
    registry: &Addr<Registry>,
    gauges: &Arc<Gauges>,
    pool: &WorkerPool,
    seed: u64,
    nodes: &mut Nodes,
) -> Started<N> {
    let publish = || registry.clone().recipient();
    let arm = ArmSim::<N>::new(
        Arm::default(),
        Gains::default(),
        publish(),
        Arc::clone(gauges),
    );
    let arm = arm.start();
    ArmSim::attach(&arm, nodes);
    arm.do_send(AddBarrier(registry.clone().recipient()));
    let (pose, tracker) = (arm.clone().recipient(), GoalTracker::of(&arm));
    start_goal_nodes(registry, pose, tracker, seed, nodes);
    PathFollower::attach(&PathFollower::new(PathArm::of(&arm)).start(), nodes);
    let study = Study::new(arm.clone().recipient(), pool.clone()).start();
    Study::attach(&study, nodes);
    Integration::attach(&Integration::new(pool.clone()).start(), nodes);
    let rosapi = RosapiNode::new(registry.clone().recipient(), arm.clone().recipient()).start();
    RosapiNode::attach(&rosapi, nodes);
    let frames = TfRepublisher::new(arm.clone().recipient(), publish()).start();
    TfRepublisher::attach(&frames, nodes);
    Started {
        arm,
        study,
        pool: pool.clone(),
    }
}

/// The nodes `ik`, `ik_action` and `ik_trial`, around the arm of these recipients. Returns the last two.
pub fn start_goal_nodes<const N: usize>(
    registry: &Addr<Registry>,
    pose: Recipient<ArmPose<N>>,
    tracker: GoalTracker<N>,
    seed: u64,
    nodes: &mut Nodes,
) -> (Addr<IkAction<N>>, Addr<IkTrial<N>>) {
    let publish = || registry.clone().recipient();
    let ik = Ik::<N>::new(pose.clone()).start();
    Ik::attach(&ik, nodes);
    let action = IkAction::<N>::new(ik.recipient(), tracker, publish()).start();
    IkAction::attach(&action, nodes);
    let goals = GoalClient {
        send: action.clone().recipient(),
        cancel: action.clone().recipient(),
        barrier: action.clone().recipient(),
    };
    let rng = fastrand::Rng::with_seed(seed);
    let trial = IkTrial::<N>::new(pose, goals, publish(), rng).start();
    IkTrial::attach(&trial, nodes);
    (action, trial)
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
