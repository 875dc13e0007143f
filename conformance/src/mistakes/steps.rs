//! Mistakes in the four methods. Each is a step, for a particle and for the arm.

use crate::arm::State;
use crate::method::{METHODS, plus, step};

/// The acceleration at a time, a position and a velocity.
pub type Force<'a> = &'a dyn Fn(f64, &[f64], &[f64]) -> Vec<f64>;

/// A step of a length from a time.
pub type Step = fn(&State, f64, f64, Force) -> State;

/// A mistake: the method, its description, and the step.
pub type Stepper = (&'static str, &'static str, Step);

fn state(position: Vec<f64>, velocity: Vec<f64>) -> State {
    State { position, velocity }
}

/// A midpoint step whose middle is evaluated at `at` of the step, and whose position takes `position`.
fn midpoint(s: &State, t: f64, dt: f64, f: Force, at: f64, position: fn(&[f64], &[f64], &[f64], f64) -> Vec<f64>) -> State {
    let (q, v) = (&s.position, &s.velocity);
    let (half_q, half_v) = (plus(q, 0.5 * dt, v), plus(v, 0.5 * dt, &f(t, q, v)));
    let velocity = plus(v, dt, &f(t + at * dt, &half_q, &half_v));
    state(plus(q, dt, &position(v, &half_v, &velocity, dt)), velocity)
}

/// A step of Verlet with `half` of the acceleration in the position, and the two accelerations by these weights.
fn verlet(s: &State, t: f64, dt: f64, f: Force, half: f64, [old, new]: [f64; 2]) -> State {
    let (q, v) = (&s.position, &s.velocity);
    let a = f(t, q, v);
    let position = plus(&plus(q, dt, v), half * dt * dt, &a);
    let next = f(t + dt, &position, &plus(v, dt, &a));
    state(position, plus(&plus(v, old * dt, &a), new * dt, &next))
}

/// The stages of a step of Runge-Kutta: the stage that each one starts from, its part of the step, and the part of its time.
struct Stages {
    from: [usize; 3],
    part: [f64; 3],
    at: [f64; 3],
    weights: [f64; 4],
}

const RIGHT: Stages =
    Stages { from: [0, 1, 2], part: [0.5, 0.5, 1.0], at: [0.5, 0.5, 1.0], weights: [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0] };

/// Velocities and accelerations of the stages.
#[allow(clippy::indexing_slicing, reason = "a stage starts from an earlier one")]
fn stages(s: &State, t: f64, dt: f64, f: Force, by: &Stages) -> Vec<(Vec<f64>, Vec<f64>)> {
    let (q, v) = (&s.position, &s.velocity);
    let mut known = vec![(v.clone(), f(t, q, v))];
    for ((from, part), at) in by.from.into_iter().zip(by.part).zip(by.at) {
        let (rate, a) = &known[from];
        let velocity = plus(v, part * dt, a);
        let a = f(t + at * dt, &plus(q, part * dt, rate), &velocity);
        known.push((velocity, a));
    }
    known
}

fn rk4(s: &State, t: f64, dt: f64, f: Force, by: &Stages) -> State {
    let (mut q, mut v) = (s.position.clone(), s.velocity.clone());
    for ((rate, a), weight) in stages(s, t, dt, f, by).iter().zip(by.weights) {
        q = plus(&q, weight * dt, rate);
        v = plus(&v, weight * dt, a);
    }
    state(q, v)
}

