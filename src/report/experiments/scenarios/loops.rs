//! S01 to S26: free motion, the controller, and uneven arms.
//!
//! **Invariant:** a limit is predicted before it is measured, and both are shown.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::support::{
    Check, Noise, Observation, apart, arm, each, fastest, free, gains, held, is_near, states,
};
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::{energy, forward_dynamics};
use crate::math::integrator::Method;
use crate::math::limits::Limits;
use crate::math::pid::{Gains, INTEGRAL_LIMIT, Setpoint};
use crate::math::simulation::Simulation;
use crate::report::experiments::conditioning::digits_lost;
use crate::report::experiments::error::REACH_GAINS as MODERATE;
use crate::report::experiments::measure::{
    LimitPair, boundary, growth, in_substeps, live_at, short,
};
use crate::report::experiments::nonlinear::derivative;
use crate::study::control_loop::ControlLoop;
use crate::study::linear::{Linear, equilibrium};
use crate::study::matrix::{largest, largest_difference};
use crate::study::stability::{Sampling, Stepping, largest_timestep, limits, step_matrix};

/// Digits that a rod arm may lose: a half-unit change of an angle alone changes accelerations by up to 1.6 digits.
const DIGITS: f64 = 2.5;

/// The checks of S01 to S26.
pub(super) const CHECKS: [(&str, Check); 26] = [
    ("S01", rest_without_gravity),
    ("S02", hanging_at_rest),
    ("S03", upright),
    ("S04", regular_swing),
    ("S05", || chaotic::<2>(1.2)),
    ("S06", || chaotic::<3>(1.9)),
    ("S07", || limits_hold(gains(1e4, 0.0, [200.0, 60.0]))),
    ("S08", || limits_hold(gains(1e6, 0.0, [2000.0, 600.0]))),
    ("S09", overdamped),
    ("S10", undamped),
    ("S11", slow_control),
    ("S12", held_push),
    ("S13", late_control),
    ("S14", windup),
    ("S15", too_much_integral),
    ("S16", || light_outer_link(1e-3)),
    ("S17", || light_outer_link(1e-6)),
    ("S18", || light_outer_link(1e-9)),
    ("S19", || heavy_outer_link(1e3)),
    ("S20", || heavy_outer_link(1e6)),
    ("S21", || heavy_outer_link(1e9)),
    ("S22", heavy_link_stretched),
    ("S23", || each([1e3, 1e-3].map(long_outer_link))),
    ("S24", || loses_few(&Arm::default(), [0.0; 3], 0.0)),
    ("S25", folded),
    ("S26", || {
        each(
            [
                whirl::<2>([0.76376, 1.0801]),
                whirl::<3>([0.42370, 0.59920]),
            ]
            .concat(),
        )
    }),
];

// ---- S01 to S06: free motion ---------------------------------------------------------------------------------------

fn rest_without_gravity() -> Observation {
    let start = State::at_rest([0.3, -1.2, 2.0]);
    let kept = Method::ALL.into_iter().all(|method| {
        let mut simulation = free(arm([1.0; 3], 0.0), start, method, 0.001);
        simulation.advance(10_000);
        *simulation.state() == start
    });
    let words = if kept { "every bit kept" } else { "moved" };
    (kept, words.to_owned())
}

/// The rate at which a deviation grows under a method at 1 ms \[1/s\], as the step matrix says.
fn predicted_rate(linear: &Linear, method: Method) -> f64 {
    let step = step_matrix(linear, method, Sampling::Held, 0.001);
    step.spectral_radius().ln() / 0.001
}

/// The rate at which an arm leaves `rest` \[1/s\]: from its largest distance in a `window` of steps, after some steps, to
/// that in a window this many steps later.
fn growth_rate<const N: usize>(
    live: &mut Simulation<N>,
    rest: &[f64; N],
    (after, later): (u64, u64),
    window: u64,
) -> f64 {
    let mut largest_after = |steps| {
        live.advance(steps);
        largest((0..window).map(|_| {
            live.step();
            largest_difference(&live.state().position, rest)
        }))
    };
    let (early, late) = (largest_after(after), largest_after(later - window));
    (late / early).ln() / (in_f64(later) * live.timestep())
}

