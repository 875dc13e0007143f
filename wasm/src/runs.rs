//! Runs whose states are the same to the bit wherever they are made: a test compares those of the module with native ones.
//!
//! **Invariant:** nothing of a run depends on the machine.

use std::fmt::Write as _;

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;

/// Steps of a run.
pub const STEPS: u64 = 20_000;

/// One line for each run, by each method, with both numbers of links, without and with the
/// controller: its name, and the bits of its last state, effort and time.
#[must_use]
pub fn text() -> String {
    let mut text = String::new();
    for method in Method::ALL {
        for on in [false, true] {
            line::<2>(&mut text, method, on);
            line::<3>(&mut text, method, on);
        }
    }
    text
}

fn line<const N: usize>(text: &mut String, method: Method, on: bool)
where
    Arm<N>: Default,
    Gains<N>: Default,
{
    let mut simulation = Simulation::<N>::new(Arm::default(), Gains::default());
    simulation.set_method(method);
    simulation.enable(on);
    let setpoint = std::array::from_fn(|i| if i == 1 { -1.3 } else { 0.9 });
    simulation.set_setpoint(Setpoint::at(setpoint));
    simulation.advance(STEPS);
    let State { position, velocity } = *simulation.state();
    let servo = if on { "on" } else { "off" };
    let _ = write!(text, "{} {N} {servo} {}", method.name(), simulation.steps());
    let values = [position, velocity, *simulation.effort()];
    for value in values.into_iter().flatten().chain([simulation.time()]) {
        let _ = write!(text, " {:016x}", value.to_bits());
    }
    text.push('\n');
}
