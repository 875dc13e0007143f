//! S40 to S43: what a real arm has and the ideal one has not, each at an extreme: friction, an effort limit, an encoder, a
//! delay.
//!
//! **Invariant:** every expectation is a closed form, or a limit that is predicted before it is measured.

use std::f64::consts::{PI, TAU};

use super::support::{Check, Observation, arm, each, fastest, gains, held, is_near};
use crate::math::arm::{Arm, State};
use crate::math::dynamics::gravity_load;
use crate::math::integrator::Method;
use crate::math::limits::Limits;
use crate::math::pid::Gains;
use crate::math::sensors::Sensors;
use crate::math::simulation::{ControlPeriod, Simulation};
use crate::report::experiments::measure::{LimitPair, short};
use crate::study::control_loop::ControlLoop;
use crate::study::linear::Linear;
use crate::study::matrix::{Complex, largest};
use crate::study::stability::{Sampling, largest_timestep};

/// The checks of S40 to S43.
pub(super) const CHECKS: [(&str, Check); 4] = [
    ("S40", stiff_friction),
    ("S41", weak_motor),
    ("S42", encoder_step),
    ("S43", three_periods_late),
];

/// The fastest decay of velocities under a damping of 1 N m s/rad at each joint, in this pose \[1/s\].
fn fastest_decay(arm: &Arm<2>, pose: [f64; 2]) -> f64 {
    let inverse = Linear::at(&ControlLoop::free(*arm), &pose, &[false; 2]).inverse_mass;
    largest(inverse.eigenvalues().into_iter().map(Complex::modulus))
}

/// The fast mode decays at a rate `λ`, so a method of order p is stable up to the end of its interval on the real axis. Then
/// the arm creeps: its friction balances gravity.
fn stiff_friction() -> Observation {
    const VISCOUS: f64 = 1e6;
    // Gravity pulls it back, so no slow mode grows.
    const POSE: [f64; 2] = [-1.2, 0.3];
    let Ok(arm) = Arm::<2>::default().with_friction([VISCOUS; 2]) else {
        return (false, "no such arm".to_owned());
    };
    let rate = VISCOUS * fastest_decay(&arm, POSE);
    let limits = Method::ALL.map(|method| {
        let end = if method == Method::Rk4 {
            2.785_293_563_405_28
        } else {
            2.0
        };
        let control = ControlLoop::free(arm).with_method(method);
        let linear = Linear::at(&control, &POSE, &[false; 2]);
        let predicted = largest_timestep(&linear, method, Sampling::Held);
        // A push of a millionth of a rad/s, over 200 steps.
        let speed = |part: f64| {
            let mut live = control.with_timestep(part * end / rate).simulation(State {
                position: POSE,
                velocity: [1e-6, -1e-6],
            });
            live.advance(200);
            fastest(&live)
        };
        let holds =
            is_near(predicted, end / rate, 1e-3) && speed(0.98) < 1e-4 && speed(1.02) > 1e-4;
        (holds, format!("{method} {} s", short(predicted)))
    });
    let mut live = ControlLoop::free(arm)
        .with_timestep(1.0 / rate)
        .simulation(State::at_rest(POSE));
    live.advance(1000);
    let creep = gravity_load(&arm, &POSE).map(|load| -load / VISCOUS);
    let off = live.state().velocity.iter().zip(creep);
    let off = largest(off.map(|(found, creep)| (found / creep - 1.0).abs()));
    each(
        limits
            .into_iter()
            .chain([(off < 1e-4, format!("creeps within {off:.0e} of theory"))]),
    )
}

