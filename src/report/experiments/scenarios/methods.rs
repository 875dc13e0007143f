//! S36 to S39: the methods themselves.
//!
//! **Invariant:** runs that a scene compares start from the same state.

#![allow(
    clippy::indexing_slicing,
    reason = "indices name the joints of arrays of that length"
)]

use super::support::{Named, Noise, Observation, apart, each, free, verdict};
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::integrator::{Method, increment};
use crate::math::simulation::state_after;
use crate::study::error_estimate::estimate_step;
use crate::study::linear::Linear;
use crate::study::matrix::largest;
use crate::study::stability::{Sampling, step_matrix};
use crate::study::taylor::TaylorReference;

/// The checks of S36 to S39.
pub(super) const CHECKS: [Named; 4] = [
    ("S36", one_joint),
    ("S37", changes),
    ("S38", there_and_back),
    ("S39", step_doubling),
];

/// Stable by the closed forms, for `x'' = -ω² x - 2 z ω x'` with `w = (ω h)²`, `d = 2 z ω h`.
fn closed_form(method: Method, w: f64, d: f64) -> bool {
    match method {
        Method::Euler => w < d && w > 2.0 * d - 4.0,
        Method::Midpoint => {
            let trace = 2.0 - d + d * d / 2.0 - w;
            let det = 1.0 - d + d * d / 2.0 - w * d / 2.0 + w * w / 4.0;
            det < 1.0 && 1.0 + trace + det > 0.0 && 1.0 - trace + det > 0.0
        }
        Method::Verlet => d < 2.0 && w < 4.0 - 2.0 * d + d * d,
        // |R(s)| of the roots s = -d/2 ± sqrt(d²/4 - w), for Runge-Kutta methods of as many evaluations as their order.
        _ => {
            let half = d * d / 4.0 - w;
            let r = |re: f64, im: f64| {
                let (mut sum, mut power) = ((1.0, 0.0), (1.0, 0.0));
                for k in (1..=method.order()).map(f64::from) {
                    let (a, b): (f64, f64) = power;
                    power = ((a * re - b * im) / k, (a * im + b * re) / k);
                    sum = (sum.0 + power.0, sum.1 + power.1);
                }
                f64::hypot(sum.0, sum.1)
            };
            let root = half.abs().sqrt();
            if half >= 0.0 {
                r(-d / 2.0 + root, 0.0) < 1.0 && r(-d / 2.0 - root, 0.0) < 1.0
            } else {
                r(-d / 2.0, root) < 1.0
            }
        }
    }
}

fn one_joint() -> Observation {
    let mut noise = Noise::new();
    let (mut off, mut mismatches, mut close) = (0.0_f64, 0_u32, 0_u32);
    for _ in 0..20_000 {
        let (w, d) = (5.0 + 5.0 * noise.next(), 2.5 + 2.5 * noise.next());
        let linear = Linear::oscillator(w, 0.0, 0.0, d);
        for method in Method::ALL {
            let step = step_matrix(&linear, method, Sampling::Continuous, 1.0);
            let (x, v) = (noise.next(), noise.next());
            let acceleration = |_, x: &[f64; 1], v: &[f64; 1]| [-w * x[0] - d * v[0]];
            let (dx, dv) = increment(method, acceleration, 0.0, &[x], &[v], 1.0);
            // Terms of up to (w + d)² / 2.
            let size = 1.0 + (w + d) * (w + d);
            let error =
                |row: usize, to: f64| (step[(row, 0)] * x + step[(row, 1)] * v - to).abs() / size;
            off = off.max(error(0, x + dx[0])).max(error(1, v + dv[0]));
            let radius = step.spectral_radius();
            if (radius - 1.0).abs() < 1e-9 {
                close += 1;
            } else if (radius < 1.0) != closed_form(method, w, d) {
                mismatches += 1;
            }
        }
    }
    verdict(
        off < 2e-15 && mismatches == 0 && close < 10,
        format!("steps apart by {off:.1e}; {mismatches} of 80 000 verdicts differ"),
    )
}

