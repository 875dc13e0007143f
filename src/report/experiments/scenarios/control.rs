//! S07 to S15: stiff, overdamped and undamped gains, and the controller's own clock, delay and integral.
//!
//! **Invariant:** a limit is predicted before it is measured, and both are shown.

#![allow(
    clippy::indexing_slicing,
    reason = "indices name the joints of arrays of that length"
)]

use std::f64::consts::{FRAC_PI_2, TAU};

use super::support::{Named, Observation, arm, each, held, is_near, short, verdict};
use crate::math::arm::State;
use crate::math::integrator::Method;
use crate::math::pid::{Gains, INTEGRAL_LIMIT, Pid, Setpoint};
use crate::math::simulation::state_after;
use crate::report::experiments::measure::{
    growth, in_substeps, live_at, measured_limit, measured_period,
};
use crate::study::control_loop::ControlLoop;
use crate::study::linear::{Linear, equilibrium};
use crate::study::matrix::largest;
use crate::study::stability::{Sampling, Stepping, largest_timestep, step_matrix};

/// The checks of S07 to S15.
pub(super) const CHECKS: [Named; 9] = [
    ("S07", || limits_hold(gains(1e4, 0.0, [200.0, 60.0]))),
    ("S08", || limits_hold(gains(1e6, 0.0, [2000.0, 600.0]))),
    ("S09", overdamped),
    ("S10", undamped),
    ("S11", slow_control),
    ("S12", held_push),
    ("S13", late_control),
    ("S14", windup),
    ("S15", too_much_integral),
];

const POSE: [f64; 2] = [0.5, 0.8];

pub(super) const MODERATE: Gains<2> = Gains {
    kp: [200.0, 100.0],
    ki: [0.0; 2],
    kd: [30.0, 12.0],
};

fn gains(kp: f64, ki: f64, kd: [f64; 2]) -> Gains<2> {
    let (kp, ki) = ([kp; 2], [ki; 2]);
    Gains { kp, ki, kd }
}

/// Whether prediction and measurement agree to 1 % for all methods, and the limits of Runge-Kutta 4, held and
/// continuous, in words.
fn compare(gains: Gains<2>) -> (bool, Option<f64>, String) {
    let mut worst: f64 = 0.0;
    let [held, continuous] = Sampling::ALL.map(|sampling| {
        let measured = Method::ALL.map(|method| {
            let control = held(gains, POSE).with_method(method);
            let predicted = largest_timestep(&Linear::at_setpoint(&control), method, sampling);
            let predicted = predicted.unwrap_or(f64::NAN);
            let measured = measured_limit(&control, sampling, 0.9 * predicted);
            let ratio = measured.map_or(f64::INFINITY, |measured| measured / predicted);
            worst = worst.max((ratio - 1.0).abs());
            measured
        });
        // Methods are taken in order, Runge-Kutta 4 last.
        measured.into_iter().next_back().flatten()
    });
    let words = format!(
        "off by {:.4} % at worst; Runge-Kutta 4 held {} s, continuous {} s",
        100.0 * worst,
        short(held),
        short(continuous)
    );
    (worst < 0.01, held, words)
}

fn limits_hold(gains: Gains<2>) -> Observation {
    let (holds, _, words) = compare(gains);
    verdict(holds, words)
}

fn overdamped() -> Observation {
    let gains = gains(200.0, 0.0, [500.0; 2]);
    let (holds, limit, words) = compare(gains);
    let chatter = limit.and_then(|limit| chatter(&held(gains, POSE).with_timestep(1.01 * limit)));
    let words = format!("{words}; beyond: chatter of {} rad/s", short(chatter));
    verdict(holds && chatter.is_some(), words)
}

/// How fast the arm goes to and fro after a long while, if it does so at every step.
fn chatter(control: &ControlLoop<2>) -> Option<f64> {
    let mut live = control.simulation(State::at_rest(POSE));
    live.advance(100_000);
    let mut before = live.state().velocity[1];
    let alternates = (0..100).all(|_| {
        live.step();
        let now = live.state().velocity[1];
        now * std::mem::replace(&mut before, now) < 0.0
    });
    alternates.then_some(before.abs())
}

