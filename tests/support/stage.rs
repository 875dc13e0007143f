//! All nodes on one thread, whose clock does not move until every task waits, and a rosbridge client on an in-memory
//! pipe. Tests in virtual time share them.
//!
//! A test calls a node as another node does ([`asked`]), and receives the messages of a subscriber. A virtual second
//! takes almost no real time, and always passes in the same way. So steps, messages and their order can be counted.

use std::time::Duration;

use crate::virtual_time::{Client, Gateway, WIDE, stand_in};
use actix::prelude::*;
use pendularm::actors::arm::ik_action::GoalTracker;
use pendularm::actors::arm::sim::{
    ArmPose, ArmSim, Pose, Reset, SetParams, SetSetpoint, TakeSnapshot, TrackGoal, Tracking,
};
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::gateway::registry::Attach;
use pendularm::actors::node::{Ask, Call, Completion, Nodes, Publish, Reply};
use pendularm::actors::start::start_arm;
use pendularm::math::arm::State;
use pendularm::math::kinematics::Unreachable;
use pendularm::math::pid::Setpoint;
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::Topic;
use tokio::sync::mpsc::UnboundedSender;
use tokio::sync::oneshot;
use tokio::time::sleep;

pub const fn ms(milliseconds: u64) -> Duration {
    Duration::from_millis(milliseconds)
}

/// All nodes, connected as in the runtime. The recorder is missing, because it needs a disk.
pub struct Stage<const N: usize> {
    pub gateway: Gateway,
    pub arm: Addr<ArmSim<N>>,
    /// Computations, which run only while a test gives them turns.
    pub pool: WorkerPool,
}

impl<const N: usize> Stage<N> {
    pub async fn start() -> Self {
        Self::with_seed(1).await
    }

    pub async fn with_seed(seed: u64) -> Self {
        let gateway = Gateway::bare().await;
        let (registry, gauges) = (&gateway.registry, &gateway.gauges);
        let (mut nodes, pool) = (Nodes::default(), WorkerPool::without_threads());
        let arm = start_arm(registry, gauges, &pool, seed, &mut nodes);
        registry.send(Attach(nodes)).await.unwrap();
        Self { gateway, arm, pool }
    }

    /// Does the computations in this thread, every millisecond.
    pub fn compute(&self) {
        let pool = self.pool.clone();
        actix_rt::spawn(async move {
            loop {
                while pool.turn() {}
                sleep(ms(1)).await;
            }
        });
    }

    /// A client that stores every frame that it receives.
    pub fn connect(&self) -> Client {
        self.gateway.connect(WIDE).remembering()
    }

    /// The present state of the arm's whole simulation.
    pub async fn simulation(&self) -> Simulation<N> {
        let simulation = self.arm.send(TakeSnapshot).await.unwrap();
        *simulation
    }

    /// A client, with the arm weightless and at rest at q = 0, so its state stays bit-identical.
    pub async fn with_a_floating_arm() -> (Self, Client) {
        let stage = Self::start().await;
        let weightless = SetParams {
            gravity: Some(0.0),
            ..SetParams::default()
        };
        asked(&stage.arm, weightless).await;
        stage.reset().await;
        let client = stage.connect();
        (stage, client)
    }

    pub async fn reset(&self) {
        asked(&self.arm, Reset::default()).await;
    }

    /// Makes the controller hold `position` from the next step on, as the registry does for a message on
    /// `/joint_trajectory`.
    pub async fn hold(&self, position: [f64; N]) {
        let setpoint = Setpoint::at(position);
        let held = SetSetpoint {
            setpoint,
            working: None,
        };
        self.arm.send(held).await.unwrap();
    }
}

/// Calls a node as another one does, and waits for all effects of the call.
pub async fn asked<A, T>(node: &Addr<T>, ask: A) -> A::Answer
where
    A: Ask,
    T: Actor<Context = Context<T>> + Handler<Call<A>>,
{
    let (answered, answer) = oneshot::channel();
    let (working, completion) = Completion::pending();
    let reply = Reply::to_node(answered, Some(working));
    node.send(Call { ask, reply }).await.unwrap();
    let answer = answer.await.expect("an asker").expect("an answer");
    completion.wait().await;
    answer
}

/// A pose at q = 0, with links of 1 m.
pub fn pose_at(time: f64) -> Pose<2> {
    Pose {
        lengths: [1.0, 1.0],
        state: State::rest(),
        setpoint: Setpoint::default(),
        time,
        resets: 0,
        simulated: time,
        stands_still: false,
        obstacle: None,
    }
}

/// The pose of an arm that takes no steps.
pub fn silent_arm() -> Recipient<ArmPose<2>> {
    stand_in(|_| pose_at(0.0))
}

/// The same arm for `ik_action`: it accepts every goal and reports nothing about it.
pub fn silent_tracker() -> GoalTracker<2> {
    GoalTracker {
        track: stand_in(accept),
        command: stand_in(|_| ()),
        end: stand_in(|_| None),
    }
}

/// The answer of an arm that has accepted a goal.
pub fn accept(_: TrackGoal<2>) -> Result<Tracking<2>, Unreachable> {
    Ok(Tracking {
        positions: [0.0, 1.5],
        before: None,
        obstacle: None,
    })
}

/// Receives what nodes publish in place of the registry: messages without subscribers are kept, too.
pub fn publisher(published: UnboundedSender<Topic>) -> Recipient<Publish> {
    stand_in(move |message: Publish| published.send(message.topic).unwrap())
}
