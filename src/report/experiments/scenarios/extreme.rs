//! S27 to S35: gravity, timesteps, angles and parameters far from the ordinary.
//!
//! **Invariant:** values that no arm can have are refused by name. A run with accepted values stays finite, or the
//! scene falls short.

#![allow(
    clippy::indexing_slicing,
    reason = "indices name the joints of arrays of that length"
)]

use std::f64::consts::{FRAC_PI_2, TAU};

use super::support::{apart, free, held, verdict};
use super::{Observation, Scenario};
use crate::math::arm::{Arm, State};
use crate::math::dynamics::forward_dynamics;
use crate::math::integrator::Method;
use crate::math::pid::Gains;
use crate::math::simulation::Simulation;
use crate::report::experiments::reference::DoubleDouble;
use crate::study::control_loop::ControlLoop;
use crate::study::linear::{Linear, no_control};
use crate::study::matrix::largest;
use crate::study::rollout::{Deviation, Rollout, RolloutRequest};
use crate::study::stability::{Sampling, largest_timestep};

pub(super) const SCENES: [Scenario; 9] = [
    Scenario {
        id: "S27",
        name: "gravity from 0 to 1000",
        parameters: "2 links, 9.81, 981, 1e-12 and negative gravity; Runge-Kutta 4",
        expected: "the error goes with (timestep² gravity)²; tiny gravity lets the arm fall by it; negative gravity is \
                   refused",
        slow: false,
        check: gravity,
    },
    Scenario {
        id: "S28",
        name: "timestep 1e-6",
        parameters: "2 links, 0.3 rad from hanging, 10^7 steps of 1 µs, Runge-Kutta 4",
        expected: "error at the floor of rounding, under 1e-13 rad; the time is exactly 10^7 times 1 µs",
        slow: true,
        check: tiny_steps,
    },
    Scenario {
        id: "S29",
        name: "timesteps of 0.1 and 1 s",
        parameters: "2 links, 0.01 rad from hanging, free, and held by the default gains; all methods",
        expected: "flies apart exactly where that is predicted; the state stays finite in any case",
        slow: false,
        check: huge_steps,
    },
    Scenario {
        id: "S30",
        name: "wound up",
        parameters: "2 links, first joint wound by 1e8 rad; 1 s at 1 ms, Runge-Kutta 4",
        expected: "as the unwound arm, to ten times the spacing of doubles at 1e8 (1.5e-8 rad); accelerations to 1e-13",
        slow: false,
        check: wound,
    },
    Scenario {
        id: "S31",
        name: "setpoints of 1e6 and 1e300",
        parameters: "2 links, default gains, 1000 steps of 1 ms",
        expected: "every state finite; what overflows is not taken and reported",
        slow: false,
        check: huge_setpoints,
    },
    Scenario {
        id: "S32",
        name: "subnormal start",
        parameters: "2 links without gravity, kp 100, kd 10, 1e-310 rad from the setpoint",
        expected: "linear: 1e-10 times the motion from 1e-300 rad, to the few digits that subnormals keep",
        slow: false,
        check: subnormal_start,
    },
    Scenario {
        id: "S33",
        name: "subnormal inertia",
        parameters: "2 links of 1e-160 m, so that m l² is subnormal; 1000 steps of 1 ms",
        expected: "taken, as the contract says, and every state finite: what overflows is not taken and reported",
        slow: false,
        check: subnormal_inertia,
    },
    Scenario {
        id: "S34",
        name: "parameters that are no numbers",
        parameters: "NaN, infinite, negative and zero masses, lengths and gravity",
        expected: "refused by name",
        slow: false,
        check: refused,
    },
    Scenario {
        id: "S35",
        name: "massless link",
        parameters: "2 links, inner mass 0",
        expected: "refused by name: a mass matrix without inertia can't be solved",
        slow: false,
        check: massless,
    },
];

const NO_ARM: &str = "no such arm";

