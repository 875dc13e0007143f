//! Goals between their node and the arm: messages that cross. `exchanges/goals.txt` has the clients' frames.

use crate::stage::{Published, SilentArm, Stage, asked, ms, pass};
use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::arm::ik::Ik;
use pendularm::actors::arm::ik_action::{GoalTracker, IkAction, SendGoal};
use pendularm::actors::arm::sim::{
    ArmPose, CommandGoal, GoalOrder, GoalProgress, TrackGoal, Tracking,
};
use pendularm::actors::node::{Interest, Publish, ask};
use pendularm::math::goal::{Criteria, Outcome};
use pendularm::math::kinematics::Target;
use pendularm::protocol::catalog::Topic;
use tokio::sync::mpsc::{UnboundedSender, unbounded_channel};

/// A goal far from the starting pose.
pub fn elsewhere() -> SendGoal<2> {
    SendGoal {
        target: Target {
            position: glam::DVec2::ONE,
            orientation: None,
        },
        criteria: Criteria::default(),
        owner: None,
    }
}

/// Records the messages that it receives.
struct Noting(UnboundedSender<&'static str>);

impl Actor for Noting {
    type Context = Context<Self>;
}

impl Handler<Publish> for Noting {
    type Result = ();

    fn handle(&mut self, _: Publish, _: &mut Context<Self>) {
        self.0.send("published").unwrap();
    }
}

impl Handler<CommandGoal<2>> for Noting {
    type Result = ();

    fn handle(&mut self, _: CommandGoal<2>, _: &mut Context<Self>) {
        self.0.send("commanded").unwrap();
    }
}

impl Handler<TrackGoal<2>> for Noting {
    type Result = MessageResult<TrackGoal<2>>;

    fn handle(
        &mut self,
        TrackGoal { goal, .. }: TrackGoal<2>,
        _: &mut Context<Self>,
    ) -> Self::Result {
        self.0.send("announced").unwrap();
        MessageResult(Tracking {
            positions: goal.solution,
            before: None,
            obstacle: None,
        })
    }
}

/// Otherwise subscribers would see the old goal's trajectory as the new goal's.
#[test]
fn a_goal_is_announced_only_when_the_one_before_is_in_motion() {
    in_virtual_time(async {
        let (sender, mut noted) = unbounded_channel();
        let noting = Noting(sender).start();
        let silent = SilentArm.start();
        let tracker = GoalTracker {
            track: noting.clone().recipient(),
            command: noting.clone().recipient(),
            end: silent.clone().recipient(),
            add_barrier: silent.clone().recipient(),
        };
        let ik = Ik::<2>::new(silent.recipient()).start();
        let action = IkAction::new(ik.recipient(), tracker, noting.recipient()).start();
        let goals = (0..3).map(|_| ask(&action.clone().recipient(), elsewhere()));
        for goal in goals.collect::<Vec<_>>() {
            goal.await.unwrap().unwrap();
        }
        pass(ms(1)).await;
        for _ in 0..3 {
            assert_eq!(noted.recv().await, Some("announced"));
            assert_eq!(noted.recv().await, Some("published"));
            assert_eq!(noted.recv().await, Some("commanded"));
        }
    });
}

/// The node's own messages, before the registry could drop them.
#[test]
fn nothing_is_encoded_for_a_topic_without_subscribers() {
    in_virtual_time(async {
        let arm = SilentArm.start();
        let ik = Ik::<2>::new(arm.clone().recipient()).start();
        let (sender, mut published) = unbounded_channel();
        let publish = Published(sender).start().recipient();
        let tracker = SilentArm::tracker(&arm);
        let action = IkAction::new(ik.recipient(), tracker, publish).start();
        for wanted in [false, true, false] {
            for topic in [Topic::IkFeedback, Topic::IkResult] {
                action.send(Interest { topic, wanted }).await.unwrap();
            }
            let goal_id = asked(&action, elsewhere()).await.unwrap();
            let number: u64 = goal_id.strip_prefix("goal-").unwrap().parse().unwrap();
            for outcome in [None, Some(Outcome::Reached)] {
                let judged = GoalProgress {
                    number,
                    distance: 1.0,
                    elapsed: 1.0,
                    pose: arm.send(ArmPose).await.unwrap(),
                    outcome,
                };
                action.send(judged).await.unwrap();
            }
            assert_eq!(published.recv().await, Some(Topic::JointTrajectory));
            if wanted {
                assert_eq!(published.recv().await, Some(Topic::IkFeedback));
                assert_eq!(published.recv().await, Some(Topic::IkResult));
            }
            assert!(published.try_recv().is_err());
        }
    });
}

/// Receives the progress of a goal in place of its owner.
struct Owner(UnboundedSender<GoalProgress<2>>);

impl Actor for Owner {
    type Context = Context<Self>;
}

impl Handler<GoalProgress<2>> for Owner {
    type Result = ();

    fn handle(&mut self, judged: GoalProgress<2>, _: &mut Context<Self>) {
        self.0.send(judged).unwrap();
    }
}

/// Between the announcement of a goal and its setpoint another client's reset may come. Then the reset counts as the
/// later of the two, and the setpoint must not pull the arm out of its starting pose.
#[test]
fn a_reset_that_overtakes_a_goals_setpoint_makes_it_void() {
    in_virtual_time(async {
        let (stage, _client) = Stage::<2>::with_a_floating_arm().await;
        let (sender, mut news) = unbounded_channel();
        let owner = Owner(sender).start();
        let announce = |number| {
            let goal = GoalOrder {
                number,
                target: glam::DVec2::ONE,
                criteria: Criteria::default(),
                solution: [0.0, 1.5],
            };
            let owner = owner.clone().recipient();
            stage.arm.send(TrackGoal { goal, owner })
        };
        let command = |number| CommandGoal {
            number,
            positions: [0.0, 1.5],
        };
        announce(1).await.unwrap();
        stage.reset().await;
        assert_eq!(news.recv().await.unwrap().outcome, Some(Outcome::Preempted));
        stage.arm.send(command(1)).await.unwrap();
        let setpoint = *stage.simulation().await.pid().setpoint();
        assert_eq!(setpoint.position, [0.0, 0.0]);
        // The next goal is not affected.
        announce(2).await.unwrap();
        stage.arm.send(command(2)).await.unwrap();
        let setpoint = *stage.simulation().await.pid().setpoint();
        assert_eq!(setpoint.position, [0.0, 1.5]);
        assert_eq!(news.recv().await.unwrap().number, 2);
    });
}

#[test]
fn a_goal_is_not_judged_before_its_setpoint_has_come() {
    in_virtual_time(async {
        let (stage, _client) = Stage::<2>::with_a_floating_arm().await;
        let (sender, mut news) = unbounded_channel();
        let owner = Owner(sender).start();
        let goal = GoalOrder {
            number: 1,
            target: glam::dvec2(2.0, 0.0),
            criteria: Criteria {
                epsilon: 0.1,
                success_hold: 0.0,
            },
            solution: [0.0, 0.0],
        };
        let owner = owner.clone().recipient();
        let tracking = stage.arm.send(TrackGoal { goal, owner }).await.unwrap();
        assert_eq!(tracking.positions, [0.0, 0.0]);
        pass(ms(100)).await;
        assert!(news.try_recv().is_err());
        stage.arm.do_send(CommandGoal {
            number: 1,
            positions: [0.0, 0.0],
        });
        let first = news.recv().await.unwrap();
        // A difference of products of steps and timestep.
        assert!((first.elapsed - 0.001).abs() < 1e-12);
    });
}
