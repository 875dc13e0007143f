//! The tick during floods of messages and endless steps.

use super::*;
use crate::arm_steps::{enable, of_timestep};
use pendularm::actors::arm::sim::{
    ArmPose, ArmSettings, Disturb, EndGoal, SetSetpoint, SimulationTime, TURN_MESSAGES,
};
use pendularm::math::pid::Setpoint;

/// Messages of one kind.
const FLOOD: usize = 100 * TURN_MESSAGES;

/// A kind of message, whether each has an answer, and how the `n`th is sent.
type Kind = (&'static str, bool, fn(&TurnsBench, usize));

const KINDS: [Kind; 14] = [
    ("params", true, |bench, _| {
        drop(bench.ask(1, SetParams::default()));
    }),
    ("gains", true, |bench, _| {
        drop(bench.ask(1, SetGains::default()));
    }),
    ("timesteps", true, |bench, n| {
        drop(bench.ask(1, of_timestep(1e-3 + 1e-9 * n as f64)));
    }),
    ("pushes", true, |bench, _| {
        bench.ask(
            1,
            Disturb {
                effort: Some([0.0; 3]),
                duration: Some(1.0),
                rejected: Rejections::default(),
            },
        );
    }),
    ("switches", true, |bench, n| {
        drop(bench.ask(1, enable(n % 2 == 0)));
    }),
    ("resumes", true, |bench, _| drop(bench.ask(1, pause(false)))),
    ("steps", true, |bench, _| drop(bench.step(1, 1))),
    ("resets", true, |bench, _| {
        drop(bench.ask(1, Reset::default()))
    }),
    ("setpoints", false, |bench, _| {
        bench.arm.do_send(SetSetpoint {
            setpoint: Setpoint::default(),
            done: None,
        });
    }),
    ("interests", false, |bench, n| {
        bench.arm.do_send(Interest {
            topic: Topic::RobotDescription,
            wanted: n % 2 == 0,
        });
    }),
    ("times", false, |bench, _| bench.arm.do_send(SimulationTime)),
    ("poses", false, |bench, _| bench.arm.do_send(ArmPose::<3>)),
    ("settings", false, |bench, _| {
        bench.arm.do_send(ArmSettings::<3>)
    }),
    ("ends of goals", false, |bench, n| {
        bench.arm.do_send(EndGoal::<3> { number: n as u64 })
    }),
];

/// Each flood waits in the mailbox as a whole. The clock moves only when the arm yields.
#[test]
fn the_tick_comes_however_many_messages_wait_for_the_arm() {
    for (name, is_answered, send) in KINDS {
        in_virtual_time(async move {
            let bench = TurnsBench::new().await;
            for n in 0..FLOOD {
                send(&bench, n);
            }
            let answers = if is_answered {
                FLOOD
            } else {
                bench.ask(1, Pause::default());
                1
            };
            let turns = bench.until_answers(answers).await;
            assert!(turns >= FLOOD / TURN_MESSAGES, "{name}: {turns} turns");
            bench.assert_ticks(turns, name);
        });
    }
}
