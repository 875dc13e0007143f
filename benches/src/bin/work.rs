//! One kind of work, repeated: `scripts/measure-work.sh` counts its instructions.
//!
//! `cargo run --release --bin work -- VARIANT COUNT`
//!
//! The difference of the counts for `COUNT` and for twice `COUNT` excludes the start of the program.
//! `step-LINKS-METHOD-WHAT` is a step of the live arm's simulation. All arms start bent and at rest, with a setpoint
//! near their equilibrium, so that none diverges. The last part is `free`, `pid`, `pd` (no integral), `pi` (no damping)
//! or `pushed` (`pid` under a disturbance of zeros). `weightless` may be before it, and after it `limited` (by a limit
//! of the effort), `measured` (by encoders), `late` (by a period) and `damped` (by friction).

use std::f64::consts::TAU;
use std::hint::black_box;

use pendularm::math::expression::Expression;
use pendularm::math::integrator::Method;
use pendularm::math::limits::Limits;
use pendularm::math::particle::Particle;
use pendularm::math::sensors::{Sensors, VelocitySource};
use pendularm::math::simulation::ControlPeriod;
use pendularm_benches::step_scene::{ready, undamped};

// A separate function, so its name identifies the counts of the arm's code, for any inlining.
#[inline(never)]
fn step<const N: usize>(method: Method, what: &str, count: u64) {
    let has = |word: &str| what.split('-').any(|part| part == word);
    let gravity = if has("weightless") { 0.0 } else { 9.81 };
    let control = ["pd", "pi", "pid", "pushed"].iter().any(|law| has(law));
    let mut simulation = ready::<N>(gravity, !has("pd"), control, method);
    if has("pi") {
        simulation.set_gains(undamped());
    }
    if has("pushed") {
        simulation.disturb([0.0; N], 1e9);
    }
    if has("limited") {
        simulation.set_limits(Limits {
            effort: Some([100.0; N]),
            ..Limits::default()
        });
    }
    if has("measured") {
        simulation.set_sensors(Sensors {
            encoder_step: [TAU / 65536.0; N],
            velocity: VelocitySource::Difference,
        });
    }
    if has("late") {
        simulation.set_control_period(ControlPeriod {
            period: 0.0,
            delay: 1,
        });
    }
    if has("damped") {
        let arm = simulation.arm().with_friction([0.1; N]);
        simulation.set_arm(arm.expect("a friction"));
    }
    assert_eq!(simulation.advance(count), count);
    black_box(simulation.state());
}

#[inline(never)]
fn particle(method: Method, function: &str, count: u64) {
    let function = Expression::parse(function).expect("a function");
    let mut particle =
        Particle::new(function, 0.5, -0.25, 1e-4, count, method).expect("a particle");
    particle.advance(usize::MAX);
    black_box(particle.positions());
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [variant, count] = arguments.as_slice() else {
        panic!("usage: work VARIANT COUNT");
    };
    let count: u64 = count.parse().expect("a number");
    let parts: Vec<&str> = variant.splitn(4, '-').collect();
    match parts.as_slice() {
        ["step", "2", method, what] => step::<2>(method.parse().expect("a method"), what, count),
        ["step", "3", method, what] => step::<3>(method.parse().expect("a method"), what, count),
        ["particle", method, "constant"] => particle(method.parse().expect("a method"), "1", count),
        ["particle", method, "cosine"] => {
            particle(method.parse().expect("a method"), "cos(2*t)", count)
        }
        _ => panic!("unknown variant {variant}"),
    }
}
