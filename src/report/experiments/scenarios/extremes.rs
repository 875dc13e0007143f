//! S27 to S39: values far from the ordinary, and the methods themselves.
//!
//! **Invariant:** values that no arm can have are refused by name. A run with accepted values stays finite, or the
//! scene falls short.

use std::f64::consts::{FRAC_PI_2, TAU};

use super::support::{
    Check, Noise, Observation, apart, arm, each, fastest, free, gains, held, is_near,
};
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::forward_dynamics;
use crate::math::integrator::{Method, increment};
use crate::math::pid::Gains;
use crate::math::simulation::{Simulation, state_after};
use crate::report::experiments::reference::DoubleDouble;
use crate::study::control_loop::{ControlLoop, no_control};
use crate::study::error_estimate::estimate;
use crate::study::linear::Linear;
use crate::study::matrix::{largest, largest_difference};
use crate::study::paused::at_once;
use crate::study::rollout::{Rollout, RolloutRequest, rollout};
use crate::study::stability::{Sampling, largest_timestep, step_matrix};
use crate::study::taylor::TaylorReference;

/// The checks of S27 to S39.
pub(super) const CHECKS: [(&str, Check); 13] = [
    ("S27", gravity),
    ("S28", tiny_steps),
    ("S29", huge_steps),
    ("S30", wound),
    ("S31", huge_setpoints),
    ("S32", subnormal_start),
    ("S33", subnormal_inertia),
    ("S34", refused),
    ("S35", || {
        refusal(Arm::new([1.0; 2], [0.0, 1.0], 9.81), "masses[0] must be")
    }),
    ("S36", one_joint),
    ("S37", changes),
    ("S38", there_and_back),
    ("S39", step_doubling),
];

// ---- S27 to S35: far from the ordinary -----------------------------------------------------------------------------

/// The largest error of a free swing against the study's reference, and the run \[rad\].
fn error(gravity: f64, start: [f64; 2], timestep: f64, duration: f64) -> Option<(f64, Rollout<2>)> {
    let control = ControlLoop::free(arm([1.0; 2], gravity)).with_timestep(timestep);
    let request = RolloutRequest {
        control,
        start: State::at_rest(start),
        duration,
        samples: 101,
        reference: true,
    };
    let made = at_once(rollout(request)).ok()?;
    Some((made.deviation?.error, made))
}

fn gravity() -> Observation {
    let error = |gravity, timestep, duration| {
        error(gravity, [0.5, -0.5], timestep, duration).map_or(f64::NAN, |it| it.0)
    };
    let (usual, scaled) = (error(9.81, 4e-3, 1.0), error(981.0, 4e-4, 0.1));
    let strong = error(981.0, 4e-3, 0.1);
    // Scaled time makes the first two one motion; ten times the step is 10^4 times the error, to the next order.
    let is_scaled = is_near(Some(scaled), usual, 0.01) && (strong / usual / 1e4).log2().abs() < 0.6;
    let errors = format!(
        "error {usual:.2e} rad, {scaled:.2e} in scaled time, {strong:.2e} at 100 times the gravity"
    );
    // How far a horizontal arm has fallen after 10 s, in units of `½ a t²`.
    let weak = arm([1.0; 2], 1e-12);
    let mut simulation = free(weak, State::rest(), Method::Rk4, 0.01);
    simulation.advance(1000);
    let start = forward_dynamics(&weak, &[0.0; 2], &[0.0; 2], &[0.0; 2]);
    let fallen = simulation.state().position[0] / (0.5 * start[0] * 100.0);
    let falls = format!("under 1e-12 fallen {fallen:.7} times as expected");
    each([(is_scaled, errors), ((fallen - 1.0).abs() < 1e-6, falls)])
}

