//! One goal at a time, one result each: preemption and cancellation.

use super::*;

/// Also with a `success_hold` of 0 the new goal's feedback and result come last.
#[test]
fn a_preempting_goal_comes_after_the_old_result_and_before_its_own_trajectory() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        for topic in [RESULT, FEEDBACK, "/joint_trajectory"] {
            client.subscribe(topic).await;
        }
        let old = stage.send_goal(elsewhere()).await;
        // Between two feedback messages.
        client.messages_for(ms(105), RESULT).await;
        client.heard.clear();
        let at_once = json!({"x": 2, "y": 0, "epsilon": 0.1, "success_hold": 0});
        let values = client.ask(SEND, at_once).await;
        let new = values["goal_id"].as_str().unwrap().to_owned();
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
        // The end effector is at (2, 0), the old target at (1, 1).
        let distance = number(&old["final_distance"]);
        assert!((distance - std::f64::consts::SQRT_2).abs() < ROUNDING);
    });
}

/// 253 ms after its start the old goal has been reached, but the arm finds that out only now, on being asked for the
/// new goal: the word of it and the new goal cross on their way.
#[test]
fn a_goal_reached_in_the_instant_of_the_next_has_one_result_and_it_says_reached() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        for _ in 0..10 {
            let old = stage.send_goal(here(0.25)).await;
            client.settle().await;
            pass(ms(253)).await;
            client.heard.clear();
            stage.send_goal(elsewhere()).await;
            client.settle().await;
            assert_eq!(client.story(), [format!("{RESULT} {old} reached")]);
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
        let mut sent = Vec::new();
        // Goals, some reached, some replaced, some cancelled, some lost to a reset.
        for round in 0_u64..60 {
            sent.push(stage.send_goal(here(0.02)).await);
            pass(ms(round % 31)).await;
            match round % 4 {
                0 => sent.push(stage.send_goal(elsewhere()).await),
                1 => drop(stage.cancel().await),
                2 => stage.reset().await,
                _ => {}
            }
        }
        let _ = stage.cancel().await;
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

/// The order of its responses and messages is meant, and that its next frame waits until a call has had its effects.
#[test]
fn what_one_connection_sends_takes_effect_in_order_without_waiting_for_answers() {
    in_virtual_time(async {
        let (_stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        client.heard.clear();
        for frame in [
            call(SEND, &elsewhere_as_args()),
            call(SEND, &elsewhere_as_args()),
            call(CANCEL, &json!({})),
            call(CANCEL, &json!({})),
            call(SEND, &elsewhere_as_args()),
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

/// A client's calls, because an answer to another node takes a way of its own, past the messages.
#[test]
fn cancelling_publishes_the_result_and_then_answers_with_nothing() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        for named in [false, true] {
            let goal_id = stage.send_goal(elsewhere()).await;
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
fn cancelling_another_goal_or_a_malformed_id_is_rejected_without_side_effects() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(RESULT).await;
        let old = stage.send_goal(elsewhere()).await;
        let active = stage.send_goal(elsewhere()).await;
        client.settle().await;
        client.heard.clear();
        for another in [&old, ""] {
            let goal = Meant::Called(another.to_owned());
            let refused = asked(&stage.action, CancelGoal { goal }).await;
            let active = active.clone();
            assert_eq!(refused, Err(CancelRejected::OtherGoal { active }));
        }
        for malformed in [json!(7), json!([active])] {
            let response = client.call(CANCEL, json!({"goal_id": malformed})).await;
            assert_eq!(response["result"], false);
            assert_eq!(response["values"], json!({}));
            let why = response["status"].as_str().unwrap();
            assert!(why.starts_with("goal_id "), "{why}");
        }
        assert!(client.messages(RESULT).is_empty());
        let goal = Meant::Called(active);
        assert_eq!(asked(&stage.action, CancelGoal { goal }).await, Ok(()));
    });
}

/// Notes what reaches it.
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
    type Result = Tracking<2>;

    fn handle(&mut self, goal: TrackGoal<2>, _: &mut Context<Self>) -> Tracking<2> {
        self.0.send("announced").unwrap();
        Tracking {
            positions: goal.solution,
            before: None,
            obstacle: None,
        }
    }
}

/// Else subscribers would see the old goal's trajectory as the new goal's.
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
