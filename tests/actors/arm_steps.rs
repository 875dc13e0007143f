//! The steps of the live arm in virtual time, counted exactly: running, after a change, paused and after a stall. The arm is the offline
//! simulation, bit for bit.

use std::sync::Arc;
use std::time::Duration;

use crate::stage::{Published, Stage, asked, ms};
use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::arm::sim::{
    ArmSim, Enable, Pause, Reset, SetGains, SetIntegrator, WAKE_UP_BUDGET,
};
use pendularm::actors::node::Interest;
use pendularm::actors::resources::work_clock;
use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::Topic;
use tokio::sync::mpsc::unbounded_channel;
use tokio::time::{Instant, sleep};

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

/// The simulation once it has taken the steps that are due: a slow machine may need several wake-ups at one virtual instant.
async fn snapshot(stage: &Stage<2>) -> Simulation<2> {
    let mut before = None;
    loop {
        let simulation = stage.simulation().await;
        if before == Some(simulation.steps()) {
            return simulation;
        }
        before = Some(simulation.steps());
    }
}

async fn steps(stage: &Stage<2>) -> u64 {
    snapshot(stage).await.steps()
}

#[test]
fn the_steps_after_a_time_are_the_whole_timesteps_in_it() {
    in_virtual_time(async {
        // Reading the clock has a fixed cost, so no wake-up exceeds its budget on a busy machine.
        work_clock::count(Duration::from_micros(1));
        // Each timestep as a fraction of a second, so that the expected count is exact.
        for (numerator, denominator) in [
            (1, 1000),
            (2, 1000),
            (3, 1000),
            (1, 10_000),
            (7, 1000),
            (1, 60),
            (1, 3),
            (1, 10),
            (3, 10),
            (37, 100),
            (1, 1),
            (2, 1),
            (7, 2),
        ] {
            let timestep = numerator as f64 / denominator as f64;
            let stage = weightless().await;
            let euler = SetIntegrator {
                method: Some(Method::Euler),
                ..of_timestep(timestep)
            };
            asked(&stage.arm, euler).await;
            asked(&stage.arm, Reset::default()).await;
            let began = Instant::now();
            for pause in [300, 700, 1, 999, 50, 2950, 5000] {
                sleep(ms(pause)).await;
                let elapsed = began.elapsed();
                let expected = elapsed.as_nanos() * denominator / (numerator * 1_000_000_000);
                let simulation = snapshot(&stage).await;
                assert_eq!(
                    u128::from(simulation.steps()),
                    expected,
                    "{timestep} s after {elapsed:?}"
                );
                assert_eq!(simulation.time(), simulation.steps() as f64 * timestep);
            }
        }
    });
}

/// With a timestep that no machine can follow every wake-up works for its 5 ms. The 12 ticks of 0.2 s would make that
/// 0.06 s in all; a wake-up after every breather of a millisecond (two, by the timer's grain) 0.5 s or more.
#[test]
fn what_one_wake_up_leaves_owed_is_taken_up_before_the_next_tick() {
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

/// No other request comes in between: the request itself advances the arm to its step, not the tick before it.
#[test]
fn a_request_takes_effect_at_the_step_that_is_due_when_it_comes() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut offline = Simulation::<2>::new(Arm::default(), Gains::default());
        asked(&stage.arm, Reset::default()).await;
        let began = Instant::now();
        let step_due = || u64::try_from(began.elapsed().as_millis()).unwrap();
        for (pause, angle) in [(7, 0.3), (30, -0.4), (1, 0.5), (11, 0.6)] {
            sleep(ms(pause)).await;
            asked(&stage.arm, enable(angle > 0.0)).await;
            offline.advance(step_due() - offline.steps());
            offline.enable(angle > 0.0);
            sleep(ms(pause)).await;
            let positions = [angle, -angle];
            stage.hold(positions).await;
            offline.advance(step_due() - offline.steps());
            offline.set_setpoint(Setpoint::at(positions));
        }
        sleep(ms(5)).await;
        asked(&stage.arm, pause(true)).await;
        offline.advance(step_due() - offline.steps());
        assert_eq!(snapshot(&stage).await, offline);
    });
}

/// Where the offline simulation diverges, the live one does.
#[test]
fn a_divergence_is_told_with_its_step_and_time() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        client.subscribe("/diagnostics").await;
        let stiff = SetGains {
            kp: Some([1e6; 2]),
            kd: Some([1e5; 2]),
            ..SetGains::default()
        };
        asked(&stage.arm, stiff).await;
        asked(&stage.arm, of_timestep(0.02)).await;
        asked(&stage.arm, enable(true)).await;
        stage.hold([1.0; 2]).await;
        let mut offline = stage.simulation().await;
        offline.advance(u64::MAX);
        let divergence = offline.divergence().unwrap();
        let told = client.messages_for(ms(3000), "/diagnostics").await;
        assert_eq!(stage.simulation().await, offline);
        let told: Vec<_> = told.iter().map(|one| &one["status"][0]).collect();
        let status = told.iter().find(|one| one["level"] == 2).unwrap();
        let message = status["message"].as_str().unwrap();
        for part in [
            format!("step {}", divergence.step),
            format!("t = {} s", divergence.time),
        ] {
            assert!(message.contains(&part), "{message}");
        }
    });
}

/// The arm's own messages, before the registry could drop them.
#[test]
fn nothing_is_encoded_for_a_topic_that_nobody_wants() {
    in_virtual_time(async {
        let (sender, mut published) = unbounded_channel();
        let publish = Published(sender).start().recipient();
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
