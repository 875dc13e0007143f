//! Runs whose states are bit-identical on every machine. A test compares those of the module with native ones.
//!
//! **Invariant:** a run does not depend on the machine.

use std::fmt::Write as _;
use std::time::Duration;

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;

use crate::Kernel;

/// Calls of the study and of inverse kinematics whose answers are also compared: the service and its arguments.
const QUESTIONS: [(&str, &str); 7] = [
    ("/study/stability", "{}"),
    (
        "/study/stability",
        r#"{"integrator":"verlet","control_period":0.004,"params":{"gravity":3.7}}"#,
    ),
    (
        "/study/stability",
        r#"{"integrator":"euler","gains":{"kp":0,"ki":0,"kd":0}}"#,
    ),
    ("/study/gains", "{}"),
    (
        "/study/rollout",
        r#"{"reference":true,"samples":20,"duration":3}"#,
    ),
    ("/ik/solve", r#"{"x":0.7,"y":0.9,"phi":0.4}"#),
    ("/ik/solve", r#"{"x":-0.31,"y":-1.27,"phi":2.4}"#),
];

/// Steps of a run.
pub const STEPS: u64 = 20_000;

/// The text has one line for each run: each method, both numbers of links, without and with the controller. A line has
/// the name and the bits of the last state, effort and time. After these there is one line for each answer.
#[must_use]
pub fn text() -> String {
    let mut text = String::new();
    for method in Method::ALL {
        for on in [false, true] {
            line::<2>(&mut text, method, on);
            line::<3>(&mut text, method, on);
        }
    }
    answers::<2>(&mut text);
    answers::<3>(&mut text);
    text
}

/// The answers to all calls, for an arm whose time does not advance.
fn answers<const N: usize>(text: &mut String)
where
    Arm<N>: Default,
{
    let mut kernel = Kernel::<N>::new(|| Duration::ZERO, 0);
    for (service, args) in QUESTIONS {
        kernel.receive(&format!(
            r#"{{"op":"call_service","service":"{service}","args":{args}}}"#
        ));
        while kernel.compute(Duration::MAX) {}
        text.push_str(&String::from_utf8_lossy(&kernel.take_frames()));
    }
}

fn line<const N: usize>(text: &mut String, method: Method, on: bool)
where
    Arm<N>: Default,
{
    let mut simulation = Simulation::<N>::new(Arm::default(), Gains::default());
    simulation.set_method(method);
    simulation.enable(on);
    let setpoint = std::array::from_fn(|i| if i == 1 { -1.3 } else { 0.9 });
    simulation.set_setpoint(Setpoint::at(setpoint));
    simulation.advance(STEPS);
    let State { position, velocity } = *simulation.state();
    let controller = if on { "on" } else { "off" };
    let _ = write!(
        text,
        "{} {N} {controller} {}",
        method.name(),
        simulation.steps()
    );
    let values = [position, velocity, *simulation.effort()];
    for value in values.into_iter().flatten().chain([simulation.time()]) {
        let _ = write!(text, " {:016x}", value.to_bits());
    }
    text.push('\n');
}
