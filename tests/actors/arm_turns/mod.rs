//! The arm's turns in virtual time: its tick comes for any number of waiting messages, and clients that step the arm
//! take turns.
//!
//! **Invariant:** work is counted in messages and steps, never timed. The clock moves by a millisecond whenever the arm
//! yields.

mod progress;
mod steps;
mod ticks;

use std::any::Any;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use crate::arm_steps::pause;
use crate::stage::stand_in;
use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::arm::sim::{
    ArmSim, MAX_STEPS, Pause, Reset, SetGains, SetIntegrator, SetParams, Step, Stepped,
    TakeSnapshot,
};
use pendularm::actors::node::{Ask, Asker, Call, Done, Interest, Publish, Reply, Unserved};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::op::fields::Rejections;
use tokio::time::advance;

/// Turns of other tasks in one publishing tick. The clock moves by a millisecond in each.
const TURNS_PER_TICK: usize = 17;
/// Turns after which a test gives up.
const MANY_TURNS: usize = 1_000_000;

/// What the arm has sent: a number of ticks, and answers to clients, in order.
#[derive(Default)]
struct Said {
    ticks: usize,
    answers: Vec<(u64, Answer)>,
}

#[derive(Debug, Clone, PartialEq)]
enum Answer {
    Stepped(Stepped<3>),
    NotStepped(Rejections),
    Unserved(Unserved),
    /// To another question.
    Other,
}

type Log = Arc<Mutex<Said>>;

/// Replaces a client.
struct Client {
    number: u64,
    gone: Arc<AtomicBool>,
    log: Log,
}

impl<T: 'static> Asker<T> for Client {
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, _: Option<Done>) {
        let answer = match answer {
            Err(why) => Answer::Unserved(why),
            Ok(answer) => {
                let stepped =
                    (&answer as &dyn Any).downcast_ref::<Result<Stepped<3>, Rejections>>();
                match stepped {
                    Some(Ok(stepped)) => Answer::Stepped(*stepped),
                    Some(Err(rejected)) => Answer::NotStepped(rejected.clone()),
                    None => Answer::Other,
                }
            }
        };
        let said = (self.number, answer);
        self.log.lock().unwrap().answers.push(said);
    }

    fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }
}

/// An arm of three links with a subscriber of `/joint_states`.
struct TurnsBench {
    arm: Addr<ArmSim<3>>,
    said: Log,
}

impl TurnsBench {
    async fn new() -> Self {
        let said = Log::default();
        let ticks = Arc::clone(&said);
        let publish = stand_in(move |publish: Publish| {
            if publish.topic == Topic::JointStates {
                ticks.lock().unwrap().ticks += 1;
            }
        });
        let gauges = Arc::new(Gauges::default());
        let arm = ArmSim::new(Arm::default(), Gains::default(), publish, gauges).start();
        let topic = Topic::JointStates;
        let wanted = true;
        arm.send(Interest { topic, wanted }).await.unwrap();
        Self { arm, said }
    }

    /// The same with the arm paused at time 0.
    async fn paused() -> Self {
        let bench = Self::new().await;
        bench.ask(0, pause(true));
        bench.ask(0, Reset::default());
        bench.until_answers(2).await;
        *bench.said.lock().unwrap() = Said::default();
        bench
    }

    fn ask<A: Ask>(&self, client: u64, ask: A) -> Arc<AtomicBool>
    where
        ArmSim<3>: Handler<Call<A>>,
    {
        let gone = Arc::new(AtomicBool::new(false));
        let client = Client {
            number: client,
            gone: Arc::clone(&gone),
            log: Arc::clone(&self.said),
        };
        let reply = Reply::new(client, None);
        self.arm.do_send(Call { ask, reply });
        gone
    }

    fn step(&self, client: u64, steps: u64) -> Arc<AtomicBool> {
        let steps = Some(steps);
        let rejected = Rejections::default();
        let effort = None::<[f64; 3]>;
        self.ask(
            client,
            Step {
                steps,
                effort,
                rejected,
            },
        )
    }

    /// Gives the arm turns of a millisecond each until this number of answers has arrived. Returns the number of turns.
    async fn until_answers(&self, count: usize) -> usize {
        for turns in 0..MANY_TURNS {
            if self.answered() >= count {
                return turns;
            }
            advance(Duration::from_millis(1)).await;
        }
        panic!("{} answers instead of {count}", self.answered());
    }

    fn answered(&self) -> usize {
        self.said.lock().unwrap().answers.len()
    }

    fn answers(&self) -> Vec<(u64, Answer)> {
        self.said.lock().unwrap().answers.clone()
    }

    /// Asserts that the ticks of this number of turns have arrived. One may still be missing.
    #[track_caller]
    fn assert_ticks(&self, turns: usize, of: &str) {
        let expected = turns / TURNS_PER_TICK;
        assert!(expected >= 3, "{of}: only {turns} turns");
        let ticks = self.said.lock().unwrap().ticks;
        assert!(
            ticks + 1 >= expected,
            "{of}: {ticks} ticks in {turns} turns"
        );
    }

    async fn snapshot(&self) -> Simulation<3> {
        *self.arm.send(TakeSnapshot).await.unwrap().0
    }
}

/// All requested steps, or fewer.
fn stepped(answer: &Answer) -> Stepped<3> {
    match answer {
        Answer::Stepped(stepped) => *stepped,
        other => panic!("{other:?}"),
    }
}