/// All mistakes.
pub const STEPPERS: &[Stepper] = &[
    ("euler", "updates the velocity first, and the position with the new velocity", |s, t, dt, f| {
        let velocity = plus(&s.velocity, dt, &f(t, &s.position, &s.velocity));
        state(plus(&s.position, dt, &velocity), velocity)
    }),
    ("euler", "updates the position first, and takes the force there", |s, t, dt, f| {
        let position = plus(&s.position, dt, &s.velocity);
        let velocity = plus(&s.velocity, dt, &f(t, &position, &s.velocity));
        state(position, velocity)
    }),
    ("euler", "takes the force at the end of the step", |s, t, dt, f| {
        state(plus(&s.position, dt, &s.velocity), plus(&s.velocity, dt, &f(t + dt, &s.position, &s.velocity)))
    }),
    ("euler", "adds a dt^2 / 2 to the position", |s, t, dt, f| {
        let a = f(t, &s.position, &s.velocity);
        state(plus(&plus(&s.position, dt, &s.velocity), 0.5 * dt * dt, &a), plus(&s.velocity, dt, &a))
    }),
    ("midpoint", "moves the position with the velocity at the end", |s, t, dt, f| midpoint(s, t, dt, f, 0.5, |_, _, end, _| end.to_vec())),
    ("midpoint", "moves the position with the velocity at the start", |s, t, dt, f| midpoint(s, t, dt, f, 0.5, |v, _, _, _| v.to_vec())),
    ("midpoint", "moves the position with the mean of the velocities at both ends", |s, t, dt, f| {
        midpoint(s, t, dt, f, 0.5, |v, _, end, _| plus(&plus(v, 1.0, end), -0.5, &plus(v, 1.0, end)))
    }),
    ("midpoint", "takes the force of the middle at the time of the start", |s, t, dt, f| {
        midpoint(s, t, dt, f, 0.0, |_, half, _, _| half.to_vec())
    }),
    ("midpoint", "takes the force of the middle at the time of the end", |s, t, dt, f| {
        midpoint(s, t, dt, f, 1.0, |_, half, _, _| half.to_vec())
    }),
    ("midpoint", "takes half a step", |s, t, dt, f| {
        let middle = plus(&s.velocity, 0.5 * dt, &f(t, &s.position, &s.velocity));
        state(plus(&s.position, 0.5 * dt, &s.velocity), middle)
    }),
    ("verlet", "takes the old acceleration twice", |s, t, dt, f| verlet(s, t, dt, f, 0.5, [1.0, 0.0])),
    ("verlet", "takes the new acceleration twice", |s, t, dt, f| verlet(s, t, dt, f, 0.5, [0.0, 1.0])),
    ("verlet", "adds both accelerations without the factor 1/2", |s, t, dt, f| verlet(s, t, dt, f, 0.5, [1.0, 1.0])),
    ("verlet", "leaves the factor 1/2 out of the position", |s, t, dt, f| verlet(s, t, dt, f, 1.0, [0.5, 0.5])),
    ("verlet", "leaves the acceleration out of the position", |s, t, dt, f| verlet(s, t, dt, f, 0.0, [0.5, 0.5])),
    ("verlet", "takes the second acceleration at the old velocity", |s, t, dt, f| {
        let a = f(t, &s.position, &s.velocity);
        let position = plus(&plus(&s.position, dt, &s.velocity), 0.5 * dt * dt, &a);
        let next = f(t + dt, &position, &s.velocity);
        state(position, plus(&plus(&s.velocity, 0.5 * dt, &a), 0.5 * dt, &next))
    }),
    ("rk4", "has a third stage that uses k1", |s, t, dt, f| rk4(s, t, dt, f, &Stages { from: [0, 0, 2], ..RIGHT })),
    ("rk4", "has a last stage that uses k1", |s, t, dt, f| rk4(s, t, dt, f, &Stages { from: [0, 1, 0], ..RIGHT })),
    ("rk4", "has a last stage that uses k2", |s, t, dt, f| rk4(s, t, dt, f, &Stages { from: [0, 1, 1], ..RIGHT })),
    ("rk4", "has a last stage at half a step", |s, t, dt, f| rk4(s, t, dt, f, &Stages { part: [0.5; 3], at: [0.5; 3], ..RIGHT })),
    ("rk4", "has a last stage at the time of the middle", |s, t, dt, f| rk4(s, t, dt, f, &Stages { at: [0.5; 3], ..RIGHT })),
    ("rk4", "has inner stages at a whole step", |s, t, dt, f| rk4(s, t, dt, f, &Stages { part: [1.0; 3], at: [1.0; 3], ..RIGHT })),
    ("rk4", "takes the force of all stages at the time of the start", |s, t, dt, f| rk4(s, t, dt, f, &Stages { at: [0.0; 3], ..RIGHT })),
    ("rk4", "weighs its stages 1:1:1:1", |s, t, dt, f| rk4(s, t, dt, f, &Stages { weights: [0.25; 4], ..RIGHT })),
    ("rk4", "weighs its stages 1:3:3:1", |s, t, dt, f| rk4(s, t, dt, f, &Stages { weights: [0.125, 0.375, 0.375, 0.125], ..RIGHT })),
    ("rk4", "weighs its stages 1:2:2:1 over 8", |s, t, dt, f| rk4(s, t, dt, f, &Stages { weights: [0.125, 0.25, 0.25, 0.125], ..RIGHT })),
    ("rk4", "moves the position with the velocity at the start", |s, t, dt, f| {
        state(plus(&s.position, dt, &s.velocity), rk4(s, t, dt, f, &RIGHT).velocity)
    }),
    ("rk4", "moves the position with the velocity at the end", |s, t, dt, f| {
        let velocity = rk4(s, t, dt, f, &RIGHT).velocity;
        state(plus(&s.position, dt, &velocity), velocity)
    }),
];

