//! A trial with substitutes for the arm and `ik_action`, so messages can cross. Without subscribers it does no work.
//! `exchanges/trials.txt` has the clients' frames.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::atomic::Ordering;

use crate::ik_action::elsewhere;
use crate::stage::{asked, ms, pose_at, silent_arm, silent_tracker};
use crate::system::{counting_wake_ups, in_virtual_time};
use crate::virtual_time::{Client, Gateway, WIDE, stand_in};
use actix::prelude::*;
use pendularm::actors::arm::ik_action::{CancelRejected, CancelRequest, GoalReport, SendGoal};
use pendularm::actors::arm::ik_trial::{GoalClient, IkTrial, TrialArm, TrialRequest};
use pendularm::actors::arm::sim::{ArmPose, GoalProgress, Pose};
use pendularm::actors::gateway::registry::{Attach, Nodes};
use pendularm::actors::node::{Barrier, Call, Interest};
use pendularm::actors::start::start_goal_nodes;
use pendularm::math::goal::Outcome;
use pendularm::math::kinematics::Target;
use pendularm::math::trial::Changes;
use pendularm::protocol::op::fields::Rejections;
use pendularm::services::goals::AcceptedGoal;
use serde_json::Value;
use tokio::time::{Instant, sleep};

const STATUS: &str = "/ik_trial/status";

fn start(duration: f64, epsilon: f64, success_hold: f64) -> TrialRequest {
    TrialRequest::Start {
        changes: Changes {
            duration: Some(duration),
            epsilon: Some(epsilon),
            success_hold: Some(success_hold),
        },
        rejected: Rejections::default(),
    }
}

/// Starts a trial, which must succeed.
async fn begin(trial: &Addr<IkTrial<2>>, question: TrialRequest) {
    assert_eq!(asked(trial, question).await.outcome, Ok(()));
}

/// The latest status, after all sent messages have arrived.
async fn status(client: &mut Client) -> Value {
    client.messages_for(ms(101), STATUS).await.pop().unwrap()
}

/// The state of the substitutes, shared with the test.
#[derive(Default)]
struct Script {
    lengths: [f64; 2],
    /// Goals to be refused before one is accepted.
    refusals: usize,
    sent: Vec<Target>,
    /// Sent to the latest goal's owner only when the trial requests the progress.
    news: Vec<GoalReport<2>>,
    owner: Option<Recipient<GoalReport<2>>>,
    /// Whether the arm has been told that a trial observes it.
    observes: bool,
}

impl Script {
    /// The answer of `ik_action` to a goal.
    fn accept(&mut self, goal: SendGoal<2>) -> Option<String> {
        self.sent.push(goal.goal.target);
        if self.refusals > 0 {
            self.refusals -= 1;
            return None;
        }
        self.owner = Some(goal.owner);
        Some(format!("goal-{}", self.sent.len()))
    }
}

/// The report that the first goal was reached at this time.
fn reached_at(time: f64) -> GoalReport<2> {
    ended_at(time, Outcome::Reached)
}

fn ended_at(time: f64, outcome: Outcome) -> GoalReport<2> {
    let target = Target {
        position: glam::DVec2::X,
        orientation: None,
    };
    GoalReport {
        goal: AcceptedGoal::new(1, target, [0.0, 0.0]),
        progress: GoalProgress {
            number: 1,
            distance: 0.0,
            elapsed: 0.0,
            pose: pose_at(time),
            outcome: Some(outcome),
        },
    }
}

/// A trial with substitutes, and a client that subscribes to its status.
async fn between_stand_ins(script: &Rc<RefCell<Script>>) -> (Addr<IkTrial<2>>, Client, Instant) {
    let gateway = Gateway::bare().await;
    let born = Instant::now();
    let (of_arm, of_news) = (Rc::clone(script), Rc::clone(script));
    let (of_goals, of_barrier) = (Rc::clone(script), Rc::clone(script));
    let arm = TrialArm {
        pose: stand_in(move |_: ArmPose<2>| Pose {
            lengths: of_arm.borrow().lengths,
            ..pose_at(born.elapsed().as_secs_f64())
        }),
        interest: stand_in(move |interest: Interest| {
            of_news.borrow_mut().observes = interest.wanted
        }),
    };
    let goals = GoalClient {
        send: stand_in(move |goal: SendGoal<2>| of_goals.borrow_mut().accept(goal)),
        cancel: stand_in(|call: Call<CancelRequest>| {
            call.reply.conclude(Err(CancelRejected::NotActive));
        }),
        barrier: stand_in(move |_: Barrier| {
            let mut script = of_barrier.borrow_mut();
            for news in std::mem::take(&mut script.news) {
                script.owner.as_ref().unwrap().do_send(news);
            }
        }),
    };
    let publish = gateway.registry.clone().recipient();
    let rng = fastrand::Rng::with_seed(1);
    let trial = IkTrial::<2>::new(arm, goals, publish, rng).start();
    let mut nodes = Nodes::default();
    IkTrial::attach(&trial, &mut nodes);
    gateway.registry.send(Attach(nodes)).await.unwrap();
    let mut client = gateway.connect(WIDE).remembering();
    client.subscribe(STATUS).await;
    (trial, client, born)
}

