//! One goal at a time, one result each: preemption, cancellation, reset.

use super::*;

/// Also with a `success_hold` of 0 the new goal's feedback and result come last.
#[test]
fn a_preempting_goal_comes_after_the_old_result_and_before_its_own_trajectory() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        for topic in [RESULT, FEEDBACK, "/joint_trajectory"] {
            client.subscribe(topic).await;
        }
        let old = client.send_goal(elsewhere()).await;
        // Between two feedback messages.
        client.messages_for(ms(105), RESULT).await;
        client.heard.clear();
        let new = client.send_goal(here(0.0)).await;
        client.messages_for(ms(100), RESULT).await;
        let expected = [
            format!("{RESULT} {old} preempted"),
            SEND.to_owned(),
            "/joint_trajectory".to_owned(),
            format!("{FEEDBACK} {new}"),
            format!("{RESULT} {new} reached"),
        ];
        assert_eq!(client.story(), expected);
        let old = &client.messages(RESULT)[0];
        // The hand is at (2, 0), the old target at (1, 1).
        let distance = number(&old["final_distance"]);
        assert!((distance - std::f64::consts::SQRT_2).abs() < ROUNDING);
    });
}

/// 253 ms after its start the old goal has been reached, but the arm finds that out only now, on being asked for the
/// new goal: the word of it and the new goal cross on their way.
#[test]
fn a_goal_reached_in_the_instant_of_the_next_has_one_result_and_it_says_reached() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        for _ in 0..10 {
            let old = client.send_goal(here(0.25)).await;
            pass(ms(253)).await;
            client.heard.clear();
            client.send_goal(elsewhere()).await;
            let expected = [format!("{RESULT} {old} reached"), SEND.to_owned()];
            assert_eq!(client.story(), expected);
            let more = client.messages_for(ms(100), RESULT).await;
            assert!(more.is_empty());
        }
    });
}

#[test]
fn every_goal_has_exactly_one_result() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        let mut other = stage.connect();
        let mut sent = Vec::new();
        // Goals of two clients, some reached, some replaced, some cancelled, some lost to a reset.
        for round in 0_u64..60 {
            sent.push(client.send_goal(here(0.02)).await);
            pass(ms(round % 31)).await;
            match round % 4 {
                0 => sent.push(other.send_goal(elsewhere()).await),
                1 => {
                    other.call(CANCEL, json!({})).await;
                }
                2 => {
                    other.ask("/arm_sim/reset", json!({})).await;
                }
                _ => {}
            }
        }
        client.call(CANCEL, json!({})).await;
        client.messages_for(ms(1000), RESULT).await;
        let results = client.messages(RESULT);
        let mut ended: Vec<&str> = results
            .iter()
            .map(|result| result["goal_id"].as_str().unwrap())
            .collect();
        assert!(results.iter().any(|result| result["outcome"] == "reached"));
        assert!(
            results
                .iter()
                .any(|result| result["outcome"] == "preempted")
        );
        assert_eq!(ended, sent, "in the order in which they were sent");
        ended.dedup();
        assert_eq!(ended.len(), sent.len());
    });
}

#[test]
fn what_one_connection_sends_takes_effect_in_order_without_waiting_for_answers() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client.heard.clear();
        for frame in [
            call(SEND, &elsewhere()),
            call(SEND, &here(5.0)),
            call(CANCEL, &json!({})),
            call(CANCEL, &json!({})),
            call(SEND, &elsewhere()),
            call("/arm_sim/reset", &json!({})),
            call(CANCEL, &json!({})),
        ] {
            client.send(&frame).await;
        }
        client.messages_for(ms(100), RESULT).await;
        let expected = [
            SEND.to_owned(),
            format!("{RESULT} goal-1 preempted"),
            SEND.to_owned(),
            format!("{RESULT} goal-2 preempted"),
            CANCEL.to_owned(),
            CANCEL.to_owned(),
            SEND.to_owned(),
            format!("{RESULT} goal-3 preempted"),
            "/arm_sim/reset".to_owned(),
            CANCEL.to_owned(),
        ];
        assert_eq!(client.story(), expected);
        let cancelled: Vec<&Value> = client
            .heard
            .iter()
            .filter(|frame| frame["service"] == CANCEL)
            .map(|frame| &frame["result"])
            .collect();
        assert_eq!(cancelled, [true, false, false]);
    });
}

#[test]
fn cancelling_publishes_the_result_and_then_answers_with_nothing() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        for named in [false, true] {
            let goal_id = client.send_goal(elsewhere()).await;
            client.heard.clear();
            let args = if named {
                json!({"goal_id": goal_id})
            } else {
                json!({})
            };
            assert_eq!(client.ask(CANCEL, args).await, json!({}));
            let expected = [format!("{RESULT} {goal_id} preempted"), CANCEL.to_owned()];
            assert_eq!(client.story(), expected);
        }
    });
}

