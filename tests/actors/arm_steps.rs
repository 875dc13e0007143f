//! The work of the live arm in virtual time: what a wake-up leaves, and no messages without subscribers. `exchanges/arm.txt` counts
//! its steps.

use std::sync::Arc;
use std::time::Duration;

use crate::stage::{Stage, asked, ms, publisher};
use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::arm::sim::{ArmSim, Enable, Pause, SetIntegrator, WAKE_UP_BUDGET};
use pendularm::actors::node::Interest;
use pendularm::actors::resources::work_clock;
use pendularm::math::arm::Arm;
use pendularm::math::pid::Gains;
use pendularm::protocol::catalog::Topic;
use tokio::sync::mpsc::unbounded_channel;
use tokio::time::sleep;

pub fn of_timestep(timestep: f64) -> SetIntegrator {
    SetIntegrator {
        timestep: Some(timestep),
        ..SetIntegrator::default()
    }
}

pub fn pause(paused: bool) -> Pause {
    Pause {
        paused: Some(paused),
        ..Pause::default()
    }
}

pub fn enable(enabled: bool) -> Enable {
    Enable {
        enabled: Some(enabled),
        ..Enable::default()
    }
}

/// With a timestep that is too short for every machine, each wake-up works for its 5 ms. Alone, the 12 ticks of 0.2 s
/// would make 0.06 s. With a wake-up after every pause of a millisecond (two, by the timer's grain) it is at least 0.5
/// s. Calls share the wake-ups: alone, these would take 1.6 s.
#[test]
fn an_arm_that_can_not_follow_steps_between_the_ticks_and_warns_and_answers() {
    in_virtual_time(async {
        let (stage, mut client) = Stage::<2>::with_a_floating_arm().await;
        asked(&stage.arm, of_timestep(1e-12)).await;
        work_clock::count(Duration::from_micros(100));
        let began = work_clock::now();
        sleep(ms(200)).await;
        let worked = work_clock::now() - began;
        let ticks_alone = 12 * WAKE_UP_BUDGET;
        assert!(worked > 4 * ticks_alone, "{worked:?}");
        let began = work_clock::now();
        for _ in 0..320 {
            asked(&stage.arm, Pause::default()).await;
        }
        let worked = work_clock::now() - began;
        assert!(worked < 40 * WAKE_UP_BUDGET, "{worked:?}");
        client.subscribe("/diagnostics").await;
        for (timestep, level) in [(1e-12, 1), (1e-300, 1), (0.001, 0)] {
            asked(&stage.arm, of_timestep(timestep)).await;
            sleep(ms(2000)).await;
            client.settle().await;
            let last = client.messages("/diagnostics").pop().unwrap();
            let arm = &last["status"][0];
            assert_eq!(
                (&arm["level"], &arm["message"]),
                (&level.into(), &"running".into()),
                "{arm}"
            );
            let factor = arm["values"][2]["value"].as_str().unwrap();
            let factor: f64 = factor.parse().unwrap();
            assert_eq!(factor < 0.01, level == 1, "{arm}");
        }
    });
}

/// The arm's own messages, before the registry could drop them.
#[test]
fn nothing_is_encoded_for_a_topic_without_subscribers() {
    in_virtual_time(async {
        let (sender, mut published) = unbounded_channel();
        let publish = publisher(sender);
        let arm = ArmSim::<2>::new(Arm::default(), Gains::default(), publish, Arc::default());
        let arm = arm.start();
        sleep(ms(3000)).await;
        asked(&arm, pause(true)).await;
        asked(&arm, pause(false)).await;
        assert!(published.try_recv().is_err());
        for topic in [Topic::JointStates, Topic::Clock, Topic::Diagnostics] {
            for wanted in [true, true, false] {
                arm.send(Interest { topic, wanted }).await.unwrap();
                sleep(ms(2500)).await;
                let mut came = std::iter::from_fn(|| published.try_recv().ok()).peekable();
                assert_eq!(came.peek().is_some(), wanted, "{topic:?}");
                assert!(came.all(|one| one == topic), "{topic:?}");
            }
        }
    });
}