/// The motor of the first joint is weaker than the weight of the stretched arm, which sinks until the load is the limit.
fn weak_motor() -> Observation {
    const LIMIT: f64 = 10.0;
    let Ok(arm) = Arm::<2>::default().with_friction([5.0, 1.0]) else {
        return (false, "no such arm".to_owned());
    };
    let control = ControlLoop {
        arm,
        limits: Limits {
            effort: Some([LIMIT; 2]),
            ..Limits::default()
        },
        ..held(
            Gains {
                ki: [0.0, 50.0],
                ..gains(100.0, 0.0, [10.0; 2])
            },
            [0.0; 2],
        )
    };
    let full = gravity_load(&arm, &[0.0; 2])[0];
    let mut live = control.simulation(State::rest());
    live.advance(120_000);
    let [first, second] = live.state().position;
    let expected = -(LIMIT / full).acos();
    let is_there = (first - expected).abs() < 1e-6 && second.abs() < 1e-6;
    let strong = ControlLoop {
        limits: Limits::default(),
        ..control
    };
    let mut strong = strong.simulation(State::rest());
    strong.advance(20_000);
    let sag = strong.state().position[0];
    let words = format!(
        "sinks to {first:.6} rad, expected {expected:.6}, without a limit it sags to {sag:.3} rad"
    );
    (is_there && sag > -0.25, words)
}

/// Between two counts no error is zero, so an integral never rests; on a count it does.
fn encoder_step() -> Observation {
    const STEP: f64 = TAU / 1024.0;
    let visited = |counts: f64| {
        let control = ControlLoop {
            arm: arm([1.0; 2], 0.0),
            sensors: Sensors {
                encoder_step: [STEP; 2],
                ..Sensors::default()
            },
            ..held(gains(100.0, 200.0, [20.0; 2]), [counts * STEP; 2])
        };
        let mut live = control.simulation(State::rest());
        live.advance(60_000);
        let first = |live: &Simulation<2>| (live.state().position[0] / STEP).round();
        let range = (f64::INFINITY, f64::NEG_INFINITY);
        (0..20_000).fold(range, |(least, most), _| {
            live.step();
            (first(&live).min(least), first(&live).max(most))
        })
    };
    let (between, on) = (visited(80.5), visited(80.0));
    let [inside, there] = [between, on].map(|(least, most)| format!("{least} to {most}"));
    let words = format!("between two counts it visits {inside}, on a count {there}");
    (between == (80.0, 81.0) && on == (80.0, 80.0), words)
}

/// With damping alone, a velocity follows `v ← v - a v₃` with the velocity of three periods before, which is stable up to
/// `a = 2 cos(3π/7)`.
fn three_periods_late() -> Observation {
    const DELAY: u8 = 3;
    const KD: f64 = 10.0;
    let weightless = arm([1.0; 2], 0.0);
    let damped = ControlLoop {
        arm: weightless,
        ..held(gains(0.0, 0.0, [KD; 2]), [0.5, 0.8])
    };
    let closed = 2.0 * (3.0 * PI / 7.0).cos() / (KD * fastest_decay(&weightless, [0.5, 0.8]));
    let control = held(gains(200.0, 0.0, [30.0, 12.0]), [0.5, 0.8]);
    let late = LimitPair::of_period(&control, 1, DELAY);
    let predicted = LimitPair::of_period(&damped, 1, DELAY).predicted;
    // The live loop itself, at a period of one timestep.
    let speed = |part: f64| {
        let period = ControlPeriod {
            period: 0.0,
            delay: DELAY,
        };
        let control = damped.with_timestep(part * closed).with_period(period);
        let mut live = control.simulation(State {
            position: [0.5, 0.8],
            velocity: [1e-6, -1e-6],
        });
        live.advance(1000);
        fastest(&live)
    };
    each([
        (
            is_near(predicted, closed, 1e-6),
            format!(
                "damping alone {} s, theory {}",
                short(predicted),
                short(Some(closed))
            ),
        ),
        (
            speed(0.98) < 1e-6 && speed(1.02) > 1e-6,
            "so does the live loop".to_owned(),
        ),
        (late.agrees(), format!("a whole law: {late}")),
    ])
}