/// `-π/2` is no double, so the arm hangs 6e-17 rad off and swings by that much.
fn hanging_at_rest() -> Observation {
    let start = State::at_rest([-FRAC_PI_2, 0.0, 0.0]);
    let linear = Linear::at_pose(&ControlLoop::free(Arm::<3>::default()), &start.position);
    let swinging = |method| free(Arm::default(), start, method, 0.001);
    let drifts = [Method::Midpoint, Method::Verlet, Method::Rk4].map(|method| {
        let mut simulation = swinging(method);
        simulation.advance(1_000_000);
        let drift = apart(simulation.state(), &start);
        (drift < 1e-12, format!("{method} drifts {drift:.1e}"))
    });
    let predicted = predicted_rate(&linear, Method::Euler);
    let mut simulation = swinging(Method::Euler);
    // A second is longer than the fastest swing.
    let rate = growth_rate(&mut simulation, &start.position, (200_000, 200_000), 1000);
    let words = format!("Euler grows by {rate:.5}/s, predicted {predicted:.5}/s");
    let grows = (is_near(Some(rate), predicted, 0.02), words);
    each(drifts.into_iter().chain([grows]))
}

fn upright() -> Observation {
    let pose = [FRAC_PI_2, 0.0];
    let linear = Linear::at_pose(&ControlLoop::free(Arm::default()), &pose);
    let unstable = largest(linear.flow().eigenvalues().iter().map(|mode| mode.re));
    let eigenvalue = (true, format!("eigenvalue {unstable:.5}/s"));
    each([eigenvalue].into_iter().chain(Method::ALL.map(|method| {
        let start = State::at_rest([pose[0] + 1e-12, 1e-12]);
        let mut simulation = free(Arm::default(), start, method, 0.001);
        // After two seconds the fastest mode has outgrown the other one a few thousand times.
        let rate = growth_rate(&mut simulation, &pose, (2000, 1000), 1);
        let predicted = predicted_rate(&linear, method);
        let order = (unstable * 0.001).powi(method.order().cast_signed());
        let holds =
            is_near(Some(rate), predicted, 2e-3) && is_near(Some(predicted), unstable, 2.0 * order);
        (holds, format!("{method} {rate:.5}"))
    })))
}

fn regular_swing() -> Observation {
    each(Method::ALL.map(|method| {
        let start = State::at_rest([0.3 - FRAC_PI_2, 0.0]);
        let mut simulation = free(Arm::default(), start, method, 0.001);
        let begun = energy(simulation.arm(), &start);
        let (mut lowest, mut highest) = (0.0_f64, 0.0_f64);
        for _ in 0..10_000 {
            simulation.advance(100);
            let gained = energy(simulation.arm(), simulation.state()) - begun;
            lowest = lowest.min(gained);
            highest = highest.max(gained);
        }
        let holds = match method {
            Method::Euler => highest > 1.0,
            Method::Midpoint => highest < 1e-3 && highest > -lowest,
            Method::Verlet => highest.max(-lowest) < 1e-4,
            // A method of order p gains or loses some h^(p-1).
            _ => highest.max(-lowest) < 1e-3_f64.powi(method.order().cast_signed() - 1),
        };
        (holds, format!("{method} {lowest:+.1e} to {highest:+.1e} J"))
    }))
}

/// The rate at which two neighbours part, brought back together every tenth of a second.
fn chaotic<const N: usize>(expected: f64) -> Observation {
    const APART: f64 = 1e-8;
    let mut one = free(Arm::default(), State::rest(), Method::Rk4, 0.001);
    let mut other = one.clone();
    let mut beside = State::<N>::rest();
    beside.position[0] += APART;
    other.set_state(beside);
    let mut grown = 0.0;
    for _ in 0..2000 {
        one.advance(100);
        other.advance(100);
        let (here, there) = (*one.state(), *other.state());
        let distance = apart(&here, &there);
        grown += (distance / APART).ln();
        let back = |here: &[f64; N], there: &[f64; N]| {
            std::array::from_fn(|i| here[i] + (there[i] - here[i]) * APART / distance)
        };
        let position = back(&here.position, &there.position);
        let velocity = back(&here.velocity, &there.velocity);
        other.set_state(State { position, velocity });
    }
    let rate = grown / 200.0;
    let reached = 36.0 / rate;
    let words =
        format!("{rate:.2} per second: a unit of rounding is a radian after {reached:.0} s");
    (is_near(Some(rate), expected, 0.25), words)
}

