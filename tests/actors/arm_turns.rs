//! The arm's turns in virtual time: its tick comes however many messages wait, and clients who step it share it.
//!
//! **Invariant:** work is counted in messages and steps, never timed: the clock moves by a millisecond whenever the arm lets
//! anybody else have a turn.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::task::Poll;
use std::time::Duration;

use crate::system::in_virtual_time;
use actix::prelude::*;
use glam::DVec2;
use pendularm::actors::arm::sim::{
    ArmPose, ArmSettings, ArmSim, CommandGoal, Disturb, Enable, EndGoal, GoalJudged, MAX_STEPS,
    Pause, Reset, STEPS_IN_A_ROW, SetGains, SetIntegrator, SetParams, SetSetpoint, SimulationTime,
    Step, Stepped, StepsEnd, TURN_MESSAGES, TakeSnapshot, TrackGoal,
};
use pendularm::actors::node::{
    Ask, Asker, Call, Done, Interest, Publish, Reply, ShutDown, Unserved,
};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::math::arm::Arm;
use pendularm::math::goal::Criteria;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::op::fields::Rejections;
use tokio::time::advance;

/// Turns of everybody else in one publishing tick: the clock moves by a millisecond in each.
const TURNS_PER_TICK: usize = 17;
/// Turns after which a test gives up.
const MANY_TURNS: usize = 1_000_000;

/// Everything that the arm says, in order.
#[derive(Debug, Clone, PartialEq)]
enum Said {
    Tick,
    Answer(u64, Answer),
}

#[derive(Debug, Clone, PartialEq)]
enum Answer {
    Stepped(Stepped),
    NotStepped(Rejections),
    Unserved(Unserved),
    /// To another question.
    Other,
}

type Log = Arc<Mutex<Vec<Said>>>;

/// Stands in for the registry.
struct Probe(Log);

impl Actor for Probe {
    type Context = Context<Self>;
}

impl Handler<Publish> for Probe {
    type Result = ();

    fn handle(&mut self, publish: Publish, _: &mut Context<Self>) {
        if publish.topic == Topic::JointStates {
            self.0.lock().unwrap().push(Said::Tick);
        }
    }
}

/// Stands in for a client.
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
                let stepped = (&answer as &dyn Any).downcast_ref::<Result<Stepped, Rejections>>();
                match stepped {
                    Some(Ok(stepped)) => Answer::Stepped(*stepped),
                    Some(Err(rejected)) => Answer::NotStepped(rejected.clone()),
                    None => Answer::Other,
                }
            }
        };
        let said = Said::Answer(self.number, answer);
        self.log.lock().unwrap().push(said);
    }

    fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }
}

/// An arm of three links whose `/joint_states` are heard.
struct Bench {
    arm: Addr<ArmSim<3>>,
    said: Log,
}

impl Bench {
    async fn new() -> Self {
        let said = Log::default();
        let publish = Probe(Arc::clone(&said)).start().recipient();
        let gauges = Arc::new(Gauges::default());
        let arm = ArmSim::new(Arm::default(), Gains::default(), publish, gauges).start();
        let topic = Topic::JointStates;
        let wanted = true;
        arm.send(Interest { topic, wanted }).await.unwrap();
        Self { arm, said }
    }

    /// One whose arm is paused at time 0.
    async fn paused() -> Self {
        let bench = Self::new().await;
        bench.ask(0, pause(true));
        bench.ask(0, Reset::default());
        bench.until_answers(2).await;
        bench.said.lock().unwrap().clear();
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
        self.ask(client, Step { steps, rejected })
    }