#[test]
fn cancelling_without_an_active_goal_is_rejected() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        assert_eq!(client.refusal(CANCEL, json!({})).await, "no goal is active");
        let goal_id = client.send_goal(elsewhere()).await;
        client.ask(CANCEL, json!({})).await;
        let again = client.refusal(CANCEL, json!({"goal_id": goal_id})).await;
        assert_eq!(again, "no goal is active");
    });
}

#[test]
fn cancelling_another_goal_or_a_malformed_id_is_rejected_without_side_effects() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        let old = client.send_goal(elsewhere()).await;
        let active = client.send_goal(elsewhere()).await;
        client.heard.clear();
        for goal_id in [
            json!(old),
            json!(""),
            json!(7),
            json!(null),
            json!([active]),
        ] {
            let response = client.call(CANCEL, json!({"goal_id": goal_id})).await;
            assert_eq!(response["result"], false);
            assert_eq!(response["values"], json!({}));
            let why = response["status"].as_str().unwrap();
            assert!(why.starts_with("goal_id "), "{why}");
        }
        assert!(client.messages(RESULT).is_empty());
        client.ask(CANCEL, json!({"goal_id": active})).await;
    });
}

#[test]
fn goals_outlive_the_client_that_made_them() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        let mut other = stage.connect();
        let goal_id = other.send_goal(here(1.0)).await;
        drop(other);
        let result = client.message(RESULT).await;
        assert_eq!(result["goal_id"], goal_id);
        assert_eq!(result["outcome"], "reached");
    });
}

#[test]
fn a_reset_preempts_the_goal_before_it_is_answered() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client.subscribe(FEEDBACK).await;
        for paused in [false, true] {
            client.ask("/arm_sim/pause", json!({"data": paused})).await;
            let goal_id = client.send_goal(elsewhere()).await;
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

/// Between the announcement of a goal and its trajectory another client's reset may come. Then the reset counts as the
/// later of the two, and the trajectory must not pull the arm out of its starting pose.
#[test]
fn a_reset_that_overtakes_a_goals_trajectory_makes_it_void() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
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
        let trajectory = || TopicMessage {
            msg: to_raw_value(&json!({"points": [{"positions": [0.0, 1.5]}]})).unwrap(),
            sender: None,
        };
        announce(1).await.unwrap();
        client.ask("/arm_sim/reset", json!({})).await;
        assert_eq!(news.recv().await.unwrap().outcome, Some(Outcome::Preempted));
        stage.arm.send(trajectory()).await.unwrap();
        let setpoint = *stage.simulation().await.pid().setpoint();
        assert_eq!(setpoint.position, [0.0, 0.0]);
        // The next goal is none the worse for it.
        announce(2).await.unwrap();
        stage.arm.send(trajectory()).await.unwrap();
        let setpoint = *stage.simulation().await.pid().setpoint();
        assert_eq!(setpoint.position, [0.0, 1.5]);
        assert_eq!(news.recv().await.unwrap().number, 2);
    });
}

#[test]
fn a_goal_is_not_judged_before_its_trajectory_has_come() {
    in_virtual_time(async {
        let (stage, _client) = Stage::<2>::with_a_floating_arm().await;
        let (sender, mut news) = unbounded_channel();
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
                owner: Owner(sender).start().recipient(),
            })
            .await
            .unwrap();
        assert_eq!(tracking.positions, [0.0, 0.0]);
        pass(ms(100)).await;
        assert!(news.try_recv().is_err());
        let msg = to_raw_value(&json!({"points": [{"positions": [0.0, 0.0]}]})).unwrap();
        stage.arm.do_send(TopicMessage { msg, sender: None });
        let first = news.recv().await.unwrap();
        assert!((first.elapsed - STEP).abs() < ROUNDING);
    });
}

/// Euler with a timestep of half a second, at the default gains: each step multiplies the error by more than 100.
async fn diverge(stage: &Stage<2>, client: &mut Client) {
    client
        .ask(
            "/arm_sim/set_integrator",
            json!({"method": "euler", "timestep": 0.5}),
        )
        .await;
    client.enable().await;
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
        let goal_id = client.send_goal(elsewhere()).await;
        diverge(&stage, &mut client).await;
        client.settle().await;
        client.heard.clear();
        let meanwhile = client.messages_for(Duration::from_secs(60), FEEDBACK);
        assert!(meanwhile.await.is_empty(), "its clock stands");
        assert!(client.messages(RESULT).is_empty());
        // A goal that comes now is taken, and as active.
        let later = client.send_goal(elsewhere()).await;
        assert_eq!(client.messages(RESULT)[0]["goal_id"], goal_id);
        client.ask("/arm_sim/reset", json!({})).await;
        assert_eq!(client.messages(RESULT)[1]["goal_id"], later);
        assert_eq!(client.messages(RESULT)[1]["outcome"], "preempted");
    });
}