// ---- S07 to S15: the controller ------------------------------------------------------------------------------------

const POSE: [f64; 2] = [0.5, 0.8];

/// Whether prediction and measurement agree to 1 % for all methods, and the limits of Runge-Kutta 4, held and
/// continuous, in words.
fn compare(gains: Gains<2>) -> (bool, Option<f64>, String) {
    let mut worst: f64 = 0.0;
    let [held, continuous] = Sampling::ALL.map(|sampling| {
        let pairs = Method::ALL
            .map(|method| LimitPair::of_timestep(&held(gains, POSE).with_method(method), sampling));
        worst = worst.max(furthest_off(&pairs));
        // Methods are taken in order, Runge-Kutta 4 last.
        pairs.last().and_then(|pair| pair.measured)
    });
    let words = format!(
        "off by {:.4} % at worst; Runge-Kutta 4 held {} s, continuous {} s",
        100.0 * worst,
        short(held),
        short(continuous)
    );
    (worst < 0.01, held, words)
}

/// How far a measured limit is from the predicted one at most; infinite if one is missing.
fn furthest_off(pairs: &[LimitPair]) -> f64 {
    largest(pairs.iter().map(|pair| pair.off().unwrap_or(f64::INFINITY)))
}

fn limits_hold(gains: Gains<2>) -> Observation {
    let (holds, _, words) = compare(gains);
    (holds, words)
}

fn overdamped() -> Observation {
    let gains = gains(200.0, 0.0, [500.0; 2]);
    let (holds, limit, words) = compare(gains);
    let chatter = limit.and_then(|limit| chatter(&held(gains, POSE).with_timestep(1.01 * limit)));
    let words = format!("{words}; beyond: chatter of {} rad/s", short(chatter));
    (holds && chatter.is_some(), words)
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
        let words = format!("{method} {} s in every stage, held none", short(continuous));
        (holds, words)
    });
    each(limits)
}

fn slow_control() -> Observation {
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    for method in [Method::Midpoint, Method::Verlet, Method::Rk4] {
        let control = held(MODERATE, POSE).with_method(method);
        measured.extend([1, 10].map(|steps| LimitPair::of_period(&control, steps, 0)));
        let linear = Linear::at_setpoint(&control);
        predicted.push(Stepping::held(&linear, method, 100, 0).limit());
    }
    predicted.extend(measured.iter().map(|pair| pair.predicted));
    let predicted = predicted.into_iter().map(|limit| limit.unwrap_or(f64::NAN));
    let (lowest, highest) = predicted.fold((f64::INFINITY, 0.0_f64), |(lowest, highest), limit| {
        (lowest.min(limit), highest.max(limit))
    });
    let worst = furthest_off(&measured);
    let range = format!("{lowest:.5} to {highest:.5} s over methods and substeps");
    let words = format!("{range}; measured within {:.4} %", 100.0 * worst);
    (worst < 0.01 && highest / lowest < 1.01, words)
}

fn held_push() -> Observation {
    let control = ControlLoop {
        arm: arm([1.0; 2], 0.0),
        ..held(gains(1000.0, 0.0, [5.0, 2.0]), POSE)
    };
    let linear = Linear::at_setpoint(&control);
    let limit = Stepping::held(&linear, Method::Rk4, 100, 0).limit();
    let grows = |period, substeps| {
        let control = in_substeps(&control.with_timestep(period), substeps, 0);
        growth(&control, Sampling::Held).is_none_or(|growth| growth > 1.0)
    };
    let (slow, fast) = (grows(0.02, 100), grows(2e-4, 1));
    let [at_slow, at_fast] = [slow, fast].map(|grows| if grows { "grows" } else { "decays" });
    let words = format!(
        "limit of the period {} s; at 20 ms it {at_slow}, at 0.2 ms it {at_fast}",
        short(limit)
    );
    let is_short = limit.is_some_and(|limit| limit < 0.02);
    (slow && !fast && is_short, words)
}

fn late_control() -> Observation {
    let control = held(MODERATE, POSE);
    let prompt = Stepping::held(&Linear::at_setpoint(&control), Method::Rk4, 1, 0).limit();
    let late = LimitPair::of_period(&control, 1, 1);
    let is_less = late.predicted.zip(prompt);
    let is_less = is_less.is_some_and(|(late, prompt)| late < 0.5 * prompt);
    let words = format!("{late}; without delay {} s", short(prompt));
    (is_less && late.agrees(), words)
}

