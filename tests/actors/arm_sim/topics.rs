//! Topics that somebody wants: how often they come, and what they say.

use super::*;

#[test]
fn states_go_out_sixty_times_a_second() {
    in_virtual_time(async {
        let bench = ArmBench::<3>::new(Arm::default());
        bench.want(Topic::JointStates, true).await;
        bench.want(Topic::Clock, true).await;
        for paused in [false, true] {
            bench.ask(pause(paused)).await;
            bench.heard.take();
            sleep(ms(10_000)).await;
            let said = bench.heard.take();
            let count = |topic: Topic| {
                said.iter()
                    .filter(|one| matches!(one, Said::Published(of, _) if *of == topic))
                    .count()
            };
            // The tick at either end may fall on this side of it or that.
            assert!(
                (599..=601).contains(&count(Topic::JointStates)),
                "{}",
                count(Topic::JointStates)
            );
            assert_eq!(count(Topic::Clock), count(Topic::JointStates));
        }
    });
}

#[test]
fn nothing_is_said_on_a_topic_that_nobody_wants() {
    in_virtual_time(async {
        let bench = ArmBench::<2>::new(Arm::default());
        sleep(ms(3000)).await;
        bench.ask(pause(true)).await;
        bench.ask(pause(false)).await;
        assert_eq!(bench.heard.take(), [Said::Answered, Said::Answered]);
        for topic in [Topic::JointStates, Topic::Clock, Topic::Diagnostics] {
            bench.want(topic, true).await;
            bench.want(topic, true).await;
            sleep(ms(2500)).await;
            let said = bench.heard.take();
            assert!(!said.is_empty());
            assert!(
                said.iter()
                    .all(|one| matches!(one, Said::Published(of, _) if *of == topic)),
                "{topic:?}"
            );
            bench.want(topic, false).await;
            bench.heard.take();
            sleep(ms(2500)).await;
            assert_eq!(bench.heard.take(), []);
        }
    });
}

#[test]
fn a_divergence_is_told_at_once_and_holds_until_the_reset() {
    in_virtual_time(async {
        let bench = ArmBench::<2>::new(Arm::default());
        bench.want(Topic::Diagnostics, true).await;
        bench
            .ask(SetGains {
                kp: Some([1e6; 2]),
                kd: Some([1e5; 2]),
                ..SetGains::default()
            })
            .await;
        bench.ask(of_timestep(0.02)).await;
        bench.ask(enable(true)).await;
        bench.hold([1.0; 2], [0.0; 2]).await;
        bench.heard.take();
        // Where the offline simulation diverges, the live one does.
        let mut offline = bench.snapshot().await;
        offline.advance(u64::MAX);
        let divergence = offline.divergence().unwrap();
        sleep(ms(3000)).await;
        assert_eq!(bench.snapshot().await, offline);
        let told: Vec<Value> = bench
            .heard
            .messages(Topic::Diagnostics)
            .into_iter()
            .filter(|message| message["status"][0]["level"] == 2)
            .collect();
        let message = told[0]["status"][0]["message"].as_str().unwrap();
        assert!(message.starts_with("diverged: "), "{message}");
        assert!(
            message.contains(&format!("step {}", divergence.step)),
            "{message}"
        );
        assert!(
            message.contains(&format!("t = {} s", divergence.time)),
            "{message}"
        );
        bench.ask(pause(true)).await;
        bench.ask(pause(false)).await;
        sleep(ms(1000)).await;
        assert_eq!(bench.snapshot().await, offline);
        bench.ask(enable(false)).await;
        bench.ask(Reset::default()).await;
        sleep(ms(1000)).await;
        assert_eq!(bench.steps().await, 50);
    });
}

#[test]
fn diagnostics_come_once_a_second_with_rates_of_virtual_time() {
    in_virtual_time(async {
        let bench = ArmBench::<2>::new(Arm::default());
        bench.want(Topic::Diagnostics, true).await;
        sleep(ms(10_500)).await;
        let messages = bench.heard.messages(Topic::Diagnostics);
        assert_eq!(messages.len(), 10);
        for message in &messages[1..] {
            let value = |key: &str| -> f64 {
                let values = message["status"][0]["values"].as_array().unwrap();
                let entry = values.iter().find(|entry| entry["key"] == key).unwrap();
                entry["value"].as_str().unwrap().parse().unwrap()
            };
            // A window is a second to within the millisecond of the timer's grain at either end.
            assert!((value("real_time_factor") - 1.0).abs() < 0.003, "{message}");
            assert!(
                (value("steps_per_second") - 1000.0).abs() < 3.0,
                "{message}"
            );
        }
    });
}