fn gravity() -> Observation {
    let error = |gravity: f64, timestep: f64, duration: f64| {
        let request = RolloutRequest {
            control: ControlLoop::free(Arm::new([1.0; 2], [1.0; 2], gravity).ok()?)
                .with_timestep(timestep),
            start: State::at_rest([0.5, -0.5]),
            duration,
            samples: 101,
            reference: true,
        };
        let mut rollout = Rollout::new(request).ok()?;
        while rollout.advance(u64::MAX) > 0 {}
        Some(rollout.deviation()?.largest())
    };
    let errors = (
        error(9.81, 4e-3, 1.0),
        error(981.0, 4e-4, 0.1),
        error(981.0, 4e-3, 0.1),
    );
    let (Some(usual), Some(scaled), Some(strong)) = errors else {
        return verdict(false, NO_ARM.to_owned());
    };
    let fallen = tiny_gravity().unwrap_or(f64::NAN);
    let refusal = Arm::new([1.0; 2], [1.0; 2], -9.81).err();
    // Scaled time makes the first two one motion; ten times the step is 10^4 times the error, to the next order.
    let holds = (scaled / usual - 1.0).abs() < 0.01
        && (strong / usual / 1e4).log2().abs() < 0.6
        && (fallen - 1.0).abs() < 1e-6
        && refusal.is_some();
    verdict(
        holds,
        format!(
            "error {usual:.2e} rad, {scaled:.2e} in scaled time, {strong:.2e} at 100 times the gravity; \
             under 1e-12 fallen {fallen:.7} times as expected; {}",
            refusal.map_or_else(String::new, |refusal| refusal.to_string())
        ),
    )
}

/// How far a horizontal arm has fallen after 10 s, in units of `½ a t²`.
fn tiny_gravity() -> Option<f64> {
    let arm = Arm::new([1.0; 2], [1.0; 2], 1e-12).ok()?;
    let mut simulation = free(arm, State::at_rest([0.0; 2]), Method::Rk4, 0.01);
    simulation.advance(1000);
    let start = forward_dynamics(&arm, &[0.0; 2], &[0.0; 2], &[0.0; 2]);
    Some(simulation.state().position[0] / (0.5 * start[0] * 100.0))
}

fn tiny_steps() -> Observation {
    let request = RolloutRequest {
        control: ControlLoop::free(Arm::<2>::default()).with_timestep(1e-6),
        start: State::at_rest([0.3 - FRAC_PI_2, 0.0]),
        duration: 10.0,
        samples: 101,
        reference: true,
    };
    let Ok(mut rollout) = Rollout::new(request) else {
        return verdict(false, "not run".to_owned());
    };
    while rollout.advance(u64::MAX) > 0 {}
    let error = rollout.deviation().map_or(f64::NAN, Deviation::largest);
    let end = rollout.times().last().copied().unwrap_or(f64::NAN);
    let late = (end - 1e7 * 1e-6).abs();
    verdict(
        error < 1e-13 && late == 0.0,
        format!(
            "error {error:.1e} rad, time off by {late:e} s after {} steps",
            rollout.done()
        ),
    )
}

fn huge_steps() -> Observation {
    let mut holds = true;
    let mut observed = vec![];
    let hanging = [-FRAC_PI_2, 0.0];
    for gains in [no_control(), Gains::default()] {
        let kind = if gains == no_control() {
            "free"
        } else {
            "held"
        };
        for method in Method::ALL {
            for timestep in [0.1, 1.0] {
                let control = held(gains, hanging)
                    .with_method(method)
                    .with_timestep(timestep);
                let linear = Linear::at_setpoint(&control);
                let limit = largest_timestep(&linear, method, Sampling::Held);
                let predicted = limit.is_some_and(|limit| timestep > limit);
                let start = State::at_rest([hanging[0] + 0.01, 0.0]);
                let mut simulation = control.simulation(start);
                simulation.advance(5000);
                let state = simulation.state();
                let fastest = largest(state.velocity.iter().map(|v| v.abs()));
                let apart = simulation.divergence().is_some() || fastest > 1.0;
                holds &= state.is_finite() && apart == predicted;
                let word = if apart { "apart" } else { "together" };
                observed.push(format!("{kind} {method} {timestep} s {word}"));
            }
        }
    }
    verdict(holds, observed.join(", "))
}

