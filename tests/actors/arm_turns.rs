//! The arm's turns in virtual time: its tick comes for any number of waiting messages, and steps end with their client
//! or the runtime. `exchanges/arm.txt` has several clients that step the arm.
//!
//! **Invariant:** work is counted in messages and steps, never timed. The clock moves by a millisecond whenever the arm
//! yields.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::task::Poll;
use std::time::Duration;

use crate::arm_steps::{of_timestep, pause};
use crate::system::in_virtual_time;
use crate::virtual_time::stand_in;
use actix::prelude::*;
use pendularm::actors::arm::sim::{
    ArmPose, ArmSettings, ArmSim, AttachNodes, CommandGoal, GoalOrder, GoalProgress, MAX_STEPS,
    Pause, Reset, STEPS_IN_A_ROW, SetParams, Step, TURN_MESSAGES, TakeSnapshot, TrackGoal,
};
use pendularm::actors::node::{
    Ask, Barrier, Call, Interest, Publish, Reply, ShutDown, Unserved, ask,
};
use pendularm::math::arm::Arm;
use pendularm::math::goal::Criteria;
use pendularm::math::kinematics::Target;
use pendularm::math::pid::Gains;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::op::fields::Rejections;
use tokio::sync::oneshot;
use tokio::time::advance;

/// Turns of other tasks in one publishing tick. The clock moves by a millisecond in each.
const TURNS_PER_TICK: usize = 17;
/// Turns after which a test gives up.
const MANY_TURNS: usize = 1_000_000;
/// Messages of one kind.
const FLOOD: usize = 100 * TURN_MESSAGES;

/// Takes an answer that has arrived: why it is none.
type TakeAnswer = Box<dyn FnMut() -> Option<Option<Unserved>>>;

/// An arm of three links with a subscriber of `/joint_states`.
struct TurnsBench {
    arm: Addr<ArmSim<3>>,
    ticks: Arc<AtomicUsize>,
    /// The answers that have not been taken, in the order of the questions.
    waiting: RefCell<VecDeque<TakeAnswer>>,
    /// The answers that have been taken: the reason for each that is missing.
    answers: RefCell<Vec<Option<Unserved>>>,
}

impl TurnsBench {
    async fn new() -> Self {
        let ticks = Arc::<AtomicUsize>::default();
        let seen = Arc::clone(&ticks);
        let publish = stand_in(move |publish: Publish| {
            let is_tick = publish.topic == Topic::JointStates;
            seen.fetch_add(is_tick.into(), Ordering::Relaxed);
        });
        let arm = ArmSim::new(Arm::default(), Gains::default(), publish, Arc::default()).start();
        let topic = Topic::JointStates;
        let wanted = true;
        arm.send(Interest { topic, wanted }).await.unwrap();
        Self {
            arm,
            ticks,
            waiting: RefCell::default(),
            answers: RefCell::default(),
        }
    }

    /// The same with the arm paused at time 0.
    async fn paused() -> Self {
        let bench = Self::new().await;
        bench.ask(pause(true));
        bench.ask(Reset::default());
        bench.until_answers(2).await;
        bench.answers.borrow_mut().clear();
        bench
    }

    fn ask<A: Ask>(&self, question: A)
    where
        ArmSim<3>: Handler<Call<A>>,
    {
        let (answered, mut answer) = oneshot::channel();
        let reply = Reply::to_node(answered, None);
        self.arm.do_send(Call {
            ask: question,
            reply,
        });
        let refused = move || answer.try_recv().ok().map(Result::err);
        self.waiting.borrow_mut().push_back(Box::new(refused));
    }

    /// Takes the answers that have arrived. Returns their number so far.
    fn take_answers(&self) -> usize {
        let mut waiting = self.waiting.borrow_mut();
        let mut answers = self.answers.borrow_mut();
        while let Some(refused) = waiting.front_mut().and_then(|take| take()) {
            answers.push(refused);
            waiting.pop_front();
        }
        answers.len()
    }

    /// Gives the arm turns of a millisecond each until this number of answers has arrived. Returns the number of turns.
    async fn until_answers(&self, count: usize) -> usize {
        for turns in 0..MANY_TURNS {
            if self.take_answers() >= count {
                return turns;
            }
            advance(Duration::from_millis(1)).await;
        }
        panic!("{:?} instead of {count}", self.answers);
    }

    async fn steps_taken(&self) -> u64 {
        self.arm.send(TakeSnapshot).await.unwrap().steps()
    }
}

fn step(steps: u64) -> Step<3> {
    Step {
        steps: Some(steps),
        effort: None,
        rejected: Rejections::default(),
    }
}

