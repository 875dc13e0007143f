//! S27 to S35: gravity, timesteps, angles and parameters far from the ordinary.
//!
//! **Invariant:** values that no arm can have are refused by name. A run with accepted values stays finite, or the
//! scene falls short.

#![allow(
    clippy::indexing_slicing,
    reason = "indices name the joints of arrays of that length"
)]

use std::f64::consts::{FRAC_PI_2, TAU};

use super::support::{Named, Observation, apart, arm, each, fastest, free, held, is_near, verdict};
use crate::math::arm::{Arm, State};
use crate::math::dynamics::forward_dynamics;
use crate::math::integrator::Method;
use crate::math::pid::Gains;
use crate::math::simulation::Simulation;
use crate::report::experiments::reference::DoubleDouble;
use crate::study::control_loop::ControlLoop;
use crate::study::linear::{Linear, no_control};
use crate::study::matrix::largest;
use crate::study::paused::at_once;
use crate::study::rollout::{Rollout, RolloutRequest, rollout};
use crate::study::stability::{Sampling, largest_timestep};

/// The checks of S27 to S35.
pub(super) const CHECKS: [Named; 9] = [
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
];

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
    Some((made.deviation.as_ref()?.largest(), made))
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
    let refused = refusal(Arm::new([1.0; 2], [1.0; 2], -9.81), "gravity must be");
    each([
        (is_scaled, errors),
        ((fallen - 1.0).abs() < 1e-6, falls),
        (refused.holds, refused.observed),
    ])
}

fn tiny_steps() -> Observation {
    let Some((error, made)) = error(9.81, [0.3 - FRAC_PI_2, 0.0], 1e-6, 10.0) else {
        return verdict(false, "not run");
    };
    let end = made.times.last().copied().unwrap_or(f64::NAN);
    let late = (end - 1e7 * 1e-6).abs();
    let steps = made.steps;
    verdict(
        error < 1e-13 && late == 0.0,
        format!("error {error:.1e} rad, time off by {late:e} s after {steps} steps"),
    )
}

fn huge_steps() -> Observation {
    let hanging = [-FRAC_PI_2, 0.0];
    let mut cases = Vec::new();
    for (kind, gains) in [("free", no_control()), ("held", Gains::default())] {
        for (method, timestep) in Method::ALL
            .into_iter()
            .flat_map(|it| [(it, 0.1), (it, 1.0)])
        {
            let control = held(gains, hanging)
                .with_method(method)
                .with_timestep(timestep);
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

/// The first joint at 1e8 rad, and at what is left of that without its whole turns.
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
    let at_once = largest((0..2).map(|i| (a[i] - b[i]).abs())) / largest(a.iter().map(|a| a.abs()));
    let [one, mut other] = [start, turned].map(|start| {
        let mut simulation = free(arm, start, Method::Rk4, 0.001);
        simulation.advance(1000);
        *simulation.state()
    });
    // Both moved by as much; the wound one to the spacing of its doubles.
    other.position[0] = other.position[0] - angle + unwound;
    let after = apart(&one, &other);
    verdict(
        at_once < 1e-13 && after < 1.5e-7,
        format!("accelerations apart by {at_once:.1e}, after 1 s states by {after:.1e}"),
    )
}

fn huge_setpoints() -> Observation {
    each([1e6, 1e300].map(|far| {
        let mut live = held(Gains::default(), [far; 2]).simulation(State::rest());
        live.advance(1000);
        let (rate, h) = (fastest(&live), live.timestep());
        let words = match live.divergence() {
            Some(divergence) => format!("refuses step {}", divergence.step),
            None => format!("{rate:.1e} rad/s, {:.1e} rad a step", rate * h),
        };
        (live.state().is_finite(), format!("{far:e}: {words}"))
    }))
}

fn subnormal_start() -> Observation {
    let gains = Gains {
        kp: [100.0; 2],
        ki: [0.0; 2],
        kd: [10.0; 2],
    };
    let [tiny, small] = [1e-310, 1e-300].map(|off: f64| {
        let mut live = Simulation::new(arm([1.0; 2], 0.0), gains);
        live.set_state(State::at_rest([off, 0.0]));
        live.enable(true);
        live.advance(200);
        *live.state()
    });
    // 1e-310 is 2e13 times the smallest double; a few hundred roundings of half of that.
    let off = (0..2).map(|i| (tiny.position[i] - 1e-10 * small.position[i]).abs() / 1e-310);
    let worst = largest(off);
    verdict(
        tiny.is_finite() && worst < 1e-10,
        format!("apart by {worst:.1e} of the start"),
    )
}

fn subnormal_inertia() -> Observation {
    let Ok(arm) = Arm::new([1e-160; 2], [1.0; 2], 9.81) else {
        return verdict(false, "no such arm");
    };
    let mut simulation = free(arm, State::rest(), Method::Rk4, 0.001);
    let taken = simulation.advance(1000);
    let end = simulation.divergence().map_or_else(
        || "goes on".to_owned(),
        |divergence| format!("refuses step {}", divergence.step),
    );
    verdict(
        simulation.state().is_finite(),
        format!("takes {taken} steps and {end}"),
    )
}

/// Whether an arm is refused with words that begin like this.
fn refusal(arm: Result<Arm<2>, impl std::fmt::Display>, begins: &str) -> Observation {
    let said = arm
        .err()
        .map_or_else(|| "taken".to_owned(), |error| error.to_string());
    verdict(said.starts_with(begins), said)
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
    let named = all.iter().filter(|one| one.holds).count();
    let count = all.len();
    let first = all.first().map_or("", |one| one.observed.as_str());
    verdict(
        named == count,
        format!("{named} of {count} by name, such as: {first}"),
    )
}
