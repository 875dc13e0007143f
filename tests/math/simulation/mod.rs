//! The live loop: motion, determinism, and the effects of each call.

mod changes;
mod motion;
mod rules;
mod stepping;

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::forward_dynamics;
use pendularm::math::integrator::{Method, increment, two_sum};
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;

use crate::stored::gains;

fn no_gains<const N: usize>() -> Gains<N> {
    gains([0.0; N], [0.0; N], [0.0; N])
}

/// Steps without effort, with only the method and the dynamics, summed like in the simulation.
struct Offline<const N: usize> {
    arm: Arm<N>,
    method: Method,
    dt: f64,
    state: State<N>,
    carry: State<N>,
}

impl<const N: usize> Offline<N> {
    fn new(arm: Arm<N>, method: Method, dt: f64, state: State<N>) -> Self {
        Self {
            arm,
            method,
            dt,
            state,
            carry: State::rest(),
        }
    }

    fn step(&mut self) {
        let State {
            position: q,
            velocity: v,
        } = &mut self.state;
        let acceleration =
            |_, q: &[f64; N], v: &[f64; N]| forward_dynamics(&self.arm, q, v, &[0.0; N]);
        let (dq, dv) = increment(self.method, acceleration, 0.0, q, v, self.dt);
        for i in 0..N {
            (q[i], self.carry.position[i]) = two_sum(q[i], dq[i] + self.carry.position[i]);
            (v[i], self.carry.velocity[i]) = two_sum(v[i], dv[i] + self.carry.velocity[i]);
        }
    }
}

/// Two links swinging under control, away from anything special.
fn moving(method: Method) -> Simulation<2> {
    let mut simulation = Simulation::new(Arm::default(), Gains::default());
    simulation.set_method(method);
    simulation.set_setpoint(Setpoint {
        position: [0.7, -1.1],
        velocity: [0.1, 0.0],
    });
    simulation.enable(true);
    simulation
}
