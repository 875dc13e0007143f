//! The four methods as the specification defines them, for any number of coordinates.

use crate::arm::State;

/// The names on the wire.
pub const METHODS: [&str; 4] = ["euler", "midpoint", "verlet", "rk4"];

/// The state after one step of `dt` from time `t`; `f(t, q, v)` is the acceleration. An unknown name gives rk4.
pub fn step(method: &str, state: &State, t: f64, dt: f64, f: impl Fn(f64, &[f64], &[f64]) -> Vec<f64>) -> State {
    let (q, v) = (&state.position, &state.velocity);
    let a = f(t, q, v);
    match method {
        "euler" => State { position: plus(q, dt, v), velocity: plus(v, dt, &a) },
        "midpoint" => {
            let (half_q, half_v) = (plus(q, 0.5 * dt, v), plus(v, 0.5 * dt, &a));
            let half_a = f(t + 0.5 * dt, &half_q, &half_v);
            State { position: plus(q, dt, &half_v), velocity: plus(v, dt, &half_a) }
        }
        "verlet" => {
            let position = plus(&plus(q, dt, v), 0.5 * dt * dt, &a);
            let next = f(t + dt, &position, &plus(v, dt, &a));
            State { position, velocity: plus(&plus(v, 0.5 * dt, &a), 0.5 * dt, &next) }
        }
        _ => {
            let (v2, v3, v4, a2, a3, a4);
            v2 = plus(v, 0.5 * dt, &a);
            a2 = f(t + 0.5 * dt, &plus(q, 0.5 * dt, v), &v2);
            v3 = plus(v, 0.5 * dt, &a2);
            a3 = f(t + 0.5 * dt, &plus(q, 0.5 * dt, &v2), &v3);
            v4 = plus(v, dt, &a3);
            a4 = f(t + dt, &plus(q, dt, &v3), &v4);
            State { position: plus(q, dt, &blend(v, &v2, &v3, &v4)), velocity: plus(v, dt, &blend(&a, &a2, &a3, &a4)) }
        }
    }
}

/// `left + factor right`.
pub(crate) fn plus(left: &[f64], factor: f64, right: &[f64]) -> Vec<f64> {
    left.iter().zip(right).map(|(left, right)| left + factor * right).collect()
}

/// The weights 1:2:2:1.
fn blend(one: &[f64], two: &[f64], three: &[f64], four: &[f64]) -> Vec<f64> {
    let inner = plus(two, 1.0, three);
    let outer = plus(one, 1.0, four);
    plus(&outer, 2.0, &inner).iter().map(|sum| sum / 6.0).collect()
}

/// Times, positions and velocities of a particle of mass 1 under `f(t)`, `steps + 1` of each.
#[must_use]
pub fn particle(method: &str, f: fn(f64) -> f64, x0: f64, v0: f64, dt: f64, steps: u32) -> [Vec<f64>; 3] {
    let mut state = State { position: vec![x0], velocity: vec![v0] };
    let (mut times, mut positions, mut velocities) = (vec![0.0], vec![x0], vec![v0]);
    for k in 0..steps {
        state = step(method, &state, f64::from(k) * dt, dt, |t, _, _| vec![f(t)]);
        times.push(f64::from(k + 1) * dt);
        positions.extend(&state.position);
        velocities.extend(&state.velocity);
    }
    [times, positions, velocities]
}
