//! A trial between an arm and an `ik_action` that do what a test needs: here messages cross that elsewhere do by chance.

use std::cell::RefCell;
use std::rc::Rc;

use pendularm::actors::arm::ik::SolveError;
use pendularm::actors::arm::ik_action::{CancelGoal, CancelRejected, GoalNews, GoalRejected};
use pendularm::actors::arm::ik_action::{GoalOwner, SendGoal};
use pendularm::actors::arm::sim::{ArmPose, Barrier, Pose};
use pendularm::actors::node::Call;
use pendularm::math::goal::Outcome;
use pendularm::math::kinematics::{Target, Unreachable};
use tokio::time::Instant;

use super::*;

/// The part of the stand-ins, shared with the test.
#[derive(Default)]
struct Script {
    lengths: [f64; 2],
    /// Goals to be refused before one is accepted.
    refusals: usize,
    sent: Vec<Target>,
    /// Told to the latest goal's owner when the trial asks for news, and not before.
    news: Vec<GoalNews<2>>,
    owner: Option<Recipient<GoalNews<2>>>,
}

struct StandIn {
    script: Rc<RefCell<Script>>,
    born: Instant,
}

impl StandIn {
    fn pose(&self) -> Pose<2> {
        Pose {
            lengths: self.script.borrow().lengths,
            positions: [0.0, 0.0],
            time: self.born.elapsed().as_secs_f64(),
            resets: 0,
            simulated: self.born.elapsed().as_secs_f64(),
            obstacle: None,
        }
    }
}

impl Actor for StandIn {
    type Context = Context<Self>;
}

impl Handler<ArmPose<2>> for StandIn {
    type Result = Pose<2>;

    fn handle(&mut self, _: ArmPose<2>, _: &mut Context<Self>) -> Pose<2> {
        self.pose()
    }
}

impl Handler<Call<SendGoal<2>>> for StandIn {
    type Result = ();

    fn handle(&mut self, call: Call<SendGoal<2>>, _: &mut Context<Self>) {
        let mut script = self.script.borrow_mut();
        script.sent.push(call.ask.target);
        if script.refusals > 0 {
            script.refusals -= 1;
            let why = SolveError::Unreachable(Unreachable::NotFinite("x"));
            return call.reply.conclude(Err(GoalRejected::Unsolved(why)));
        }
        script.owner = match call.ask.owner {
            Some(GoalOwner::Node(owner)) => Some(owner),
            _ => None,
        };
        let id = format!("goal-{}", script.sent.len());
        call.reply.conclude(Ok(id));
    }
}

impl Handler<Call<CancelGoal>> for StandIn {
    type Result = ();

    fn handle(&mut self, call: Call<CancelGoal>, _: &mut Context<Self>) {
        call.reply.conclude(Err(CancelRejected::NotActive));
    }
}

impl Handler<Barrier> for StandIn {
    type Result = ();

    fn handle(&mut self, _: Barrier, _: &mut Context<Self>) {
        let mut script = self.script.borrow_mut();
        for news in std::mem::take(&mut script.news) {
            script.owner.as_ref().unwrap().do_send(news);
        }
    }
}

/// A trial between stand-ins, and a client that watches it.
async fn between_stand_ins(script: &Rc<RefCell<Script>>) -> (Addr<IkTrial<2>>, Client, Instant) {
    let gauges = std::sync::Arc::default();
    let registry = Registry::new(std::sync::Arc::clone(&gauges)).start();
    let born = Instant::now();
    let stand_in = StandIn {
        script: Rc::clone(script),
        born,
    }
    .start();
    let goals = GoalClient {
        send: stand_in.clone().recipient(),
        cancel: stand_in.clone().recipient(),
        barrier: stand_in.clone().recipient(),
    };
    let publish = registry.clone().recipient();
    let rng = fastrand::Rng::with_seed(1);
    let trial = IkTrial::<2>::new(stand_in.recipient(), goals, publish, rng).start();
    let mut nodes = Nodes::default();
    IkTrial::attach(&trial, &mut nodes);
    registry.send(Attach(nodes)).await.unwrap();
    let mut client = connect(&registry, &gauges);
    client.subscribe(STATUS).await;
    (trial, client, born)
}

/// The arm says that the goal was reached at 0.101 s, then that it is 0.11 s. The word about the goal goes by way of
/// `ik_action` and may be slower; it counts all the same.
#[test]
fn what_the_arm_said_before_it_told_the_time_is_heard_before_the_time() {
    in_virtual_time(async {
        let script = Rc::new(RefCell::new(Script {
            lengths: [1.0, 1.0],
            ..Script::default()
        }));
        let (trial, mut client, _) = between_stand_ins(&script).await;
        begin(&trial, easy(0.11, 0.1)).await;
        script.borrow_mut().news.push(GoalNews {
            goal_id: "goal-1".to_owned(),
            distance: 0.0,
            positions: [0.0, 0.0],
            pose: Pose {
                lengths: [1.0, 1.0],
                positions: [0.0, 0.0],
                time: 0.101,
                resets: 0,
                simulated: 0.101,
                obstacle: None,
            },
            outcome: Some(Outcome::Reached),
        });
        client.messages_for(ms(300), STATUS).await;
        let end = client.messages(STATUS).pop().unwrap();
        assert_eq!(end["running"], false);
        assert_eq!(end["targets_reached"], 1);
    });
}

/// A goal is refused because the lengths are others by now: the next target is one for these.
#[test]
fn after_a_refusal_another_target_is_sampled_for_the_lengths_of_that_moment() {
    in_virtual_time(async {
        let script = Rc::new(RefCell::new(Script {
            lengths: [1.0, 1.0],
            refusals: 0,
            ..Script::default()
        }));
        let (trial, mut client, born) = between_stand_ins(&script).await;
        begin(&trial, hard(60.0)).await;
        script.borrow_mut().lengths = [1e-3, 1e-3];
        script.borrow_mut().refusals = 3;
        // The goal was reached while the lengths were the old ones.
        let reached = GoalNews {
            goal_id: "goal-1".to_owned(),
            distance: 0.0,
            positions: [0.0, 0.0],
            pose: Pose {
                lengths: [1.0, 1.0],
                positions: [0.0, 0.0],
                time: born.elapsed().as_secs_f64(),
                resets: 0,
                simulated: born.elapsed().as_secs_f64(),
                obstacle: None,
            },
            outcome: Some(Outcome::Reached),
        };
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