/// Mistakes that each method can have. The step is that of the method.
pub const COMMON: [(&str, Variant); 8] = [
    ("the force has the wrong sign", |method, s, t, dt, f| step(method, s, t, dt, |t, q, v| f(t, q, v).iter().map(|a| -a).collect())),
    ("the force is twice as large", |method, s, t, dt, f| step(method, s, t, dt, |t, q, v| f(t, q, v).iter().map(|a| 2.0 * a).collect())),
    ("the time is one step ahead", |method, s, t, dt, f| step(method, s, t + dt, dt, f)),
    ("the time is one step behind", |method, s, t, dt, f| step(method, s, t - dt, dt, f)),
    ("the time does not advance", |method, s, _, dt, f| step(method, s, 0.0, dt, f)),
    ("the step is half as long", |method, s, t, dt, f| step(method, s, t, 0.5 * dt, f)),
    ("the step is twice as long", |method, s, t, dt, f| step(method, s, t, 2.0 * dt, f)),
    ("the position is not updated", |method, s, t, dt, f| state(s.position.clone(), step(method, s, t, dt, f).velocity)),
];

/// A step of a method with a mistake.
pub type Variant = fn(&str, &State, f64, f64, Force) -> State;

/// The steps that a wrong implementation of a method may take, with their descriptions.
pub fn steps<'a>(method: &'static str) -> Vec<(String, Box<dyn Fn(&State, f64, f64, Force) -> State + 'a>)> {
    let mut all: Vec<(String, Box<dyn Fn(&State, f64, f64, Force) -> State>)> = Vec::new();
    for (_, says, step) in STEPPERS.iter().filter(|(of, ..)| *of == method) {
        all.push((format!("a {method} that {says}"), Box::new(step)));
    }
    for other in METHODS.into_iter().filter(|other| *other != method) {
        all.push((format!("{other} instead of {method}"), Box::new(move |s, t, dt, f| step(other, s, t, dt, f))));
    }
    for (says, variant) in COMMON {
        all.push((format!("a {method} in which {says}"), Box::new(move |s, t, dt, f| variant(method, s, t, dt, f))));
    }
    all
}

/// Positions and velocities of a particle, from the start on.
pub fn particle(step: impl Fn(&State, f64, f64, Force) -> State, f: fn(f64) -> f64, start: [f64; 2], dt: f64, steps: u32) -> Vec<f64> {
    let [x, v] = start;
    let mut own = state(vec![x], vec![v]);
    let (mut positions, mut velocities) = (vec![x], vec![v]);
    for k in 0..steps {
        own = step(&own, f64::from(k) * dt, dt, &|t, _, _| vec![f(t)]);
        positions.extend(&own.position);
        velocities.extend(&own.velocity);
    }
    [positions, velocities].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[allow(clippy::indexing_slicing, reason = "a test that panics has failed")]
    fn the_right_stages_are_the_method() {
        let force = |t: f64, q: &[f64], v: &[f64]| vec![t.sin() - q[0] + 0.1 * v[0] * v[0]];
        let start = state(vec![0.3], vec![-0.7]);
        let (one, other) = (rk4(&start, 0.4, 0.1, &force, &RIGHT), step("rk4", &start, 0.4, 0.1, force));
        assert!((one.position[0] - other.position[0]).abs() < 1e-15 && (one.velocity[0] - other.velocity[0]).abs() < 1e-15);
    }
}
