//! The report's maps by one thread: every arm alone, as a map would be without lanes, and the arms side by side.
//!
//! `cargo run --release --bin maps -- ROUNDS`
//!
//! Milliseconds of the quickest round; the two take turns. Their answers are compared first.

use std::f64::consts::FRAC_PI_2;
use std::hint::black_box;
use std::time::Instant;

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::{energy, potential_energy};
use pendularm::math::integrator::Method;
use pendularm::report::experiments::measure::{growth, growths, stiffened};
use pendularm::report::experiments::nonlinear::{are_carried, arrive, move_of, spun};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::stability::Sampling;

/// Centres of so many cells on a logarithmic axis.
fn centres(least: f64, most: f64, cells: u32) -> Vec<f64> {
    let part = |cell| (f64::from(cell) + 0.5) / f64::from(cells);
    let centre = |cell| least * (most / least).powf(part(cell));
    (0..cells).map(centre).collect()
}

/// As [`are_carried`] of one swing, whose arm is stepped alone.
fn is_carried(&(control, start): &(ControlLoop<2>, State<2>)) -> bool {
    let arm = control.arm;
    let lowest = potential_energy(&arm, &[-FRAC_PI_2, 0.0]);
    let most = 3.0 * (energy(&arm, &start) - lowest);
    let mut live = control.simulation(start);
    while live.time() < 4.0 {
        if !(live.step() && energy(&arm, live.state()) - lowest <= most) {
            return false;
        }
    }
    true
}

fn compare<T: PartialEq>(
    name: &str,
    rounds: u32,
    alone: impl Fn() -> Vec<T>,
    together: impl Fn() -> Vec<T>,
) {
    assert!(alone() == together(), "{name}: different answers");
    let timed = |map: &dyn Fn() -> Vec<T>| {
        let began = Instant::now();
        black_box(map());
        1e3 * began.elapsed().as_secs_f64()
    };
    let (mut one, mut other) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..rounds {
        one = one.min(timed(&alone));
        other = other.min(timed(&together));
    }
    println!("{name:<22} {one:8.1} {other:8.1} {:6.1}", one / other);
}

fn main() {
    let rounds = std::env::args().nth(1);
    let rounds = rounds.map_or(10, |rounds| rounds.parse().expect("a number"));
    println!(
        "{:<22} {:>8} {:>8} {:>6}",
        "[ms]", "alone", "lanes", "ratio"
    );
    for method in Method::ALL {
        let timesteps = centres(2e-4, 1e-1, 48);
        let cells = centres(1e-2, 1e2, 36).into_iter().flat_map(|factor| {
            let control = stiffened(factor).with_method(method);
            timesteps.iter().map(move |h| control.with_timestep(*h))
        });
        let cells: Vec<_> = cells.collect();
        let alone = || {
            cells
                .iter()
                .map(|cell| growth(cell, Sampling::Held))
                .collect()
        };
        let together = || growths(&cells, Sampling::Held);
        compare(&format!("stability, {method}"), rounds, alone, together);

        let timesteps = centres(5e-4, 2e-2, 32);
        let moves = centres(0.1, 100.0, 32).into_iter().flat_map(|amplitude| {
            timesteps
                .iter()
                .map(move |h| move_of(amplitude, method, *h))
        });
        let moves: Vec<_> = moves.collect();
        let alone = || moves.chunks(1).flat_map(arrive).collect();
        compare(&format!("moves, {method}"), rounds, alone, || {
            arrive(&moves)
        });

        let timesteps = centres(1e-3, 0.5, 32);
        let free = ControlLoop::free(Arm::default()).with_method(method);
        let swings = centres(0.3, 300.0, 32).into_iter().flat_map(|spin| {
            timesteps
                .iter()
                .map(move |h| (free.with_timestep(*h), spun(spin)))
        });
        let swings: Vec<_> = swings.collect();
        let alone = || swings.iter().map(is_carried).collect();
        compare(&format!("swings, {method}"), rounds, alone, || {
            are_carried(&swings)
        });
    }
}
