//! The work of the live arm in virtual time: what a wake-up leaves, and no messages without subscribers. `exchanges/arm.txt` counts
//! its steps.

use std::sync::Arc;

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

/// An arm that stays at rest at every timestep: gravity and gains are zero.
async fn weightless() -> Stage<2> {
    Stage::with_a_floating_arm().await.0
}

/// With a timestep that is too short for every machine, each wake-up works for its 5 ms. Alone, the 12 ticks of 0.2 s
/// would make 0.06 s. With a wake-up after every pause of a millisecond (two, by the timer's grain) it is at least 0.5
/// s.
#[test]
fn steps_left_by_a_wake_up_are_taken_before_the_next_tick() {
    in_virtual_time(async {
        let stage = weightless().await;
        asked(&stage.arm, of_timestep(1e-12)).await;
        work_clock::count(ms(1));
        let began = work_clock::now();
        sleep(ms(200)).await;
        let worked = work_clock::now() - began;
        let ticks_alone = 12 * WAKE_UP_BUDGET;
        assert!(worked > 4 * ticks_alone, "{worked:?}");
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
