//! A reset takes the goal away, at whatever moment; a divergence leaves it as it is.

use super::*;

#[test]
fn a_reset_preempts_the_goal_before_it_is_answered() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client.subscribe(FEEDBACK).await;
        for paused in [false, true] {
            stage.pause(paused).await;
            let goal_id = stage.send_goal(elsewhere()).await;
            client.settle().await;
            client.heard.clear();
            let pose = client.ask("/arm_sim/reset", json!({})).await;
            assert_eq!(
                pose,
                json!({"position": [0.0, 0.0], "velocity": [0.0, 0.0]})
            );
            let expected = [
                format!("{RESULT} {goal_id} preempted"),
                "/arm_sim/reset".to_owned(),
            ];
            assert_eq!(client.story(), expected);
            let distance = number(&client.messages(RESULT)[0]["final_distance"]);
            assert!((distance - std::f64::consts::SQRT_2).abs() < ROUNDING);
            client.heard.clear();
            let later = client.messages_for(ms(500), FEEDBACK).await;
            assert!(later.is_empty(), "no goal is left to report on");
            let setpoint = *stage.simulation().await.pid().setpoint();
            assert_eq!(setpoint.position, [0.0, 0.0]);
        }
    });
}

/// Hears of a goal in a goal's owner's place.
struct Owner(UnboundedSender<GoalJudged<2>>);

impl Actor for Owner {
    type Context = Context<Self>;
}

impl Handler<GoalJudged<2>> for Owner {
    type Result = ();

    fn handle(&mut self, judged: GoalJudged<2>, _: &mut Context<Self>) {
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
            stage.arm.send(TrackGoal {
                number,
                target: glam::DVec2::ONE,
                criteria: Criteria::default(),
                solution: [0.0, 1.5],
                owner: owner.clone().recipient(),
            })
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
        // The next goal is none the worse for it.
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
        let tracking = stage
            .arm
            .send(TrackGoal {
                number: 1,
                target: glam::dvec2(2.0, 0.0),
                criteria: Criteria {
                    epsilon: 0.1,
                    success_hold: 0.0,
                },
                solution: [0.0, 0.0],
                owner: owner.clone().recipient(),
            })
            .await
            .unwrap();
        assert_eq!(tracking.positions, [0.0, 0.0]);
        pass(ms(100)).await;
        assert!(news.try_recv().is_err());
        stage.arm.do_send(CommandGoal {
            number: 1,
            positions: [0.0, 0.0],
        });
        let first = news.recv().await.unwrap();
        assert!((first.elapsed - STEP).abs() < ROUNDING);
    });
}

/// Euler with a timestep of half a second, at the default gains: each step multiplies the error by more than 100.
async fn diverge(stage: &Stage<2>) {
    let unstable = SetIntegrator {
        method: Some(Method::Euler),
        timestep: Some(0.5),
        ..SetIntegrator::default()
    };
    asked(&stage.arm, unstable).await;
    stage.enable().await;
    while stage.simulation().await.divergence().is_none() {
        pass(ms(500)).await;
    }
}

#[test]
fn while_diverged_a_goal_stays_active_until_the_reset() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        client.subscribe(RESULT).await;
        client.subscribe(FEEDBACK).await;
        let goal_id = stage.send_goal(elsewhere()).await;
        diverge(&stage).await;
        client.settle().await;
        client.heard.clear();
        let meanwhile = client.messages_for(Duration::from_secs(60), FEEDBACK);
        assert!(meanwhile.await.is_empty(), "its clock stands");
        assert!(client.messages(RESULT).is_empty());
        // A goal that comes now is taken, and as active.
        let later = stage.send_goal(elsewhere()).await;
        client.settle().await;
        assert_eq!(client.messages(RESULT)[0]["goal_id"], goal_id);
        stage.reset().await;
        client.settle().await;
        assert_eq!(client.messages(RESULT)[1]["goal_id"], later);
        assert_eq!(client.messages(RESULT)[1]["outcome"], "preempted");
    });
}