fn swinging() -> State<3> {
    State {
        position: [0.3, 0.7, -0.4],
        velocity: [1.0, -2.0, 0.5],
    }
}

fn changes() -> Observation {
    let mut simulation = free(Arm::default(), swinging(), Method::Verlet, 0.001);
    let changes = [
        (Method::Rk4, 0.001),
        (Method::Rk4, 0.0005),
        (Method::Midpoint, 0.003),
        (Method::Verlet, 0.001),
    ];
    let kept = changes.into_iter().all(|(method, timestep)| {
        simulation.advance(100);
        let before = (*simulation.state(), simulation.time());
        simulation.set_method(method);
        simulation.set_timestep(timestep);
        before == (*simulation.state(), simulation.time())
    });
    // Half a second of Verlet, half of Runge-Kutta 4: the error goes with the square of the timestep.
    let error = |steps: u64| {
        let timestep = 0.5 / in_f64(steps);
        let mut mixed = free(Arm::default(), swinging(), Method::Verlet, timestep);
        mixed.advance(steps);
        mixed.set_method(Method::Rk4);
        mixed.advance(steps);
        let mut exact = TaylorReference::new(swinging());
        // Spans of a hundredth of a second, as far as the scheme carries.
        let is_followed = (0..100).all(|_| exact.follow(mixed.arm(), &[0.0; 3], 0.01));
        let error = apart(mixed.state(), exact.state());
        if is_followed { error } else { f64::NAN }
    };
    let slope = (error(500) / error(1000)).log2();
    let bits = if kept { "kept" } else { "lost" };
    verdict(
        kept && (slope - 2.0).abs() < 0.2,
        format!("bits {bits}; slope of the mixed swing {slope:.2}"),
    )
}

fn there_and_back() -> Observation {
    each(Method::ALL.map(|method| {
        let [_, coarse, fine] = [125, 250, 500].map(|steps| {
            let start = State {
                position: [0.5, -0.5],
                velocity: [0.2, 0.4],
            };
            let mut simulation = free(Arm::default(), start, method, 1.0 / in_f64(steps));
            for _ in 0..2 {
                simulation.advance(steps);
                let mut turned = *simulation.state();
                turned.velocity = turned.velocity.map(|v| -v);
                simulation.set_state(turned);
            }
            apart(simulation.state(), &start)
        });
        let slope = (coarse / fine).log2();
        // Errors there and back cancel in part: the order at least, up to one more.
        let order = f64::from(method.order());
        let holds = slope > order - 0.3 && slope < order + 1.3 && fine > 1e-13;
        (
            holds,
            format!("{method} misses by {fine:.1e} at 2 ms (slope {slope:.1})"),
        )
    }))
}

fn step_doubling() -> Observation {
    let h = 0.001;
    let arm = Arm::<3>::default();
    each(Method::ALL.map(|method| {
        let mut noise = Noise::new();
        let ratios = (0..50).map(|_| {
            let (position, velocity) = (noise.array(3.0), noise.array(3.0));
            let (state, effort) = (State { position, velocity }, noise.array(10.0));
            let estimate = estimate_step(&arm, &state, &effort, method, h);
            // The error of the step, against the arm followed to rounding.
            let end = state_after(&arm, method, &state, &effort, h);
            let mut exact = TaylorReference::new(state);
            let is_followed = exact.follow(&arm, &effort, h);
            let exact = exact.state().position;
            let error = largest((0..3).map(|i| (end.position[i] - exact[i]).abs()));
            let estimate = estimate.filter(|_| is_followed);
            estimate.map_or(f64::NAN, |estimate| estimate.local_error / error)
        });
        let mut ratios: Vec<f64> = ratios.collect();
        ratios.sort_by(f64::total_cmp);
        let (least, median, most) = (
            ratios[0],
            ratios[ratios.len() / 2],
            ratios[ratios.len() - 1],
        );
        let holds = (0.98..=1.03).contains(&median);
        (
            holds,
            format!("{method} {median:.4} ({least:.3} to {most:.3})"),
        )
    }))
}
