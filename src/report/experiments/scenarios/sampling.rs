//! S11 to S15: the effect of the controller's own clock, its delay and its integral, whatever the
//! method.
//!
//! **Invariant:** every verdict is about the control law; the methods only step the arm.

#![allow(
    clippy::indexing_slicing,
    reason = "indices name the joints of arrays of that length"
)]

use std::f64::consts::{FRAC_PI_2, TAU};

use super::support::{held, short, verdict};
use super::{Observation, Scenario};
use crate::math::arm::State;
use crate::math::integrator::Method;
use crate::math::pid::{Gains, INTEGRAL_LIMIT, Pid, Setpoint};
use crate::math::simulation::state_after;
use crate::report::experiments::measure::{measured_period, sampled_growth};
use crate::report::experiments::sampled::SampledLoop;
use crate::study::control_loop::ControlLoop;
use crate::study::linear::{Linear, equilibrium};
use crate::study::stability::{Sampling, largest_delayed_period, largest_period, largest_timestep};

pub(super) const SCENES: [Scenario; 5] = [
    Scenario {
        id: "S11",
        name: "slow control",
        parameters: "2 links, kp 200 and 100, kd 30 and 12, setpoint (0.5, 0.8); control period of 1, 10 and 100 \
                     steps, measured with 1 and 10",
        expected: "midpoint, Verlet and Runge-Kutta 4 share one limit of the period to 1 %, predicted and measured",
        slow: false,
        check: slow_control,
    },
    Scenario {
        id: "S12",
        name: "held control turns into push",
        parameters: "2 links without gravity, kp 1000, kd 5 and 2; control period 20 ms of 100 steps of 0.2 ms, \
                     Runge-Kutta 4",
        expected: "unstable in period 20 ms although stable with control in every step of 0.2 ms: the controller, not \
                   the integrator",
        slow: false,
        check: held_push,
    },
    Scenario {
        id: "S13",
        name: "control one period late",
        parameters: "2 links, kp 200 and 100, kd 30 and 12, setpoint (0.5, 0.8); each effort acts one period late",
        expected: "measured limit of the period within 1 % of the predicted one, and less than half of that without \
                   delay",
        slow: false,
        check: late_control,
    },
    Scenario {
        id: "S14",
        name: "windup",
        parameters: "2 links, kp 100, ki 50, kd 20, setpoint horizontal, effort capped at 10 N m for 60 s; then a \
                     setpoint in reach",
        expected: "the integral stops at its limit of 50 rad s, while an unlimited one grows with the error; after \
                   release the arm comes back",
        slow: false,
        check: windup,
    },
    Scenario {
        id: "S15",
        name: "too much integral",
        parameters: "2 links, kp 100, kd 20, ki 2000, setpoint (0.5, 0.8); 1 ms, Runge-Kutta 4",
        expected: "unstable at every timestep, at the rate of the loop's own eigenvalue: the gains, not the integrator",
        slow: false,
        check: too_much_integral,
    },
];

const POSE: [f64; 2] = [0.5, 0.8];

const MODERATE: Gains<2> = Gains {
    kp: [200.0, 100.0],
    ki: [0.0; 2],
    kd: [30.0, 12.0],
};

fn slow_control() -> Observation {
    let (mut lowest, mut highest) = (f64::INFINITY, 0.0_f64);
    let mut worst: f64 = 0.0;
    for method in [Method::Midpoint, Method::Verlet, Method::Rk4] {
        let control = held(MODERATE, POSE).with_method(method);
        let linear = Linear::at_setpoint(&control);
        for substeps in [1, 10, 100] {
            let predicted = largest_period(&linear, method, substeps).unwrap_or(f64::NAN);
            lowest = lowest.min(predicted);
            highest = highest.max(predicted);
            if substeps < 100 {
                let measured = measured_period(&control, 0.9 * predicted, substeps, false);
                let ratio = measured.map_or(f64::INFINITY, |measured| measured / predicted);
                worst = worst.max((ratio - 1.0).abs());
            }
        }
    }
    verdict(
        worst < 0.01 && highest / lowest < 1.01,
        format!(
            "{lowest:.5} to {highest:.5} s over methods and substeps; measured within {:.4} %",
            100.0 * worst
        ),
    )
}