/// The arm reports that the goal was reached at 0.101 s, then that the time is 0.11 s. The message about the goal
/// passes through `ik_action` and may be slower. It still counts.
#[test]
fn earlier_messages_of_the_arm_arrive_before_its_time() {
    in_virtual_time(async {
        let script = Rc::new(RefCell::new(Script {
            lengths: [1.0, 1.0],
            ..Script::default()
        }));
        let (trial, mut client, _) = between_stand_ins(&script).await;
        begin(&trial, start(0.11, 1e6, 0.1)).await;
        script.borrow_mut().news.push(reached_at(0.101));
        client.messages_for(ms(300), STATUS).await;
        let end = client.messages(STATUS).pop().unwrap();
        assert_eq!(end["running"], false);
        assert_eq!(end["targets_reached"], 1);
    });
}

/// Another client's goal takes the place of the trial's, which has none from then on.
#[test]
fn a_running_trial_observes_the_arm_with_and_without_a_goal() {
    in_virtual_time(async {
        let script = Rc::new(RefCell::new(Script {
            lengths: [1.0, 1.0],
            ..Script::default()
        }));
        let (trial, mut client, _) = between_stand_ins(&script).await;
        assert!(!script.borrow().observes, "no trial");
        begin(&trial, start(2.0, 1e-9, 0.0)).await;
        assert!(script.borrow().observes, "a goal");
        let owner = script.borrow().owner.clone().unwrap();
        owner.do_send(ended_at(0.1, Outcome::Preempted));
        assert_eq!(status(&mut client).await["action_status"], "preempted");
        assert!(script.borrow().observes, "no goal");
        sleep(ms(2000)).await;
        assert!(!script.borrow().observes, "the trial is over");
    });
}

/// A goal is refused because the lengths have changed: the next target fits the new ones.
#[test]
fn after_a_refusal_another_target_is_sampled_for_the_lengths_of_that_moment() {
    in_virtual_time(async {
        let script = Rc::new(RefCell::new(Script {
            lengths: [1.0, 1.0],
            refusals: 0,
            ..Script::default()
        }));
        let (trial, mut client, born) = between_stand_ins(&script).await;
        begin(&trial, start(60.0, 1e-9, 0.0)).await;
        script.borrow_mut().lengths = [1e-3, 1e-3];
        script.borrow_mut().refusals = 3;
        // The goal was reached while the lengths were the old ones.
        let reached = reached_at(born.elapsed().as_secs_f64());
        script.borrow().owner.as_ref().unwrap().do_send(reached);
        let after = status(&mut client).await;
        assert_eq!(after["action_status"], "active");
        assert_eq!(after["targets_reached"], 1);
        let sent = script.borrow().sent.clone();
        assert_eq!(sent.len(), 5, "one, and after three refusals another");
        assert!(sent[1].position.length() > 2e-3, "the old lengths");
        for target in &sent[2..] {
            assert!(target.position.length() <= 2e-3, "the new ones");
        }
    });
}

/// In an hour virtual time itself wakes the thread a few times. A status at 10 Hz would wake it 36,000 times.
#[test]
fn no_timer_runs_without_a_goal_a_trial_or_a_subscriber() {
    counting_wake_ups(|sleeps| async move {
        let gateway = Gateway::bare().await;
        let registry = &gateway.registry;
        let mut nodes = Nodes::default();
        let arm = TrialArm {
            pose: silent_arm(),
            interest: stand_in(|_: Interest| ()),
        };
        let tracker = silent_tracker();
        let (action, trial) = start_goal_nodes::<2>(arm, tracker, registry, 1, &mut nodes);
        registry.send(Attach(nodes)).await.unwrap();
        let mut client = gateway.connect(WIDE).remembering();
        let an_hour = || async {
            let before = sleeps.load(Ordering::Relaxed);
            sleep(ms(3_600_000)).await;
            sleeps.load(Ordering::Relaxed) - before
        };
        let quiet = 0..100;

        assert!(quiet.contains(&an_hour().await), "at first");
        asked(&action, elsewhere()).await.unwrap();
        assert!(quiet.contains(&an_hour().await), "the arm is silent");
        begin(&trial, start(1e9, 1e-9, 0.0)).await;
        assert!(quiet.contains(&an_hour().await), "a trial, unwatched");
        let stopped = asked(&trial, TrialRequest::Stop).await;
        assert_eq!(stopped.outcome, Ok(()));
        assert!(quiet.contains(&an_hour().await), "after the trial");
        client.subscribe(STATUS).await;
        let listening = async { client.messages_for(ms(3_600_000), STATUS).await.len() };
        let (awake, received) = tokio::join!(an_hour(), listening);
        assert!(awake >= 36_000 && received >= 35_999, "{awake}, {received}");
        drop(client);
        sleep(ms(1000)).await;
        assert!(quiet.contains(&an_hour().await), "the watcher is gone");
    });
}