fn tiny_steps() -> Observation {
    let Some((error, made)) = error(9.81, [0.3 - FRAC_PI_2, 0.0], 1e-6, 10.0) else {
        return (false, "not run".to_owned());
    };
    let end = made.times.last().copied().unwrap_or(f64::NAN);
    let late = (end - 1e7 * 1e-6).abs();
    let steps = made.steps;
    let words = format!("error {error:.1e} rad, time off by {late:e} s after {steps} steps");
    (error < 1e-13 && late == 0.0, words)
}

fn huge_steps() -> Observation {
    let hanging = [-FRAC_PI_2, 0.0];
    let mut cases = Vec::new();
    for (kind, gains) in [("free", no_control()), ("held", Gains::default())] {
        for (method, timestep) in Method::ALL
            .into_iter()
            .flat_map(|it| [(it, 0.1), (it, 1.0)])
        {
            let control = held(gains, hanging).with_method(method);
            let control = control.with_timestep(timestep);
            let limit = largest_timestep(&Linear::at_setpoint(&control), method, Sampling::Held);
            let is_predicted = limit.is_some_and(|limit| timestep > limit);
            let mut simulation = control.simulation(State::at_rest([hanging[0] + 0.01, 0.0]));
            simulation.advance(5000);
            let apart = simulation.divergence().is_some() || fastest(&simulation) > 1.0;
            let holds = simulation.state().is_finite() && apart == is_predicted;
            let word = if apart { "apart" } else { "together" };
            cases.push((holds, format!("{kind} {method} {timestep} s {word}")));
        }
    }
    each(cases)
}

/// The first joint at 1e8 rad, and at the same angle without its whole turns.
fn wound() -> Observation {
    /// The part of 2π that a double falls short of.
    const TAU_LOW: f64 = 2.449_293_598_294_706_4e-16;
    let angle = 1e8;
    let turn = DoubleDouble::from(TAU) + DoubleDouble::from(TAU_LOW);
    let turns = DoubleDouble::from((angle / TAU).round());
    let unwound = (DoubleDouble::from(angle) - turns * turn).to_f64();
    let [start, turned] = [unwound, angle].map(|first| State {
        position: [first, 0.7],
        velocity: [1.0, -2.0],
    });
    let arm = Arm::<2>::default();
    let acceleration =
        |state: &State<2>| forward_dynamics(&arm, &state.position, &state.velocity, &[0.0; 2]);
    let (a, b) = (acceleration(&start), acceleration(&turned));
    let at_once = largest_difference(&a, &b) / largest(a.iter().map(|a| a.abs()));
    let [one, mut other] = [start, turned].map(|start| {
        let mut simulation = free(arm, start, Method::Rk4, 0.001);
        simulation.advance(1000);
        *simulation.state()
    });
    // Both moved by as much; the wound one to the spacing of its doubles.
    other.position[0] = other.position[0] - angle + unwound;
    let after = apart(&one, &other);
    let words = format!("accelerations apart by {at_once:.1e}, after 1 s states by {after:.1e}");
    (at_once < 1e-13 && after < 1.5e-7, words)
}

/// A velocity beyond `1/h` is squared, times `h`, by each stage, because Coriolis forces go with its square.
fn huge_setpoints() -> Observation {
    each([(1e6, 3), (1e300, 1)].map(|(far, latest)| {
        let mut live = held(Gains::default(), [far; 2]).simulation(State::rest());
        let (holds, words) = refuses(&mut live, latest);
        (holds, format!("{far:e}: {words}"))
    }))
}

/// Whether the loop refuses one of its first steps, the `latest` at the latest, and keeps the state before it.
fn refuses(live: &mut Simulation<2>, latest: u64) -> Observation {
    let mut before = live.clone();
    let taken = live.advance(1000);
    before.advance(taken);
    let refused = live.divergence().map(|divergence| divergence.step);
    let is_kept = live.state() == before.state() && before.divergence().is_none();
    let words = refused.map_or_else(
        || "goes on".to_owned(),
        |step| format!("refuses step {step}"),
    );
    let is_due = refused.is_some_and(|step| step == taken + 1 && step <= latest);
    (is_due && is_kept, words)
}

