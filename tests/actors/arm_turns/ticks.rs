//! The tick during floods of messages and endless steps.

use super::*;
use pendularm::actors::arm::sim::{
    ArmPose, ArmSettings, Disturb, Enable, EndGoal, SetSetpoint, SimulationTime, TURN_MESSAGES,
};
use pendularm::math::pid::Setpoint;

/// Each flood waits in the mailbox as a whole. The clock moves only when the arm yields.
#[test]
fn the_tick_comes_however_many_messages_wait_for_the_arm() {
    const FLOOD: usize = 100 * TURN_MESSAGES;
    type Send = fn(&TurnsBench);
    let kinds: [(&str, Send); 8] = [
        ("params", |bench| {
            let gravity = Some(9.7);
            bench.ask(
                1,
                SetParams {
                    gravity,
                    ..SetParams::default()
                },
            );
        }),
        ("gains", |bench| {
            let kp = Some([1.0, 2.0, 3.0]);
            bench.ask(
                1,
                SetGains {
                    kp,
                    ..SetGains::default()
                },
            );
        }),
        ("methods", |bench| {
            let method = Some(Method::Euler);
            bench.ask(
                1,
                SetIntegrator {
                    method,
                    ..SetIntegrator::default()
                },
            );
        }),
        ("pushes", |bench| {
            bench.ask(
                1,
                Disturb {
                    effort: Some([0.0; 3]),
                    duration: Some(1.0),
                    rejected: Rejections::default(),
                },
            );
        }),
        ("resumes", |bench| drop(bench.ask(1, pause(false)))),
        ("steps", |bench| drop(bench.step(1, 1))),
        ("switches", |bench| {
            let enabled = Some(true);
            bench.ask(
                1,
                Enable {
                    enabled,
                    ..Enable::default()
                },
            );
        }),
        ("resets", |bench| drop(bench.ask(1, Reset::default()))),
    ];
    for (name, send) in kinds {
        in_virtual_time(async move {
            let bench = TurnsBench::new().await;
            for _ in 0..FLOOD {
                send(&bench);
            }
            let turns = bench.until_answers(FLOOD).await;
            assert!(turns >= FLOOD / TURN_MESSAGES, "{turns} turns");
            bench.assert_ticks(turns, name);
        });
    }
}

#[test]
fn the_tick_comes_however_many_messages_of_other_kinds_wait() {
    const FLOOD: usize = 100 * TURN_MESSAGES;
    type Send = fn(&TurnsBench, usize);
    let kinds: [(&str, Send); 6] = [
        ("setpoints", |bench, _| {
            let (setpoint, done) = (Setpoint::default(), None);
            bench.arm.do_send(SetSetpoint { setpoint, done });
        }),
        ("interests", |bench, n| {
            let (topic, wanted) = (Topic::RobotDescription, n % 2 == 0);
            bench.arm.do_send(Interest { topic, wanted });
        }),
        ("times", |bench, _| bench.arm.do_send(SimulationTime)),
        ("poses", |bench, _| bench.arm.do_send(ArmPose::<3>)),
        ("settings", |bench, _| bench.arm.do_send(ArmSettings::<3>)),
        ("ends of goals", |bench, n| {
            let number = n as u64;
            bench.arm.do_send(EndGoal::<3> { number });
        }),
    ];
    for (name, send) in kinds {
        in_virtual_time(async move {
            let bench = TurnsBench::new().await;
            for n in 0..FLOOD {
                send(&bench, n);
            }
            bench.ask(1, Pause::default());
            let turns = bench.until_answers(1).await;
            assert!(turns >= FLOOD / TURN_MESSAGES, "{name}: {turns} turns");
            bench.assert_ticks(turns, name);
        });
    }
}
