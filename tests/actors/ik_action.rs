//! Goals between their node and the arm: messages that cross. `exchanges/goals.txt` has the clients' frames.

use crate::stage::{Stage, accept, ms, silent_tracker};
use crate::system::in_virtual_time;
use crate::virtual_time::stand_in;
use actix::prelude::*;
use pendularm::actors::arm::ik_action::{GoalRequest, GoalTracker, IkAction};
use pendularm::actors::arm::sim::{CommandGoal, GoalOrder, GoalProgress, TrackGoal};
use pendularm::actors::node::{Publish, ask};
use pendularm::math::goal::{Criteria, Outcome};
use pendularm::math::kinematics::Target;
use tokio::sync::mpsc::{UnboundedReceiver, unbounded_channel};
use tokio::time::sleep;

/// A goal far from the starting pose.
pub fn elsewhere() -> GoalRequest<2> {
    GoalRequest {
        target: Target {
            position: glam::DVec2::ONE,
            orientation: None,
        },
        criteria: Criteria::default(),
    }
}

/// Otherwise subscribers would see the old goal's trajectory as the new goal's.
#[test]
fn a_goal_is_announced_only_when_the_one_before_is_in_motion() {
    in_virtual_time(async {
        let (sender, mut noted) = unbounded_channel();
        let note = move |what: &'static str| sender.send(what).unwrap();
        let (on_command, on_publish) = (note.clone(), note.clone());
        let tracker = GoalTracker {
            track: stand_in(move |goal: TrackGoal<2>| {
                note("announced");
                accept(goal)
            }),
            command: stand_in(move |_: CommandGoal<2>| on_command("commanded")),
            ..silent_tracker()
        };
        let publish = stand_in(move |_: Publish| on_publish("published"));
        let action = IkAction::new(tracker, publish).start();
        let goals = (0..3).map(|_| ask(&action.clone().recipient(), elsewhere()));
        for goal in goals.collect::<Vec<_>>() {
            goal.await.unwrap().unwrap();
        }
        sleep(ms(1)).await;
        for _ in 0..3 {
            assert_eq!(noted.recv().await, Some("announced"));
            assert_eq!(noted.recv().await, Some("published"));
            assert_eq!(noted.recv().await, Some("commanded"));
        }
    });
}

/// Receives the progress of a goal in place of its owner.
fn owner() -> (
    Recipient<GoalProgress<2>>,
    UnboundedReceiver<GoalProgress<2>>,
) {
    let (sender, news) = unbounded_channel();
    let owner = stand_in(move |judged| sender.send(judged).unwrap());
    (owner, news)
}

/// Between the announcement of a goal and its setpoint another client's reset may come. Then the reset counts as the
/// later of the two, and the setpoint must not pull the arm out of its starting pose.
#[test]
fn a_reset_that_overtakes_a_goals_setpoint_makes_it_void() {
    in_virtual_time(async {
        let (stage, _client) = Stage::<2>::with_a_floating_arm().await;
        let (owner, mut news) = owner();
        let announce = |number| {
            let goal = GoalOrder {
                number,
                target: elsewhere().target,
                criteria: Criteria::default(),
            };
            let owner = owner.clone();
            stage.arm.send(TrackGoal { goal, owner })
        };
        let command = |number| CommandGoal {
            number,
            positions: [0.0, 1.5],
        };
        announce(1).await.unwrap().unwrap();
        stage.reset().await;
        assert_eq!(news.recv().await.unwrap().outcome, Some(Outcome::Preempted));
        stage.arm.send(command(1)).await.unwrap();
        let setpoint = *stage.simulation().await.pid().setpoint();
        assert_eq!(setpoint.position, [0.0, 0.0]);
        // The next goal is not affected.
        announce(2).await.unwrap().unwrap();
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
        let (owner, mut news) = owner();
        let goal = GoalOrder {
            number: 1,
            target: Target {
                position: glam::dvec2(2.0, 0.0),
                orientation: None,
            },
            criteria: Criteria {
                epsilon: 0.1,
                success_hold: 0.0,
            },
        };
        let tracking = stage.arm.send(TrackGoal { goal, owner }).await;
        let tracking = tracking.unwrap().unwrap();
        assert_eq!(tracking.positions, [0.0, 0.0]);
        sleep(ms(100)).await;
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