/// A kind of message, whether each has an answer, and how the `n`th is sent.
type Kind = (&'static str, bool, fn(&TurnsBench, usize));

/// One kind for each way in which the arm handles a message.
const KINDS: [Kind; 5] = [
    ("requests", true, |bench, _| bench.ask(pause(false))),
    ("steps", true, |bench, _| bench.ask(step(1))),
    ("orders", false, |bench, _| bench.arm.do_send(ArmPose::<3>)),
    ("interests", false, |bench, n| {
        bench.arm.do_send(Interest {
            topic: Topic::RobotDescription,
            wanted: n % 2 == 0,
        });
    }),
    ("settings", false, |bench, _| {
        bench.arm.do_send(ArmSettings::<3>)
    }),
];

/// Each flood waits in the mailbox as a whole. The clock moves only when the arm yields. One tick may still be missing.
#[test]
fn the_tick_comes_however_many_messages_wait_for_the_arm() {
    for (name, is_answered, send) in KINDS {
        in_virtual_time(async move {
            let bench = TurnsBench::new().await;
            for n in 0..FLOOD {
                send(&bench, n);
            }
            bench.ask(Pause::default());
            let flood = if is_answered { FLOOD } else { 0 };
            let turns = bench.until_answers(flood + 1).await;
            assert!(turns >= FLOOD / TURN_MESSAGES, "{name}: {turns} turns");
            let ticks = bench.ticks.load(Ordering::Relaxed);
            assert!(ticks + 1 >= turns / TURNS_PER_TICK, "{name}: {ticks} ticks");
        });
    }
}

#[test]
fn steps_of_a_client_that_is_gone_are_not_taken_and_at_the_end_the_rest_is_refused() {
    in_virtual_time(async {
        let bench = TurnsBench::paused().await;
        drop(ask(&bench.arm.clone().recipient(), step(MAX_STEPS)));
        bench.ask(step(2 * STEPS_IN_A_ROW));
        bench.until_answers(1).await;
        assert_eq!(bench.steps_taken().await, 2 * STEPS_IN_A_ROW);
        for _ in 0..3 {
            bench.ask(step(MAX_STEPS));
        }
        bench.arm.do_send(ShutDown("shutting down"));
        bench.until_answers(4).await;
        assert_eq!(bench.steps_taken().await, 5 * STEPS_IN_A_ROW);
        let answers = bench.answers.borrow();
        let refused = Some(Unserved("shutting down"));
        assert!(
            answers[1..].iter().all(|one| *one == refused),
            "{answers:?}"
        );
    });
}

/// Each step of a second is reported separately, also if there are ten thousand. The next step waits until the report has
/// been published.
#[test]
fn progress_of_a_goal_is_sent_step_by_step_however_many_clients_step_the_arm() {
    in_virtual_time(async {
        let bench = TurnsBench::paused().await;
        let turns = Rc::new(Cell::new(0));
        let others = Rc::clone(&turns);
        // Another task that always has work.
        actix_rt::spawn(std::future::poll_fn(move |cx| {
            others.set(others.get() + 1);
            cx.waker().wake_by_ref();
            Poll::<()>::Pending
        }));
        // The goal's time at each progress, and whose turn it was.
        let received: Rc<RefCell<Vec<(f64, u64)>>> = Rc::default();
        let log = Rc::clone(&received);
        let owner = stand_in(move |judged: GoalProgress<3>| {
            log.borrow_mut().push((judged.elapsed, turns.get()));
        });
        // The number of reports before each barrier of the registry.
        let before: Rc<RefCell<Vec<usize>>> = Rc::default();
        let (log, barriers) = (Rc::clone(&received), Rc::clone(&before));
        let publisher = stand_in(move |_: Barrier| barriers.borrow_mut().push(log.borrow().len()));
        let (study, goal_reporters) = (None, vec![publisher]);
        let nodes = AttachNodes {
            study,
            goal_reporters,
        };
        bench.arm.send(nodes).await.unwrap();
        bench.ask(of_timestep(1.0));
        bench.ask(SetParams {
            gravity: Some(0.0),
            ..SetParams::default()
        });
        let (number, positions) = (1, [0.0; 3]);
        let goal = GoalOrder {
            number,
            target: Target {
                position: glam::dvec2(0.0, 1.0),
                orientation: None,
            },
            criteria: Criteria::default(),
        };
        let tracking = bench.arm.send(TrackGoal { goal, owner }).await;
        assert!(tracking.unwrap().is_ok());
        let command = CommandGoal { number, positions };
        bench.arm.send(command).await.unwrap();
        for _ in 0..5 {
            bench.ask(step(1000));
        }
        bench.until_answers(7).await;
        // The last ones are still in the mailbox.
        advance(Duration::from_millis(1)).await;
        let received = received.borrow();
        assert_eq!(received.len(), 5000);
        assert!(received.is_sorted());
        assert!(before.borrow().iter().copied().eq(1..=5000));
        let most = received.chunk_by(|(_, one), (_, other)| one == other);
        let most = most.map(<[_]>::len).max().unwrap();
        assert_eq!(most, 1, "in a turn");
    });
}