    /// Lets the arm have its turns, a millisecond each, until so many answers have come; gives the number of turns.
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
        let said = self.said.lock().unwrap();
        let answers = said.iter().filter(|one| **one != Said::Tick);
        answers.count()
    }

    fn answers(&self) -> Vec<(u64, Answer)> {
        let said = self.said.lock().unwrap();
        let answers = said.iter().filter_map(|one| match one {
            Said::Answer(client, answer) => Some((*client, answer.clone())),
            Said::Tick => None,
        });
        answers.collect()
    }

    fn ticks(&self) -> usize {
        let said = self.said.lock().unwrap();
        said.iter().filter(|one| **one == Said::Tick).count()
    }

    /// Asserts that the ticks that belong to so many turns have come: one may be on its way at the end.
    #[track_caller]
    fn assert_ticks(&self, turns: usize, of: &str) {
        let expected = turns / TURNS_PER_TICK;
        assert!(expected >= 3, "{of}: only {turns} turns");
        let ticks = self.ticks();
        assert!(
            ticks + 1 >= expected,
            "{of}: {ticks} ticks in {turns} turns"
        );
    }

    async fn snapshot(&self) -> Simulation<3> {
        *self.arm.send(TakeSnapshot).await.unwrap().0
    }
}

fn pause(paused: bool) -> Pause {
    Pause {
        paused: Some(paused),
        ..Pause::default()
    }
}

/// All of the steps that were asked for, or fewer.
fn stepped(answer: &Answer) -> Stepped {
    match answer {
        Answer::Stepped(stepped) => *stepped,
        other => panic!("{other:?}"),
    }
}

/// Each flood waits in the mailbox as a whole; the clock moves only in the turns that the arm leaves to others.
#[test]
fn the_tick_comes_however_many_messages_wait_for_the_arm() {
    const FLOOD: usize = 100 * TURN_MESSAGES;
    type Send = fn(&Bench);
    let kinds: [(&str, Send); 8] = [
        ("params", |bench| {
            let gravity = Some(9.7);
            bench.ask(
                1,
                SetParams {
                    gravity,
                    ..SetParams::default()
                },
            );
        }),
        ("gains", |bench| {
            let kp = Some([1.0, 2.0, 3.0]);
            bench.ask(
                1,
                SetGains {
                    kp,
                    ..SetGains::default()
                },
            );
        }),
        ("methods", |bench| {
            let method = Some(Method::Euler);
            bench.ask(
                1,
                SetIntegrator {
                    method,
                    ..SetIntegrator::default()
                },
            );
        }),
        ("pushes", |bench| {
            bench.ask(
                1,
                Disturb {
                    effort: Some([0.0; 3]),
                    duration: Some(1.0),
                    rejected: Rejections::default(),
                },
            );
        }),
        ("resumes", |bench| drop(bench.ask(1, pause(false)))),
        ("steps", |bench| drop(bench.step(1, 1))),
        ("switches", |bench| {
            let enabled = Some(true);
            bench.ask(
                1,
                Enable {
                    enabled,
                    ..Enable::default()
                },
            );
        }),
        ("resets", |bench| drop(bench.ask(1, Reset::default()))),
    ];
    for (name, send) in kinds {
        in_virtual_time(async move {
            let bench = Bench::new().await;
            for _ in 0..FLOOD {
                send(&bench);
            }
            let turns = bench.until_answers(FLOOD).await;
            assert!(turns >= FLOOD / TURN_MESSAGES, "{turns} turns");
            bench.assert_ticks(turns, name);
        });
    }
}

#[test]
fn the_tick_comes_however_many_messages_of_other_kinds_wait() {
    const FLOOD: usize = 100 * TURN_MESSAGES;
    type Send = fn(&Bench, usize);
    let kinds: [(&str, Send); 6] = [
        ("setpoints", |bench, _| {
            let (setpoint, done) = (Setpoint::default(), None);
            bench.arm.do_send(SetSetpoint { setpoint, done });
        }),
        ("interests", |bench, n| {
            let (topic, wanted) = (Topic::RobotDescription, n % 2 == 0);
            bench.arm.do_send(Interest { topic, wanted });
        }),
        ("times", |bench, _| bench.arm.do_send(SimulationTime)),
        ("poses", |bench, _| bench.arm.do_send(ArmPose::<3>)),
        ("settings", |bench, _| bench.arm.do_send(ArmSettings::<3>)),
        ("ends of goals", |bench, n| {
            let number = n as u64;
            bench.arm.do_send(EndGoal::<3> { number });
        }),
    ];
    for (name, send) in kinds {
        in_virtual_time(async move {
            let bench = Bench::new().await;
            for n in 0..FLOOD {
                send(&bench, n);
            }
            bench.ask(1, Pause::default());
            let turns = bench.until_answers(1).await;
            assert!(turns >= FLOOD / TURN_MESSAGES, "{name}: {turns} turns");
            bench.assert_ticks(turns, name);
        });
    }
}