fn held_push() -> Observation {
    let gains = Gains {
        kp: [1000.0; 2],
        ki: [0.0; 2],
        kd: [5.0, 2.0],
    };
    let Some(arm) = super::support::arm([1.0; 2], 0.0) else {
        return verdict(false, "no such arm".to_owned());
    };
    let control = ControlLoop {
        arm,
        ..held(gains, POSE)
    };
    let linear = Linear::at_setpoint(&control);
    let period = largest_period(&linear, Method::Rk4, 100);
    let grows = |period, substeps| {
        let growth = sampled_growth(&control.with_timestep(period), substeps, false);
        growth.is_none_or(|growth| growth > 1.0)
    };
    let (slow, fast) = (grows(0.02, 100), grows(2e-4, 1));
    verdict(
        slow && !fast && period.is_some_and(|limit| limit < 0.02),
        format!(
            "limit of the period {} s; at 20 ms it {}, at 0.2 ms it {}",
            short(period),
            if slow { "grows" } else { "decays" },
            if fast { "grows" } else { "decays" }
        ),
    )
}

fn late_control() -> Observation {
    let control = held(MODERATE, POSE);
    let linear = Linear::at_setpoint(&control);
    let prompt = largest_period(&linear, Method::Rk4, 1);
    let predicted = largest_delayed_period(&linear, Method::Rk4, 1);
    let measured = predicted.and_then(|limit| measured_period(&control, 0.9 * limit, 1, true));
    let ratio = measured
        .zip(predicted)
        .map(|(measured, predicted)| measured / predicted);
    let less = prompt
        .zip(predicted)
        .is_some_and(|(prompt, late)| late < 0.5 * prompt);
    verdict(
        less && ratio.is_some_and(|ratio| (ratio - 1.0).abs() < 0.01),
        format!(
            "predicted {} s, measured {} s; without delay {} s",
            short(predicted),
            short(measured),
            short(prompt)
        ),
    )
}

/// The shipped law has no cap on the effort; this scene puts one behind it.
fn windup() -> Observation {
    const CAP: f64 = 10.0;
    const H: f64 = 0.001;
    let blocked = held(
        Gains {
            kp: [100.0; 2],
            ki: [50.0; 2],
            kd: [20.0; 2],
        },
        [0.0; 2],
    );
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
    let mut recovered = None;
    for second in 1..=600_u32 {
        let (state, _) = advance(&mut pid, 1000);
        let near = (0..2).all(|i| (state.position[i] - goal[i]).abs() < 0.02);
        let slow = state.velocity.iter().all(|v| v.abs() < 0.02);
        if near && slow {
            recovered = Some(second);
            break;
        }
    }
    let back = recovered.map_or_else(|| "never".to_owned(), |s| format!("after {s} s"));
    verdict(
        limited <= INTEGRAL_LIMIT && wound > limited && recovered.is_some(),
        format!(
            "integral {limited:.1} rad s, unlimited {wound:.1}; released, the arm is back {back}"
        ),
    )
}

fn too_much_integral() -> Observation {
    let gains = Gains {
        kp: [100.0; 2],
        ki: [2000.0; 2],
        kd: [20.0; 2],
    };
    let control = held(gains, POSE);
    let linear = Linear::at_setpoint(&control);
    let limits = Sampling::ALL.map(|sampling| largest_timestep(&linear, Method::Rk4, sampling));
    let modes = linear.flow().eigenvalues();
    let Some(mode) = modes.iter().max_by(|a, b| a.re.total_cmp(&b.re)) else {
        return verdict(false, "no modes".to_owned());
    };
    let rate = growth_rate(&control, TAU / mode.im.abs());
    verdict(
        limits == [Some(0.0); 2] && mode.re > 0.0 && (rate / mode.re - 1.0).abs() < 0.02,
        format!(
            "predicted limit {} s; eigenvalue {:.4}/s, measured at about 0.1 ms {rate:.4}/s",
            short(limits[0]),
            mode.re,
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
    let mut sampled = SampledLoop::new(&control.with_timestep(h), 1, &rest, start);
    let mut windows = [0.0_f64; 4];
    for largest in &mut windows {
        for _ in 0..STEPS {
            sampled.advance();
            *largest = largest.max((sampled.state.position[0] - rest.position[0]).abs());
        }
    }
    (windows[3] / windows[2]).ln() / (2.0 * swing)
}