/// The first joint at 1e8 rad, and at what is left of that without its whole turns.
fn wound() -> Observation {
    /// The part of 2π that a double falls short of.
    const TAU_LOW: f64 = 2.449_293_598_294_706_4e-16;
    let angle = 1e8;
    let turn = DoubleDouble::from(TAU) + DoubleDouble::from(TAU_LOW);
    let turns = DoubleDouble::from((angle / TAU).round());
    let unwound = (DoubleDouble::from(angle) - turns * turn).to_f64();
    let arm = Arm::<2>::default();
    let start = State {
        position: [unwound, 0.7],
        velocity: [1.0, -2.0],
    };
    let mut turned = start;
    turned.position[0] = angle;
    let acceleration =
        |state: &State<2>| forward_dynamics(&arm, &state.position, &state.velocity, &[0.0; 2]);
    let (a, b) = (acceleration(&start), acceleration(&turned));
    let at_once = largest((0..2).map(|i| (a[i] - b[i]).abs())) / largest(a.iter().map(|a| a.abs()));
    let mut one = free(arm, start, Method::Rk4, 0.001);
    let mut other = free(arm, turned, Method::Rk4, 0.001);
    one.advance(1000);
    other.advance(1000);
    let mut end = *other.state();
    // Both moved by as much; the wound one to the spacing of its doubles.
    end.position[0] = end.position[0] - angle + unwound;
    let after = apart(one.state(), &end);
    verdict(
        at_once < 1e-13 && after < 1.5e-7,
        format!("accelerations apart by {at_once:.1e}, after 1 s states by {after:.1e}"),
    )
}

fn huge_setpoints() -> Observation {
    let mut holds = true;
    let mut observed = vec![];
    for far in [1e6, 1e300] {
        let mut live = held(Gains::default(), [far; 2]).simulation(State::rest());
        live.advance(1000);
        holds &= live.state().is_finite();
        let fastest = largest(live.state().velocity.iter().map(|v| v.abs()));
        observed.push(match live.divergence() {
            Some(divergence) => format!("{far:e}: refuses step {}", divergence.step),
            None => format!(
                "{far:e}: {fastest:.1e} rad/s, {:.1e} rad a step",
                fastest * live.timestep()
            ),
        });
    }
    verdict(holds, observed.join("; "))
}

fn subnormal_start() -> Observation {
    let Some(arm) = super::support::arm([1.0; 2], 0.0) else {
        return verdict(false, NO_ARM.to_owned());
    };
    let gains = Gains {
        kp: [100.0; 2],
        ki: [0.0; 2],
        kd: [10.0; 2],
    };
    let run = |off: f64| {
        let mut live = Simulation::new(arm, gains);
        live.set_state(State::at_rest([off, 0.0]));
        live.enable(true);
        live.advance(200);
        *live.state()
    };
    let (tiny, small) = (run(1e-310), run(1e-300));
    // 1e-310 is 2e13 times the smallest double; a few hundred roundings of half of that.
    let worst =
        largest((0..2).map(|i| (tiny.position[i] - 1e-10 * small.position[i]).abs() / 1e-310));
    verdict(
        tiny.is_finite() && worst < 1e-10,
        format!("apart by {worst:.1e} of the start"),
    )
}

fn subnormal_inertia() -> Observation {
    let Ok(arm) = Arm::new([1e-160; 2], [1.0; 2], 9.81) else {
        return verdict(false, NO_ARM.to_owned());
    };
    let mut simulation = free(arm, State::rest(), Method::Rk4, 0.001);
    let taken = simulation.advance(1000);
    let end = simulation.divergence().map_or_else(
        || "and goes on".to_owned(),
        |divergence| format!("and refuses step {}", divergence.step),
    );
    verdict(
        simulation.state().is_finite(),
        format!("takes {taken} steps {end}"),
    )
}

fn refused() -> Observation {
    let values = [f64::NAN, f64::INFINITY, -1.0, 0.0];
    let errors = values.map(|bad| {
        [
            Arm::new([1.0, bad], [1.0; 2], 9.81),
            Arm::new([1.0; 2], [bad, 1.0], 9.81),
        ]
        .map(|arm| arm.err().map(|error| error.to_string()))
    });
    let gravity = [f64::NAN, f64::INFINITY, -1.0].map(|bad| {
        Arm::new([1.0; 2], [1.0; 2], bad)
            .err()
            .map(|error| error.to_string())
    });
    let named = errors.iter().all(|[length, mass]| {
        length
            .as_ref()
            .is_some_and(|text| text.starts_with("lengths[1] must be"))
            && mass
                .as_ref()
                .is_some_and(|text| text.starts_with("masses[0] must be"))
    }) && gravity.iter().all(|error| {
        error
            .as_ref()
            .is_some_and(|text| text.starts_with("gravity must be"))
    });
    let first = errors[0][0].clone().unwrap_or_default();
    verdict(named, format!("11 of 11 by name, such as: {first}"))
}

fn massless() -> Observation {
    let error = Arm::new([1.0; 2], [0.0, 1.0], 9.81).err();
    verdict(
        error.is_some(),
        error.map_or_else(|| "taken".to_owned(), |error| error.to_string()),
    )
}
