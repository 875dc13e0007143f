//! `/ik_trial/status`, and silence where nobody listens.

use super::*;

#[test]
fn status_shows_the_trial_and_the_goal_that_it_tracks() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        client.subscribe("/ik_action/feedback").await;
        begin(&stage.trial, hard(60.0)).await;
        let status = status(&mut client).await;
        assert_eq!(status.as_object().unwrap().len(), 8);
        assert_eq!(status["running"], true);
        assert_eq!(status["duration"], 60.0);
        assert_eq!(status["targets_reached"], 0);
        assert_eq!(status["action_status"], "active");
        assert_eq!(status["target"].as_object().unwrap().len(), 2);
        let feedback = client.messages("/ik_action/feedback").pop().unwrap();
        assert_eq!(status["target"], feedback["target"]);
        assert_eq!(status["desired_positions"], feedback["positions"]);
        // The arm floats: the distance is the same at all times.
        assert_eq!(status["error"], feedback["distance_remaining"]);
    });
}

#[test]
fn status_comes_at_10_hz_from_the_first_start_on_also_when_the_trial_is_over_or_the_arm_paused() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        let before = client.messages_for(ms(1000), STATUS).await;
        assert!(before.is_empty(), "no trial exists yet");
        begin(&stage.trial, hard(60.0)).await;
        // The changes at the start are reported at once; from then on nothing changes.
        client.messages_for(ms(50), STATUS).await;
        for _ in 0..3 {
            let statuses = client.messages_for(ms(2000), STATUS).await;
            assert_eq!(statuses.len(), 20);
            for pair in statuses.windows(2) {
                let gap = number(&pair[1]["elapsed"]) - number(&pair[0]["elapsed"]);
                assert!((gap - 0.1).abs() < ROUNDING, "the clock is the present one");
            }
        }
        stage.pause(true).await;
        assert_eq!(client.messages_for(ms(2000), STATUS).await.len(), 20);
        asked(&stage.trial, StopTrial).await.unwrap();
        client.messages_for(ms(1), STATUS).await;
        assert_eq!(client.messages_for(ms(2000), STATUS).await.len(), 20);
    });
}

#[test]
fn status_comes_at_every_change_too() {
    in_virtual_time(async {
        let (stage, mut client) = floating_and_watched().await;
        begin(&stage.trial, easy(10.0, 0.04)).await;
        client.messages_for(ms(60), STATUS).await;
        asked(&stage.trial, SkipTarget).await.unwrap();
        stage.cancel().await.unwrap();
        asked(&stage.trial, StopTrial).await.unwrap();
        client.messages_for(ms(1), STATUS).await;
        let story: Vec<String> = client
            .messages(STATUS)
            .iter()
            .map(|status| {
                let (running, count) = (&status["running"], &status["targets_reached"]);
                format!(
                    "{running} {count} {}",
                    status["action_status"].as_str().unwrap()
                )
            })
            .collect();
        assert_eq!(
            story,
            [
                "true 0 active",
                "true 1 reached",
                "true 1 active",
                "true 1 active",
                "true 1 preempted",
                "false 1 idle",
            ]
        );
    });
}

/// The node's own messages, before the registry could drop them.
#[test]
fn no_status_is_encoded_while_nobody_wants_it() {
    in_virtual_time(async {
        let arm = SilentArm.start();
        let (sender, mut published) = unbounded_channel();
        let publish: Recipient<Publish> = Published(sender).start().recipient();
        let ik = Ik::<2>::new(arm.clone().recipient()).start();
        let action =
            IkAction::new(ik.recipient(), SilentArm::tracker(&arm), publish.clone()).start();
        let goals = GoalClient {
            send: action.clone().recipient(),
            cancel: action.clone().recipient(),
            barrier: action.recipient(),
        };
        let rng = fastrand::Rng::with_seed(1);
        let trial = IkTrial::new(arm.recipient(), goals, publish, rng).start();
        for (wanted, expected) in [(false, 0), (true, 2), (false, 0)] {
            let topic = Topic::TrialStatus;
            trial.send(Interest { topic, wanted }).await.unwrap();
            begin(&trial, StartTrial::default()).await;
            // The accepted goal, and one message of the 10 Hz.
            pass(ms(150)).await;
            let mut statuses = 0;
            while let Ok(topic) = published.try_recv() {
                statuses += usize::from(topic == Topic::TrialStatus);
            }
            assert_eq!(statuses, expected);
        }
    });
}

/// In an hour the machinery of virtual time itself wakes the thread a few times; a status at 10 Hz wakes it 36,000 times.
#[test]
fn nothing_ticks_while_no_goal_is_active_no_trial_runs_and_nobody_watches() {
    counting_wake_ups(|sleeps| async move {
        let gauges = std::sync::Arc::default();
        let registry = Registry::new(std::sync::Arc::clone(&gauges)).start();
        let mut nodes = Nodes::default();
        let arm = SilentArm.start();
        let tracker = SilentArm::tracker(&arm);
        let (action, trial) =
            crate::nodes::start_goal_nodes::<2>(&registry, arm.recipient(), tracker, 1, &mut nodes);
        registry.send(Attach(nodes)).await.unwrap();
        let mut client = connect(&registry, &gauges);
        client.ask("/ik/solve", json!({"x": 1, "y": 1})).await;
        let an_hour = || async {
            let before = sleeps.load(Ordering::Relaxed);
            pass(ms(3_600_000)).await;
            sleeps.load(Ordering::Relaxed) - before
        };
        let quiet = 0..100;

        assert!(quiet.contains(&an_hour().await), "at first");
        asked(&action, theirs()).await.unwrap();
        assert!(quiet.contains(&an_hour().await), "the arm is silent");
        begin(&trial, hard(1e9)).await;
        assert!(quiet.contains(&an_hour().await), "a trial, unwatched");
        asked(&trial, StopTrial).await.unwrap();
        assert!(quiet.contains(&an_hour().await), "after the trial");
        client.subscribe(STATUS).await;
        let listening = async { client.messages_for(ms(3_600_000), STATUS).await.len() };
        let (awake, heard) = tokio::join!(an_hour(), listening);
        assert!(awake >= 36_000 && heard >= 35_999, "{awake}, {heard}");
        drop(client);
        pass(ms(1000)).await;
        assert!(quiet.contains(&an_hour().await), "the watcher is gone");
    });
}
