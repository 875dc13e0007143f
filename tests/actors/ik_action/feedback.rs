//! How a goal is reported on, and to whom.

use super::*;

#[test]
fn feedback_tells_goal_target_setpoint_distance_and_time() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(FEEDBACK).await;
        client.subscribe("/joint_trajectory").await;
        let goal_id = stage.send_goal(elsewhere()).await;
        let trajectory = client.message("/joint_trajectory").await;
        let feedback = client.message(FEEDBACK).await;
        assert_eq!(feedback.as_object().unwrap().len(), 5);
        assert_eq!(feedback["goal_id"], goal_id);
        assert_eq!(feedback["target"], json!({"x": 1.0, "y": 1.0}));
        assert_eq!(feedback["positions"], trajectory["points"][0]["positions"]);
        let distance = number(&feedback["distance_remaining"]);
        assert!((distance - std::f64::consts::SQRT_2).abs() < ROUNDING);
        assert!((number(&feedback["elapsed"]) - STEP).abs() < ROUNDING);
    });
}

/// After 1 ms, then in every sixtieth of a second that follows: 120 in two seconds.
#[test]
fn feedback_comes_60_times_per_second_of_simulation_progress() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(FEEDBACK).await;
        stage.send_goal(elsewhere()).await;
        client.messages_for(ms(2000), FEEDBACK).await;
        client.settle().await;
        assert_eq!(client.messages(FEEDBACK).len(), 120);
        let elapsed: Vec<f64> = client
            .messages(FEEDBACK)
            .iter()
            .map(|message| number(&message["elapsed"]))
            .collect();
        for pair in elapsed.windows(2) {
            // The first step of each period: 16 or 17 steps apart.
            let gap = (pair[1] - pair[0]) / STEP;
            assert!((15.9..17.1).contains(&gap), "{gap}");
        }
    });
}

/// The pause itself takes the steps that are due, and their feedback goes by way of another node.
#[test]
fn none_comes_after_the_answer_to_a_pause() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(FEEDBACK).await;
        stage.send_goal(elsewhere()).await;
        for k in 0..40 {
            stage.pause(false).await;
            pass(Duration::from_micros(16_100 + 137 * k)).await;
            client.heard.clear();
            client.ask("/arm_sim/pause", json!({"data": true})).await;
            client.settle().await;
            assert_eq!(client.story().last().unwrap(), "/arm_sim/pause", "{k}");
        }
    });
}

#[test]
fn a_trajectory_from_somebody_else_moves_the_setpoint_and_nothing_of_the_goal() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        client.subscribe(FEEDBACK).await;
        client.subscribe(RESULT).await;
        let goal_id = stage.send_goal(elsewhere()).await;
        let before = client.message(FEEDBACK).await;
        stage.hold([0.25, 0.5]).await;
        let setpoint = *stage.simulation().await.pid().setpoint();
        assert_eq!(setpoint.position, [0.25, 0.5]);
        client.heard.clear();
        let after = client.messages_for(ms(500), FEEDBACK).await.pop().unwrap();
        assert_eq!(after["goal_id"], goal_id);
        assert_eq!(after["positions"], before["positions"]);
        assert!(client.messages(RESULT).is_empty());
        assert_eq!(stage.cancel().await, Ok(()));
    });
}

/// The node's own messages, before the registry could drop them.
#[test]
fn nothing_is_encoded_for_a_topic_that_nobody_wants() {
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
                let judged = GoalJudged {
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