fn windup() -> Observation {
    let control = ControlLoop {
        limits: Limits {
            effort: Some([10.0; 2]),
            ..Limits::default()
        },
        ..held(gains(100.0, 50.0, [20.0; 2]), [0.0; 2])
    };
    let mut live = control.simulation(State::at_rest([-1.5, 0.0]));
    let mut wound = 0.0;
    for _ in 0..60_000 {
        wound -= live.state().position[0] * control.timestep;
        live.step();
    }
    let limited = live.pid().integral()[0];
    // Hanging needs no effort. The integral has to be unwound by the opposite error first.
    let goal = [-FRAC_PI_2, 0.0];
    live.set_setpoint(Setpoint::at(goal));
    let recovered = (1..=600_u32).find(|_| {
        live.advance(1000);
        let State { position, velocity } = live.state();
        let is_near = (0..2).all(|i| (position[i] - goal[i]).abs() < 0.02);
        is_near && velocity.iter().all(|v| v.abs() < 0.02)
    });
    let back = recovered.map_or_else(|| "never".to_owned(), |s| format!("after {s} s"));
    let integrals = format!("integral {limited:.1} rad s, unlimited {wound:.1}");
    (
        limited <= INTEGRAL_LIMIT && wound > limited && recovered.is_some(),
        format!("{integrals}; released, the arm is back {back}"),
    )
}

fn too_much_integral() -> Observation {
    /// Steps of two swings. The measurement begins after two such windows, when other modes have died out.
    const WINDOW: u64 = 20_000;
    let control = held(gains(100.0, 2000.0, [20.0; 2]), POSE);
    let linear = Linear::at_setpoint(&control);
    let limits = Sampling::ALL.map(|sampling| largest_timestep(&linear, Method::Rk4, sampling));
    let modes = linear.flow().eigenvalues();
    let Some(mode) = modes.iter().max_by(|a, b| a.re.total_cmp(&b.re)) else {
        return (false, "no modes".to_owned());
    };
    let rest = equilibrium(&control);
    let mut start = State::at_rest(rest.position);
    start.position[0] += 1e-9;
    let timestep = 2.0 * TAU / mode.im.abs() / in_f64(WINDOW);
    let mut live = live_at(&control.with_timestep(timestep), &rest, start);
    let rate = growth_rate(&mut live, &rest.position, (2 * WINDOW, WINDOW), WINDOW);
    let eigenvalue = mode.re;
    (
        limits == [Some(0.0); 2] && eigenvalue > 0.0 && is_near(Some(rate), eigenvalue, 0.02),
        format!(
            "predicted limit {} s; eigenvalue {eigenvalue:.4}/s, measured at about 0.1 ms {rate:.4}/s",
            short(limits[0])
        ),
    )
}

// ---- S16 to S26: uneven arms ---------------------------------------------------------------------------------------

/// Whether an arm loses few digits around a pose, and how many.
fn loses_few<const N: usize>(arm: &Arm<N>, pose: [f64; N], spread: f64) -> Observation {
    let mut noise = Noise::new();
    let states = states(pose, spread).into_iter();
    let digits = digits_lost(arm, states.map(|state| (state, noise.array(10.0)))).recursion;
    (digits <= DIGITS, format!("{digits:.1} digits lost"))
}

fn light_outer_link(mass: f64) -> Observation {
    let control = ControlLoop {
        arm: arm([1.0, mass], 9.81),
        ..held(MODERATE, POSE)
    };
    let limit = LimitPair::of_timestep(&control, Sampling::Held);
    // A rod alone turns about its end with m l²/3; under held damping its limit is 2 inertia / kd.
    let alone = 2.0 * (mass / 3.0) / MODERATE.kd[1];
    let holds = limit.agrees() && is_near(limit.predicted, alone, 0.01);
    let limit = format!("limit {limit}");
    each([loses_few(&control.arm, [0.0; 2], PI), (holds, limit)])
}

fn heavy_outer_link(mass: f64) -> Observation {
    loses_few(&arm([1.0, 1.0, mass], 9.81), [0.0; 3], PI)
}

