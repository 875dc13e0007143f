//! The arm: steps the simulation against wall time, serves `/arm_sim/*` and `/pid_controller/*`, publishes its state.
//!
//! The actor only asks the clock and says who hears what. What is due is reckoned by `math::pacer`, what happens in a
//! step by `math::simulation`, requests are read in `services`, messages written in `telemetry`, goals judged in
//! `goals`, timesteps in `limit`.
//!
//! The arm wakes 60 times a second, and before it handles any message it advances to now, so that nobody sees a state
//! from before the present step. Work per wake-up is bounded by [`WAKE_UP_BUDGET`]; what that leaves owed is taken up after
//! [`BREATHER`].
//!
//! **Invariant:** nothing here decides physics; the live arm does what `Simulation` does offline, bit for bit.

mod by_hand;
mod goals;
mod limit;
mod scene;
mod services;
mod telemetry;

use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use tokio::time::Instant;

pub use self::by_hand::MAX_STEPS;
use self::goals::Goals;
pub use self::goals::{ArmPose, EndGoal, GoalJudged, Pose, TrackGoal, Tracking};
use self::limit::LimitWatch;
pub use self::limit::{ArmSettings, Consult, ControlLoop, HeldLimit, LEAST_PAUSE, Present};
use self::telemetry::Telemetry;
use super::awake::stay_awake;
use super::gauges::Gauges;
use super::node::{Interest, ServiceCall, TopicMessage};
use super::registry::{Nodes, Publish, Respond};
use crate::math::arm::Arm;
use crate::math::pacer::Pacer;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::Simulation;
use crate::protocol::catalog::{Direction, Node, Service, Topic};
use crate::protocol::messages::{self, Level};
use crate::protocol::trajectory::joint_trajectory;

/// Publishing ticks a second, and so the rate of `/joint_states` and `/clock` \[Hz\].
pub const PUBLISH_RATE: u32 = 60;
/// Time that one wake-up may spend on steps: what a message to the arm may have to wait for.
pub const WAKE_UP_BUDGET: Duration = Duration::from_millis(5);
/// Between two wake-ups while steps are owed. So the arm takes what it needs of its core, not a share that is fixed by the rate
/// of publishing; and a timestep that no machine can follow leaves the others some of it.
pub const BREATHER: Duration = Duration::from_millis(1);
/// Steps between two looks at the clock: some 10 microseconds of work.
const BATCH: u64 = 64;

/// Names of the joints, base first.
const JOINT_NAMES: [&str; 3] = ["joint1", "joint2", "joint3"];

/// The names of an arm's joints, base first.
#[must_use]
pub fn joint_names<const N: usize>() -> [&'static str; N] {
    std::array::from_fn(|i| JOINT_NAMES.get(i).copied().unwrap_or_default())
}

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `arm_sim` for an arm of `N` links.
pub struct ArmSim<const N: usize> {
    simulation: Simulation<N>,
    pacer: Pacer,
    paused: bool,
    /// A wake-up after a [`BREATHER`] is on its way.
    catching_up: bool,
    /// The moment from which the pacer and the ticks count.
    epoch: Instant,
    publish: Recipient<Publish>,
    respond: Recipient<Respond>,
    telemetry: Telemetry,
    joint_names: [&'static str; N],
    goals: Goals<N>,
    limit: LimitWatch<N>,
}

impl<const N: usize> ArmSim<N> {
    /// An arm in the starting pose, running, with its controller off.
    #[must_use]
    pub fn new(
        arm: Arm<N>,
        gains: Gains<N>,
        publish: Recipient<Publish>,
        respond: Recipient<Respond>,
        gauges: Arc<Gauges>,
    ) -> Self {
        let simulation = Simulation::new(arm, gains);
        Self {
            pacer: Pacer::new(Duration::ZERO, simulation.timestep()),
            telemetry: Telemetry::new(gauges, &simulation),
            simulation,
            paused: false,
            catching_up: false,
            epoch: Instant::now(),
            publish,
            respond,
            joint_names: joint_names(),
            goals: Goals::default(),
            limit: LimitWatch::default(),
        }
    }

    /// Enters this node's services and topics into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        for service in Service::ALL {
            let served = service.owner() == Node::ArmSim;
            if served && !service.is_computation() {
                nodes.services.insert(service, address.clone().recipient());
            }
        }
        for topic in Topic::ALL {
            let published = topic.direction() == Direction::Published;
            if published && topic.owner() == Node::ArmSim {
                nodes.publishers.insert(topic, address.clone().recipient());
            }
        }
        nodes
            .listeners
            .insert(Topic::JointTrajectory, address.clone().recipient());
    }
}

// ---- messages -------------------------------------------------------------------------------------------------------

/// What time it is in the simulation \[s\]. From `rosapi` and `rosout`.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "f64")]
pub struct SimulationTime;

/// Which simulation an offline observer would have to run to get the present state. From tests and tools.
#[derive(Message)]
#[rtype(result = "Snapshot<N>")]
pub struct TakeSnapshot<const N: usize>;