#[test]
fn clients_who_step_the_arm_take_turns_and_neither_the_tick_nor_a_light_call_waits_for_them() {
    in_virtual_time(async {
        let bench = Bench::paused().await;
        for connection in 1..=9 {
            bench.step(connection, MAX_STEPS);
        }
        bench.step(10, 3 * STEPS_IN_A_ROW);
        bench.step(11, 1);
        bench.ask(12, SetGains::default());
        let turns = bench.until_answers(12).await;
        let order: Vec<u64> = bench.answers().iter().map(|(of, _)| *of).collect();
        assert_eq!(order, [11, 12, 10, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
        bench.assert_ticks(turns, "steps");
        let all = 9 * MAX_STEPS + 3 * STEPS_IN_A_ROW + 1;
        let mut offline = Simulation::<3>::new(Arm::default(), Gains::default());
        offline.advance(all);
        assert_eq!(
            bench.snapshot().await,
            offline,
            "each step once, to the bit"
        );
        for (client, answer) in bench.answers() {
            let steps = match client {
                1..=9 => MAX_STEPS,
                10 => 3 * STEPS_IN_A_ROW,
                11 => 1,
                _ => continue,
            };
            let stepped = stepped(&answer);
            assert_eq!((stepped.steps, stepped.end), (steps, StepsEnd::AllTaken));
        }
    });
}

/// Four clients who never stop asking, as many times as it takes for a second to pass.
#[test]
fn the_tick_comes_while_clients_step_without_end() {
    in_virtual_time(async {
        let bench = Bench::paused().await;
        let mut asked = 0;
        for _ in 0..1000 {
            while asked < bench.answered() + 4 {
                bench.step(asked as u64 % 4, MAX_STEPS);
                asked += 1;
            }
            advance(Duration::from_millis(1)).await;
        }
        bench.assert_ticks(1000, "steps without end");
    });
}

/// Stands in for the owner of a goal: the goal's time at each progress, and whose turn it was.
struct Owner {
    turns: Rc<Cell<u64>>,
    heard: Rc<RefCell<Vec<(f64, u64)>>>,
}

impl Actor for Owner {
    type Context = Context<Self>;
}

impl Handler<GoalJudged<3>> for Owner {
    type Result = ();

    fn handle(&mut self, judged: GoalJudged<3>, _: &mut Context<Self>) {
        let heard = (judged.elapsed, self.turns.get());
        self.heard.borrow_mut().push(heard);
    }
}

/// A step of a second is told by itself: ten thousand of them are not told at once, and each is.
#[test]
fn progress_of_a_goal_is_told_step_by_step_however_many_step_the_arm() {
    in_virtual_time(async {
        let bench = Bench::paused().await;
        let (turns, heard) = (Rc::new(Cell::new(0)), Rc::default());
        let others = Rc::clone(&turns);
        // Somebody else who always has something to do.
        actix_rt::spawn(std::future::poll_fn(move |cx| {
            others.set(others.get() + 1);
            cx.waker().wake_by_ref();
            Poll::<()>::Pending
        }));
        let owner = Owner {
            turns,
            heard: Rc::clone(&heard),
        };
        let long = SetIntegrator {
            timestep: Some(1.0),
            ..SetIntegrator::default()
        };
        let weightless = SetParams {
            gravity: Some(0.0),
            ..SetParams::default()
        };
        bench.ask(0, long);
        bench.ask(0, weightless);
        let rest = [0.0; 3];
        let owner = owner.start();
        let goal = TrackGoal {
            number: 1,
            target: DVec2::new(0.0, 1.0),
            criteria: Criteria::default(),
            solution: rest,
            owner: owner.clone().recipient(),
        };
        bench.arm.send(goal).await.unwrap();
        let (number, positions) = (1, rest);
        let command = CommandGoal { number, positions };
        bench.arm.send(command).await.unwrap();
        for client in 1..=5 {
            bench.step(client, 1000);
        }
        while bench.answered() < 7 {
            advance(Duration::from_millis(1)).await;
        }
        // The last are on their way.
        advance(Duration::from_millis(1)).await;
        let heard = heard.borrow();
        assert_eq!(heard.len(), 5000);
        assert!(heard.is_sorted());
        let most = heard.chunk_by(|(_, one), (_, other)| one == other);
        let most = most.map(<[_]>::len).max().unwrap();
        assert_eq!(most, 1, "in a turn");
    });
}

#[test]
fn a_resume_ends_the_steps_that_are_left_and_says_so() {
    in_virtual_time(async {
        let bench = Bench::paused().await;
        bench.step(1, MAX_STEPS);
        bench.ask(2, pause(false));
        bench.until_answers(2).await;
        let answers = bench.answers();
        let (_, answer) = answers.iter().find(|(of, _)| *of == 1).unwrap();
        let stepped = stepped(answer);
        assert_eq!(
            (stepped.steps, stepped.end),
            (STEPS_IN_A_ROW, StepsEnd::Resumed)
        );
    });
}

/// As if each step had been asked for alone: what comes in between takes effect in between.
#[test]
fn a_reset_in_between_takes_effect_in_between() {
    in_virtual_time(async {
        let bench = Bench::paused().await;
        bench.step(1, MAX_STEPS);
        bench.ask(2, Reset::default());
        bench.until_answers(2).await;
        let mut offline = Simulation::<3>::new(Arm::default(), Gains::default());
        offline.advance(MAX_STEPS - STEPS_IN_A_ROW);
        assert_eq!(bench.snapshot().await, offline);
        let (of, answer) = bench.answers().pop().unwrap();
        let stepped = stepped(&answer);
        assert_eq!((of, stepped.steps), (1, MAX_STEPS));
        assert_eq!(stepped.time, offline.time());
    });
}

/// Euler at one-second steps: the free arm overflows within some hundred steps; who waits for a turn then takes none.
#[test]
fn a_divergence_ends_everybodys_steps() {
    in_virtual_time(async {
        let bench = Bench::paused().await;
        let integrator = |timestep: f64| SetIntegrator {
            method: Some(Method::Euler),
            timestep: Some(timestep),
            rejected: Rejections::default(),
        };
        bench.ask(3, integrator(1e-3));
        for connection in 1..=2 {
            bench.step(connection, MAX_STEPS);
        }
        bench.ask(3, integrator(1.0));
        bench.until_answers(4).await;
        for (of, answer) in bench.answers().iter().filter(|(of, _)| *of != 3) {
            let stepped = stepped(answer);
            assert_eq!(stepped.end, StepsEnd::Diverged, "{of}");
            assert!(stepped.steps >= STEPS_IN_A_ROW);
        }
    });
}

#[test]
fn steps_of_a_client_that_is_gone_are_not_taken() {
    in_virtual_time(async {
        let bench = Bench::paused().await;
        let gone = bench.step(1, MAX_STEPS);
        gone.store(true, Ordering::Relaxed);
        bench.step(2, 2 * STEPS_IN_A_ROW);
        bench.until_answers(2).await;
        let taken = bench.snapshot().await.steps();
        assert!(taken <= 3 * STEPS_IN_A_ROW, "{taken}");
    });
}

#[test]
fn at_the_end_the_steps_that_are_left_are_refused() {
    in_virtual_time(async {
        let bench = Bench::paused().await;
        for connection in 1..=3 {
            bench.step(connection, MAX_STEPS);
        }
        bench.arm.do_send(ShutDown("shutting down"));
        bench.until_answers(3).await;
        assert_eq!(bench.snapshot().await.steps(), 3 * STEPS_IN_A_ROW);
        for (_, answer) in bench.answers() {
            assert_eq!(answer, Answer::Unserved(Unserved::Refused("shutting down")));
        }
    });
}
