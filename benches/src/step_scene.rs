//! The arm whose steps are counted: bent and at rest, with a setpoint at its own pose, so that no run diverges.

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;

/// The default gains without damping, and with hardly an integral, which would drive an undamped arm away.
pub fn undamped<const N: usize>() -> Gains<N> {
    let gains = Gains::default();
    Gains {
        kp: gains.kp,
        ki: gains.ki.map(|ki| 1e-3 * ki),
        kd: [0.0; N],
    }
}

/// The arm before its first step, with the default gains or without their integral part, its controller on or off.
pub fn ready<const N: usize>(
    gravity: f64,
    integral: bool,
    control: bool,
    method: Method,
) -> Simulation<N> {
    let arm = Arm::new([1.0; N], [1.0; N], gravity).unwrap_or_default();
    let mut gains = Gains::default();
    if !integral {
        gains.ki = [0.0; N];
    }
    let mut simulation = Simulation::new(arm, gains);
    simulation.set_method(method);
    // Angles stay small enough for one path through sine and cosine.
    simulation.set_state(State {
        position: [0.4; N],
        velocity: [0.0; N],
    });
    simulation.set_setpoint(Setpoint::at([0.4; N]));
    simulation.enable(control);
    simulation
}
