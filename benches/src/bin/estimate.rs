//! The live arm's estimate of its error in the step ahead, repeated: `scripts/measure-work.sh` counts its
//! instructions.
//!
//! `cargo run --release --bin estimate -- LINKS COUNT`
//!
//! Counting `COUNT` and twice `COUNT` and taking the difference leaves out the start of the program. It is its own
//! program. Compiled together with steps, estimates would share code with them, and a step would take up to 3 % more.

use std::hint::black_box;

use pendularm::math::integrator::Method;
use pendularm::study::error_estimate::estimate;
use pendularm_benches::step_scene::ready;

/// The arm under its controller, stepped by Runge-Kutta 4.
fn estimates<const N: usize>(count: u64) {
    let simulation = ready::<N>(9.81, true, true, Method::Rk4);
    for _ in 0..count {
        black_box(estimate(black_box(&simulation)));
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [links, count] = arguments.as_slice() else {
        panic!("usage: estimate LINKS COUNT");
    };
    let count: u64 = count.parse().expect("a number");
    match links.as_str() {
        "2" => estimates::<2>(count),
        "3" => estimates::<3>(count),
        _ => panic!("LINKS must be 2 or 3, got {links}"),
    }
}