fn undamped() -> Observation {
    let still = held(gains(1e4, 0.0, [0.0; 2]), POSE);
    let linear = Linear::at_setpoint(&still);
    let modes = linear.flow().eigenvalues();
    let fastest = largest(modes.iter().map(|mode| mode.modulus()));
    let limits = Method::ALL.map(|method| {
        let held = largest_timestep(&linear, method, Sampling::Held);
        let continuous = largest_timestep(&linear, method, Sampling::Continuous);
        // Where the region of stability ends on the imaginary axis, for Runge-Kutta methods by their order.
        let expected = match (method, method.order()) {
            (Method::Verlet, _) => 2.0,
            (_, 3) => 3.0_f64.sqrt(),
            (_, 4) => 8.0_f64.sqrt(),
            _ => 0.0,
        };
        // The arm itself: a deviation escapes within 4000 steps just beyond, and does not just below.
        let escapes = |part: f64| {
            let timestep = part * expected / fastest;
            let control = still.with_method(method).with_timestep(timestep);
            growth(&control, Sampling::Continuous).is_none()
        };
        let is_predicted = continuous.is_some_and(|it| (it * fastest - expected).abs() < 1e-4);
        let is_measured = expected == 0.0 || (escapes(1.02) && !escapes(0.98));
        let holds = held == Some(0.0) && is_predicted && is_measured;
        (
            holds,
            format!("{method} {} s in every stage, held none", short(continuous)),
        )
    });
    let step = step_matrix(&linear, Method::Midpoint, Sampling::Continuous, 1e-4);
    let grown = 1e-4 / step.spectral_radius().ln();
    let grown = (
        true,
        format!("midpoint at 0.1 ms grows e-fold in {grown:.0} s"),
    );
    each(limits.into_iter().chain([grown]))
}

fn slow_control() -> Observation {
    let (mut lowest, mut highest) = (f64::INFINITY, 0.0_f64);
    let mut worst: f64 = 0.0;
    for method in [Method::Midpoint, Method::Verlet, Method::Rk4] {
        let control = held(MODERATE, POSE).with_method(method);
        let linear = Linear::at_setpoint(&control);
        for substeps in [1, 10, 100] {
            let stepping = Stepping::held(&linear, method, substeps, false);
            let predicted = stepping.limit().unwrap_or(f64::NAN);
            lowest = lowest.min(predicted);
            highest = highest.max(predicted);
            if substeps < 100 {
                let measured = measured_period(&control, 0.9 * predicted, substeps, false);
                let ratio = measured.map_or(f64::INFINITY, |measured| measured / predicted);
                worst = worst.max((ratio - 1.0).abs());
            }
        }
    }
    let range = format!("{lowest:.5} to {highest:.5} s over methods and substeps");
    verdict(
        worst < 0.01 && highest / lowest < 1.01,
        format!("{range}; measured within {:.4} %", 100.0 * worst),
    )
}

fn held_push() -> Observation {
    let control = ControlLoop {
        arm: arm([1.0; 2], 0.0),
        ..held(gains(1000.0, 0.0, [5.0, 2.0]), POSE)
    };
    let linear = Linear::at_setpoint(&control);
    let limit = Stepping::held(&linear, Method::Rk4, 100, false).limit();
    let grows = |period, substeps| {
        let control = in_substeps(&control.with_timestep(period), substeps, false);
        growth(&control, Sampling::Held).is_none_or(|growth| growth > 1.0)
    };
    let (slow, fast) = (grows(0.02, 100), grows(2e-4, 1));
    let words = |grows| if grows { "grows" } else { "decays" };
    verdict(
        slow && !fast && limit.is_some_and(|limit| limit < 0.02),
        format!(
            "limit of the period {} s; at 20 ms it {}, at 0.2 ms it {}",
            short(limit),
            words(slow),
            words(fast)
        ),
    )
}

