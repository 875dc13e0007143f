//! Starts the nodes of an arm and connects them, for the program, its tests and its fuzz targets alike.
//!
//! Only the arm's thread and the nodes of the process, such as the recorder, are left to the caller.

use std::sync::Arc;

use actix::prelude::*;

use super::arm::follow::PathFollower;
use super::arm::ik_action::{GoalTracker, IkAction};
use super::arm::ik_trial::{GoalClient, IkTrial, TrialArm};
use super::arm::sim::{self, ArmSim, AttachNodes};
use super::compute::study::Study;
use super::compute::workers::WorkerPool;
use super::gateway::registry::Registry;
use super::node::{Nodes, ShutDown};
use super::resources::gauges::Gauges;
use super::ros::rosapi::RosapiNode;
use super::ros::tf_web::{self, TfRepublisher};
use crate::math::arm::Arm;
use crate::math::pid::Gains;
use crate::options::Links;

/// Starts an arm of that size and all nodes around it in this thread. It is not generic, because a generic one would be
/// compiled again, with all nodes, in every crate that uses it.
pub fn start_in_this_thread(
    links: Links,
    registry: &Addr<Registry>,
    gauges: &Arc<Gauges>,
    workers: &WorkerPool,
    seed: u64,
    nodes: &mut Nodes,
) {
    match links {
        Links::Two => drop(start_arm::<2>(registry, gauges, workers, seed, nodes)),
        Links::Three => drop(start_arm::<3>(registry, gauges, workers, seed, nodes)),
    }
}

/// Starts an arm with default parameters and gains, and all nodes around it, in this thread.
pub fn start_arm<const N: usize>(
    registry: &Addr<Registry>,
    gauges: &Arc<Gauges>,
    workers: &WorkerPool,
    seed: u64,
    nodes: &mut Nodes,
) -> Addr<ArmSim<N>> {
    let publish = registry.clone().recipient();
    let gauges = Arc::clone(gauges);
    let arm = ArmSim::new(Arm::default(), Gains::default(), publish, gauges).start();
    start_nodes(&arm, registry, workers, seed, nodes);
    arm
}

/// Starts all nodes around `arm` in this thread and attaches them, with the arm, to `nodes`. `seed` is that of the
/// trials' targets. Returns the nodes that have running work for clients.
pub fn start_nodes<const N: usize>(
    arm: &Addr<ArmSim<N>>,
    registry: &Addr<Registry>,
    workers: &WorkerPool,
    seed: u64,
    nodes: &mut Nodes,
) -> Vec<Recipient<ShutDown>> {
    sim::attach(arm, nodes);
    let rosapi = RosapiNode::new(registry.clone().recipient()).start();
    RosapiNode::attach(&rosapi, nodes);
    let frames = TfRepublisher::new(arm.clone().recipient(), registry.clone().recipient()).start();
    tf_web::attach(&frames, nodes);
    let study = Study::<N>::new(arm.clone().recipient(), workers.clone()).start();
    Study::attach(&study, nodes);
    let follower = PathFollower::new(arm.clone().recipient(), arm.clone().recipient()).start();
    PathFollower::attach(&follower, nodes);
    let of_trial = TrialArm {
        pose: arm.clone().recipient(),
        interest: arm.clone().recipient(),
    };
    let tracker = GoalTracker {
        track: arm.clone().recipient(),
        command: arm.clone().recipient(),
        end: arm.clone().recipient(),
    };
    let (action, _) = start_goal_nodes(of_trial, tracker, registry, seed, nodes);
    arm.do_send(AttachNodes {
        study: Some(study.recipient()),
        goal_reporters: vec![
            registry.clone().recipient(),
            action.clone().recipient(),
            follower.clone().recipient(),
        ],
    });
    vec![
        arm.clone().recipient(),
        action.recipient(),
        follower.recipient(),
        frames.recipient(),
    ]
}

/// Starts the nodes `ik_action` and `ik_trial` around the arm of these recipients.
pub fn start_goal_nodes<const N: usize>(
    arm: TrialArm<N>,
    tracker: GoalTracker<N>,
    registry: &Addr<Registry>,
    seed: u64,
    nodes: &mut Nodes,
) -> (Addr<IkAction<N>>, Addr<IkTrial<N>>) {
    let publish = || registry.clone().recipient();
    let action = IkAction::<N>::new(tracker, publish()).start();
    IkAction::attach(&action, nodes);
    let goals = GoalClient {
        send: action.clone().recipient(),
        cancel: action.clone().recipient(),
        barrier: action.clone().recipient(),
    };
    let rng = fastrand::Rng::with_seed(seed);
    let trial = IkTrial::<N>::new(arm, goals, publish(), rng).start();
    IkTrial::attach(&trial, nodes);
    (action, trial)
}