fn long_outer_link(length: f64) -> Observation {
    let arm = Arm::new([1.0, 1.0, length], [1.0; 3], 9.81).unwrap_or_default();
    let (holds, words) = loses_few(&arm, [0.0; 3], PI);
    (holds, format!("{words} with a tip of {length} m"))
}

fn heavy_link_stretched() -> Observation {
    let arm = arm([1.0, 1.0, 1e9], 9.81);
    let linear = Linear::at_pose(&ControlLoop::free(arm), &[-FRAC_PI_2, 0.0, 0.0]);
    let limits = [(Method::Rk4, 1.649e-5), (Method::Verlet, 1.166e-5)].map(|(method, expected)| {
        let limit = largest_timestep(&linear, method, Sampling::Continuous);
        let words = format!("{method} limit {} s", short(limit));
        (is_near(limit, expected, 0.01), words)
    });
    let swings = [(1.6e-5, false), (2.0e-5, true)].map(|(timestep, is_apart)| {
        let start = State::at_rest([-FRAC_PI_2, 1e-6, -1e-6]);
        let mut simulation = free(arm, start, Method::Rk4, timestep);
        simulation.advance(20_000);
        // The nudge holds 1e-6 rad of a mode of 1.7e5 rad/s: rates of some 0.2 rad/s.
        let flies = simulation.divergence().is_some() || fastest(&simulation) > 10.0;
        let words = if flies { "flies apart" } else { "swings on" };
        (flies == is_apart, format!("at {timestep:e} s it {words}"))
    });
    let digits = loses_few(&arm, [0.0; 3], 1e-6);
    each([digits].into_iter().chain(limits).chain(swings))
}

fn folded() -> Observation {
    let control = held(Gains::<3>::default(), [0.0; 3]);
    let smallest = limits(&control).minimum_held;
    let at = |pose: [f64; 3]| {
        let linear = Linear::at_pose(&control, &pose);
        largest_timestep(&linear, Method::Rk4, Sampling::Held).unwrap_or(f64::INFINITY)
    };
    let (stretched, folded) = (at([0.0; 3]), at([0.0, PI, -PI]));
    // Poses between those of the grid.
    let others = states([0.0; 3], PI).into_iter().take(50);
    let anywhere = others
        .map(|state| at(state.position))
        .fold(f64::INFINITY, f64::min);
    let least = stretched.min(folded).min(anywhere);
    let covers = smallest.is_some_and(|smallest| least > 0.99 * smallest);
    let words = format!(
        "limit folded {folded:.4e} s, stretched {stretched:.4e} s, least of 50 others {anywhere:.4e} s, minimum over \
         poses {} s",
        short(smallest)
    );
    each([
        loses_few(&Arm::default(), [0.0, PI, -PI], 0.0),
        (covers, words),
    ])
}

/// Limits of Verlet and Runge-Kutta 4 as timestep times rate: predicted from the fastest mode of the whirling arm, and
/// measured.
fn whirl<const N: usize>([verlet, rk4]: [f64; 2]) -> [Observation; 2] {
    const RATE: f64 = 1000.0;
    let methods = [
        (Method::Verlet, verlet, 2.0),
        (Method::Rk4, rk4, 8.0_f64.sqrt()),
    ];
    methods.map(|(method, expected, reach)| {
        let arm = arm([1.0; N], 0.0);
        let mut start = State::rest();
        start.velocity[0] = RATE;
        // Rates are differenced at their own scale.
        let modes = derivative(&start, [1e-5, 1e-5 * RATE], |state| State {
            position: state.velocity,
            velocity: forward_dynamics(&arm, &state.position, &state.velocity, &[0.0; N]),
        });
        let modes = modes.eigenvalues();
        let predicted = reach * RATE / largest(modes.iter().map(|mode| mode.modulus()));
        start.position[1] = 1e-9;
        let measured = boundary(0.9 * expected, |angle| {
            let mut simulation = free(arm, start, method, angle / RATE);
            // At any time: past its limit Runge-Kutta 4 takes spin away until it is within again.
            (0..400).all(|_| {
                simulation.advance(10);
                let angles = simulation.state().position;
                angles.iter().skip(1).all(|q| q.abs() < 1e-6)
            })
        });
        let both = [Some(predicted), measured];
        let holds = both.iter().all(|limit| is_near(*limit, expected, 0.01));
        let words = format!("{method} {predicted:.4e} (measured {})", short(measured));
        (holds, words)
    })
}