fn late_control() -> Observation {
    let control = held(MODERATE, POSE);
    let linear = Linear::at_setpoint(&control);
    let [prompt, late] =
        [false, true].map(|delayed| Stepping::held(&linear, Method::Rk4, 1, delayed).limit());
    let predicted = late.unwrap_or(f64::NAN);
    let measured = measured_period(&control, 0.9 * predicted, 1, true);
    let is_less = prompt.is_some_and(|prompt| predicted < 0.5 * prompt);
    verdict(
        is_less && is_near(measured, predicted, 0.01),
        format!(
            "predicted {predicted:.4e} s, measured {} s; without delay {} s",
            short(measured),
            short(prompt)
        ),
    )
}

/// The shipped law has no cap on the effort; this scene puts one behind it.
fn windup() -> Observation {
    const CAP: f64 = 10.0;
    const H: f64 = 0.001;
    let blocked = held(gains(100.0, 50.0, [20.0; 2]), [0.0; 2]);
    let mut pid = Pid::new(blocked.gains);
    pid.enable(true);
    pid.set_setpoint(blocked.setpoint);
    let mut state = State::at_rest([-1.5, 0.0]);
    let mut unlimited = 0.0;
    let mut advance = |pid: &mut Pid<2>, steps: u32| {
        for _ in 0..steps {
            let control = pid.control(&state, H);
            pid.commit(control.integral);
            unlimited += (pid.setpoint().position[0] - state.position[0]) * H;
            let effort = control.effort.map(|effort| effort.clamp(-CAP, CAP));
            state = state_after(&blocked.arm, Method::Rk4, &state, &effort, H);
        }
        (state, unlimited)
    };
    let (_, wound) = advance(&mut pid, 60_000);
    let limited = pid.integral()[0];
    // Hanging needs no effort. The integral has to be unwound by the opposite error first.
    let goal = [-FRAC_PI_2, 0.0];
    pid.set_setpoint(Setpoint::at(goal));
    let recovered = (1..=600_u32).find(|_| {
        let (state, _) = advance(&mut pid, 1000);
        let is_near = (0..2).all(|i| (state.position[i] - goal[i]).abs() < 0.02);
        is_near && state.velocity.iter().all(|v| v.abs() < 0.02)
    });
    let back = recovered.map_or_else(|| "never".to_owned(), |s| format!("after {s} s"));
    let integrals = format!("integral {limited:.1} rad s, unlimited {wound:.1}");
    verdict(
        limited <= INTEGRAL_LIMIT && wound > limited && recovered.is_some(),
        format!("{integrals}; released, the arm is back {back}"),
    )
}

fn too_much_integral() -> Observation {
    let control = held(gains(100.0, 2000.0, [20.0; 2]), POSE);
    let linear = Linear::at_setpoint(&control);
    let limits = Sampling::ALL.map(|sampling| largest_timestep(&linear, Method::Rk4, sampling));
    let modes = linear.flow().eigenvalues();
    let Some(mode) = modes.iter().max_by(|a, b| a.re.total_cmp(&b.re)) else {
        return verdict(false, "no modes");
    };
    let rate = growth_rate(&control, TAU / mode.im.abs());
    let eigenvalue = mode.re;
    verdict(
        limits == [Some(0.0); 2] && eigenvalue > 0.0 && is_near(Some(rate), eigenvalue, 0.02),
        format!(
            "predicted limit {} s; eigenvalue {eigenvalue:.4}/s, measured at about 0.1 ms {rate:.4}/s",
            short(limits[0])
        ),
    )
}

/// How fast a small swing of the given period grows, in the live loop's way \[1/s\]. It is measured from the largest
/// deviation within two periods to that within the next two, once other modes have died out.
fn growth_rate(control: &ControlLoop<2>, swing: f64) -> f64 {
    const STEPS: u32 = 20_000;
    let h = 2.0 * swing / f64::from(STEPS);
    let rest = equilibrium(control);
    let mut start = State::at_rest(rest.position);
    start.position[0] += 1e-9;
    let mut live = live_at(&control.with_timestep(h), &rest, start);
    let windows = [(); 4].map(|()| {
        largest((0..STEPS).map(|_| {
            live.step();
            (live.state().position[0] - rest.position[0]).abs()
        }))
    });
    (windows[3] / windows[2]).ln() / (2.0 * swing)
}