fn subnormal_start() -> Observation {
    let control = ControlLoop {
        arm: arm([1.0; 2], 0.0),
        ..held(gains(100.0, 0.0, [10.0; 2]), [0.0; 2])
    };
    let [tiny, small] = [1e-310, 1e-300].map(|off: f64| {
        let mut live = control.simulation(State::at_rest([off, 0.0]));
        live.advance(200);
        *live.state()
    });
    // 1e-310 is 2e13 times the smallest double; a few hundred roundings of half of that.
    let off = (0..2).map(|i| (tiny.position[i] - 1e-10 * small.position[i]).abs() / 1e-310);
    let worst = largest(off);
    let words = format!("apart by {worst:.1e} of the start");
    (tiny.is_finite() && worst < 1e-10, words)
}

fn subnormal_inertia() -> Observation {
    let Ok(arm) = Arm::new([1e-160; 2], [1.0; 2], 9.81) else {
        return (false, "no such arm".to_owned());
    };
    // Gravity turns it by 1e158 rad/s within a step, and the square of this overflows.
    refuses(&mut free(arm, State::rest(), Method::Rk4, 0.001), 1)
}

/// Whether an arm is refused with words that begin like this.
fn refusal(arm: Result<Arm<2>, impl std::fmt::Display>, begins: &str) -> Observation {
    let said = arm
        .err()
        .map_or_else(|| "taken".to_owned(), |error| error.to_string());
    (said.starts_with(begins), said)
}

fn refused() -> Observation {
    let values = [f64::NAN, f64::INFINITY, -1.0, 0.0];
    let parts = values.iter().flat_map(|&bad| {
        let length = Arm::new([1.0, bad], [1.0; 2], 9.81);
        let mass = Arm::new([1.0; 2], [bad, 1.0], 9.81);
        [
            refusal(length, "lengths[1] must be"),
            refusal(mass, "masses[0] must be"),
        ]
    });
    let gravity = values.iter().take(3);
    let gravity = gravity.map(|&bad| refusal(Arm::new([1.0; 2], [1.0; 2], bad), "gravity must be"));
    let all: Vec<_> = parts.chain(gravity).collect();
    let named = all.iter().filter(|one| one.0).count();
    let count = all.len();
    let first = all.first().map_or("", |one| one.1.as_str());
    let words = format!("{named} of {count} by name, such as: {first}");
    (named == count, words)
}

// ---- S36 to S39: the methods themselves ----------------------------------------------------------------------------

/// Stable by the closed forms, for `x'' = -ω² x - 2 z ω x'` with `w = (ω h)²`, `d = 2 z ω h`.
fn closed_form(method: Method, w: f64, d: f64) -> bool {
    match method {
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
    let words = format!("steps apart by {off:.1e}; {mismatches} of 80 000 verdicts differ");
    (off < 2e-15 && mismatches == 0 && close < 10, words)
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
    let words = format!("bits {bits}; slope of the mixed swing {slope:.2}");
    (kept && (slope - 2.0).abs() < 0.2, words)
}

fn there_and_back() -> Observation {
    each(Method::ALL.map(|method| {
        let [coarse, fine] = [250, 500].map(|steps| {
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
        let words = format!("{method} misses by {fine:.1e} at 2 ms (slope {slope:.1})");
        (holds, words)
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
            let mut simulation = free(arm, state, method, h);
            simulation.drive(Some(effort));
            let estimate = estimate(&simulation);
            // The error of the step, against the arm followed to rounding.
            let end = state_after(&arm, method, &state, &effort, h);
            let mut exact = TaylorReference::new(state);
            let is_followed = exact.follow(&arm, &effort, h);
            let exact = exact.state().position;
            let error = largest_difference(&end.position, &exact);
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
        let words = format!("{method} {median:.4} ({least:.3} to {most:.3})");
        (holds, words)
    }))
}