/// The whole simulation as it is now.
#[derive(MessageResponse)]
pub struct Snapshot<const N: usize>(pub Box<Simulation<N>>);

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for ArmSim<N> {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        self.epoch = Instant::now();
        self.pacer
            .restart(Duration::ZERO, self.simulation.timestep());
        self.schedule_tick(ctx);
    }
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ServiceCall> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, call: ServiceCall, ctx: &mut Context<Self>) {
        self.advance_to_now(ctx);
        self.serve(call, ctx);
        stay_awake();
    }
}

impl<const N: usize> Handler<TopicMessage> for ArmSim<N> {
    type Result = ();

    /// A trajectory: its last point is the setpoint, from the next step on.
    fn handle(&mut self, message: TopicMessage, ctx: &mut Context<Self>) {
        self.advance_to_now(ctx);
        if message.sender.is_none() && !self.is_valid_trajectory() {
            return;
        }
        match joint_trajectory(&message.msg, &self.joint_names) {
            Ok(request) => {
                if let (Ok(position), Ok(velocity)) =
                    (request.position.try_into(), request.velocity.try_into())
                {
                    self.simulation
                        .set_setpoint(Setpoint { position, velocity });
                }
            }
            Err(why) => {
                if let Some(sender) = message.sender {
                    let msg = format!("{}: {why}", Topic::JointTrajectory.name());
                    let frame = messages::status(Level::Error, &msg, sender.id.as_deref());
                    self.respond.do_send(Respond {
                        connection: sender.connection,
                        frame,
                        service: None,
                        status: Some(Level::Error),
                        done: Some(sender.done),
                    });
                }
            }
        }
    }
}

impl<const N: usize> Handler<Interest> for ArmSim<N> {
    type Result = ();

    fn handle(&mut self, interest: Interest, ctx: &mut Context<Self>) {
        self.telemetry.set_wanted(interest.topic, interest.wanted);
        self.publish_lasting(interest.topic);
        self.ask_limit(ctx);
    }
}

impl<const N: usize> Handler<SimulationTime> for ArmSim<N> {
    type Result = f64;

    fn handle(&mut self, _: SimulationTime, ctx: &mut Context<Self>) -> f64 {
        self.advance_to_now(ctx);
        self.simulation.time()
    }
}

impl<const N: usize> Handler<TakeSnapshot<N>> for ArmSim<N> {
    type Result = Snapshot<N>;

    fn handle(&mut self, _: TakeSnapshot<N>, ctx: &mut Context<Self>) -> Snapshot<N> {
        self.advance_to_now(ctx);
        Snapshot(Box::new(self.simulation.clone()))
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

impl<const N: usize> ArmSim<N> {
    /// Wakes at the next multiple of the tick's length: missed ticks are skipped, not made up.
    fn schedule_tick(&self, ctx: &mut Context<Self>) {
        let tick = Duration::from_secs(1) / PUBLISH_RATE;
        let since_tick = self.epoch.elapsed().as_nanos() % tick.as_nanos();
        let wait = tick - Duration::from_nanos(u64::try_from(since_tick).unwrap_or(0));
        ctx.run_later(wait, |arm, ctx| {
            arm.advance_to_now(ctx);
            arm.watch_limit(ctx);
            arm.publish_state();
            arm.schedule_tick(ctx);
        });
    }

    /// Takes the steps that are due, as far as one wake-up's budget goes; the rest stays owed until soon after.
    fn advance_to_now(&mut self, ctx: &mut Context<Self>) {
        if self.paused || self.simulation.divergence().is_some() {
            return;
        }
        // One budget for all that comes before the breather is over: were each message to cost one, a client that sends
        // many would keep the arm from everybody else.
        if self.catching_up {
            return;
        }
        let due = self.pacer.due(self.epoch.elapsed());
        if due == 0 {
            return;
        }
        let taken = self.take_steps(due);
        self.pacer.took(taken);
        if self.simulation.divergence().is_some() {
            self.note_divergence();
            return;
        }
        self.telemetry.owes(due - taken, self.simulation.timestep());
        if taken < due {
            self.catching_up = true;
            ctx.run_later(BREATHER, |arm, ctx| {
                arm.catching_up = false;
                arm.advance_to_now(ctx);
            });
        }
    }

    /// Takes up to `due` steps, and no longer than the budget; answers how many.
    fn take_steps(&mut self, due: u64) -> u64 {
        // The budget is about the processor's time, so it is measured on the real clock, also where tests have another.
        let started = std::time::Instant::now();
        let mut taken = 0;
        while taken < due && started.elapsed() < WAKE_UP_BUDGET {
            taken += self.advance(BATCH.min(due - taken));
            if self.simulation.divergence().is_some() {
                break;
            }
        }
        self.telemetry
            .stepped(taken, started.elapsed(), self.simulation.timestep());
        taken
    }

    /// Tells of a divergence that has just happened.
    fn note_divergence(&mut self) {
        self.telemetry.owes(0, 0.0);
        if let Some(divergence) = self.simulation.divergence() {
            tracing::warn!(
                step = divergence.step,
                time = divergence.time,
                "the simulation has diverged"
            );
        }
        self.publish_diagnostics();
    }

    /// Time counts from here: what was owed of an unfinished step is gone.
    fn restart_pacer(&mut self) {
        self.telemetry.owes(0, 0.0);
        self.pacer
            .restart(self.epoch.elapsed(), self.simulation.timestep());
    }
}
