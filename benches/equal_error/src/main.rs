//! The cost of an error: pendularm's methods, its two references, and the crate `ode_solvers`, on one swing.
//!
//! ```text
//! pendularm-equal-error reference LINKS          the joint angles at the end, of twice a double's digits, and how far off they may be
//! pendularm-equal-error time LINKS Q1 [Q2 ...]   a line per run: links,system,setting,error,seconds
//! ```
//!
//! `equal_error.py` runs it beside the others, and says what all are given. The crate is handed our accelerations: only
//! the integrator differs. A run is repeated for a fiftieth of a second, and the shortest counts.

use std::hint::black_box;
use std::time::{Duration, Instant};

use ::ode_solvers::{Dop853, Dopri5, OutputType, SVector, System};
use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::forward_dynamics;
use pendularm::math::integrator::Method;
use pendularm::math::simulation::state_after;
use pendularm::report::experiments::reference::{DoubleDouble, Law, ReferenceMotion};
use pendularm::study::taylor::TaylorReference;

/// Duration of the swing \[s\].
const DURATION: f64 = 4.0;
/// Angle \[rad\] and rate \[rad/s\] of every joint at the start.
const START: (f64, f64) = (0.3, 0.2);
/// Duration of the repetitions of a run, and their least number.
const REPEATED: Duration = Duration::from_millis(20);
const REPEATS: u32 = 3;
/// A setting whose run takes longer ends a sweep \[s\].
const LONGEST: f64 = 1.0;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let angles = || -> Vec<f64> {
        arguments[2..]
            .iter()
            .map(|x| x.parse().expect("an angle"))
            .collect()
    };
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["reference", "2"] => reference::<2>(),
        ["reference", "3"] => reference::<3>(),
        ["time", "2", ..] => all::<2, 4>(&angles()),
        ["time", "3", ..] => all::<3, 6>(&angles()),
        _ => {
            eprintln!("equal-error: usage: reference LINKS | time LINKS Q1 Q2 ...");
            std::process::exit(2);
        }
    }
}

fn start<const N: usize>() -> State<N> {
    State {
        position: [START.0; N],
        velocity: [START.1; N],
    }
}

fn reference<const N: usize>() {
    let motion = ReferenceMotion::new(&Arm::<N>::default(), &start(), &Law::FREE, DURATION);
    let end = motion.angles(DURATION).map(DoubleDouble::to_f64);
    let angles: Vec<String> = end.iter().map(|q| format!("{q:?}")).collect();
    println!("{} {:e}", angles.join(" "), motion.uncertainty(DURATION));
}

/// Prints the line of a setting: its error, and the shortest time of its runs. Returns false at the end of the sweep.
fn line<const N: usize>(
    angles: &[f64],
    system: &str,
    setting: f64,
    mut run: impl FnMut() -> Option<[f64; N]>,
) -> bool {
    let (mut shortest, mut runs, begun) = (f64::INFINITY, 0, Instant::now());
    let mut end = None;
    while runs < REPEATS || begun.elapsed() < REPEATED {
        runs += 1;
        let start = Instant::now();
        end = black_box(run());
        shortest = shortest.min(start.elapsed().as_secs_f64());
    }
    let error = end.map_or(f64::NAN, |end| {
        end.iter()
            .zip(angles)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max)
    });
    println!("{N},{system},{setting:e},{error:e},{shortest:e}");
    shortest < LONGEST
}

/// Numbers of steps, each √2 times the previous one.
fn steps() -> impl Iterator<Item = u64> {
    (10..46).map(|half| 2_f64.powf(f64::from(half) / 2.0).round() as u64)
}

/// Tolerances, two to a power of ten.
fn tolerances() -> impl Iterator<Item = f64> {
    (4..=28).map(|half| 10_f64.powf(-f64::from(half) / 2.0))
}

fn all<const N: usize, const M: usize>(angles: &[f64]) {
    let arm = black_box(Arm::<N>::default());
    for method in Method::ALL {
        for steps in steps() {
            let h = black_box(DURATION / steps as f64);
            let go_on = line(angles, &format!("pendularm {method}"), h, || {
                let mut state = black_box(start::<N>());
                for _ in 0..steps {
                    state = state_after(&arm, method, &state, &[0.0; N], h);
                }
                Some(state.position)
            });
            if !go_on {
                break;
            }
        }
    }
    for tolerance in tolerances() {
        line(angles, "pendularm reference", tolerance, || {
            let mut follower = TaylorReference::within(black_box(start::<N>()), tolerance);
            follower
                .follow(&arm, &[0.0; N], DURATION)
                .then(|| follower.state().position)
        });
    }
    line(
        angles,
        "pendularm in twice the digits (twice)",
        1e-32,
        || {
            let start = black_box(start::<N>());
            let motion = ReferenceMotion::new(&arm, &start, &Law::FREE, DURATION);
            Some(motion.angles(DURATION).map(DoubleDouble::to_f64))
        },
    );
    ode_solvers::<N, M>(angles, &arm);
}

/// The arm as a system of first order: angles, then rates.
#[derive(Clone, Copy)]
struct FirstOrder<const N: usize>(Arm<N>);

impl<const N: usize> FirstOrder<N> {
    fn rates(&self, y: &[f64], rates: &mut [f64]) {
        let q = std::array::from_fn(|i| y[i]);
        let v: [f64; N] = std::array::from_fn(|i| y[N + i]);
        rates[..N].copy_from_slice(&v);
        rates[N..].copy_from_slice(&forward_dynamics(&self.0, &q, &v, &[0.0; N]));
    }
}

impl<const N: usize, const M: usize> System<f64, SVector<f64, M>> for FirstOrder<N> {
    fn system(&self, _: f64, y: &SVector<f64, M>, rates: &mut SVector<f64, M>) {
        self.rates(y.as_slice(), rates.as_mut_slice());
    }
}

fn ode_solvers<const N: usize, const M: usize>(angles: &[f64], arm: &Arm<N>) {
    let first = || SVector::<f64, M>::from_fn(|i, _| if i < N { START.0 } else { START.1 });
    let position = |y: &[f64]| -> [f64; N] { std::array::from_fn(|i| y[i]) };
    // Both have the same functions, but no common trait.
    macro_rules! sweep {
        ($solver:ident, $name:literal) => {
            for tolerance in tolerances() {
                line(angles, $name, tolerance, || {
                    let mut solver = $solver::new(
                        FirstOrder(*arm),
                        0.0,
                        DURATION,
                        DURATION,
                        black_box(first()),
                        tolerance,
                        tolerance,
                    );
                    solver.set_output(OutputType::Sparse);
                    solver.integrate().ok()?;
                    solver.y_out().last().map(|y| position(y.as_slice()))
                });
            }
        };
    }
    sweep!(Dopri5, "ode_solvers Dopri5");
    sweep!(Dop853, "ode_solvers Dop853");
}
