//! Nanoseconds and instructions of the arm's motion, for 2 and 3 links.
//!
//! `cargo run --release --bin dynamics`: the shortest of many short runs, since other work only ever adds time.
//! *Throughput* is of independent states. *Chained*: every result moves the next state, as in a simulation. *Step* is
//! `increment` alone. *Simulation* is a step of the live arm with PID on, compensated sums and the check for
//! divergence.
//!
//! Instructions of 1000 calls, exact on a given compiler (arguments: links, gravity, what):
//!
//! ```text
//! cargo build --release --bin dynamics
//! for what in forward euler midpoint verlet rk4; do
//!   valgrind --tool=callgrind --callgrind-out-file=/dev/null --toggle-collect=dynamics::counted \
//!     target/release/dynamics count 2 9.81 $what 2>&1 | grep Collected
//! done
//! ```

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::forward_dynamics;
use pendularm::math::integrator::Method;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::{Simulation, state_after};
use pendularm::math::trig::sin_cos;
use pendularm_benches::random::spread;
use std::env;
use std::hint::black_box;
use std::time::Instant;

/// Calls in one timed run: some tens of microseconds, so that most runs see no other work on the core.
const CALLS: usize = 500;
/// Runs of which the shortest counts.
const RUNS: usize = 4_000;

fn main() {
    let arguments: Vec<String> = env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["count", "2", gravity, what] => count::<2>(gravity, what),
        ["count", "3", gravity, what] => count::<3>(gravity, what),
        [runs] => report_both(runs.parse().expect("a number of runs")),
        _ => report_both(RUNS),
    }
}

fn report_both(runs: usize) {
    report::<2>(runs);
    report::<3>(runs);
}

fn report<const N: usize>(runs: usize) {
    println!("{N} links, ns");
    let show = |time: f64, what: &str| println!("{time:8.1}  {what}");
    let states = states::<N>();
    let mut pairs = vec![([0.0; N], [0.0; N]); CALLS];
    let time = shortest(runs, || {
        sines(black_box(&states), black_box(&mut pairs), sin_cos)
    });
    show(time, "sines and cosines, throughput");
    let library = |q: &[f64; N]| (q.map(f64::sin), q.map(f64::cos));
    let time = shortest(runs, || {
        sines(black_box(&states), black_box(&mut pairs), library)
    });
    show(time, "the same by the C library");

    let arm = black_box(Arm::<N>::default());
    let effort = black_box([0.3; N]);
    let mut out = vec![[0.0; N]; CALLS];
    let time = shortest(runs, || {
        independent(&arm, &effort, black_box(&states), black_box(&mut out))
    });
    show(time, "forward dynamics, throughput");
    let time = shortest(runs, || chained(&arm, &effort, start()));
    show(time, "forward dynamics, chained");
    for method in Method::ALL.map(black_box) {
        let time = shortest(runs, || steps(&arm, method, &effort, start()));
        show(time, &format!("{method} step, chained"));
        let time = shortest(runs, || live(arm, method));
        show(time, &format!("{method} simulation, PID on"));
    }
}

/// Nanoseconds per call of the fastest run.
fn shortest<T>(runs: usize, mut run: impl FnMut() -> T) -> f64 {
    let mut shortest = f64::INFINITY;
    for _ in 0..runs {
        let begun = Instant::now();
        black_box(run());
        shortest = shortest.min(begun.elapsed().as_secs_f64());
    }
    shortest * 1e9 / CALLS as f64
}

/// Moving slowly, so that no method diverges within a run.
fn start<const N: usize>() -> State<N> {
    black_box(State {
        position: [0.3; N],
        velocity: [0.2; N],
    })
}

/// States spread over a few turns, the same in every run.
fn states<const N: usize>() -> Vec<State<N>> {
    let mut random = spread();
    (0..CALLS)
        .map(|_| State {
            position: std::array::from_fn(|_| random(8.0)),
            velocity: std::array::from_fn(|_| random(6.0)),
        })
        .collect()
}

#[inline(never)]
fn sines<const N: usize>(
    states: &[State<N>],
    out: &mut [([f64; N], [f64; N])],
    sin_cos: impl Fn(&[f64; N]) -> ([f64; N], [f64; N]),
) {
    for (state, out) in states.iter().zip(out) {
        *out = sin_cos(&state.position);
    }
}

#[inline(never)]
fn independent<const N: usize>(
    arm: &Arm<N>,
    effort: &[f64; N],
    states: &[State<N>],
    out: &mut [[f64; N]],
) {
    for (state, out) in states.iter().zip(out) {
        *out = forward_dynamics(arm, &state.position, &state.velocity, effort);
    }
}

/// The position waits for the acceleration, as it does between the stages of a method.
#[inline(never)]
fn chained<const N: usize>(arm: &Arm<N>, effort: &[f64; N], mut state: State<N>) -> State<N> {
    for _ in 0..CALLS {
        let qdd = forward_dynamics(arm, &state.position, &state.velocity, effort);
        for (position, qdd) in state.position.iter_mut().zip(qdd) {
            *position += 1e-9 * qdd;
        }
    }
    state
}

#[inline(never)]
fn steps<const N: usize>(
    arm: &Arm<N>,
    method: Method,
    effort: &[f64; N],
    mut state: State<N>,
) -> State<N> {
    let timestep = black_box(1e-3);
    for _ in 0..CALLS {
        state = state_after(arm, method, &state, effort, timestep);
    }
    state
}

fn live<const N: usize>(arm: Arm<N>, method: Method) -> Simulation<N> {
    let gains = Gains {
        kp: [200.0; N],
        ki: [10.0; N],
        kd: [10.0; N],
    };
    let mut simulation = Simulation::new(arm, gains);
    simulation.set_method(method);
    simulation.enable(true);
    simulation.advance(CALLS as u64);
    simulation
}

fn count<const N: usize>(gravity: &str, what: &str) {
    let gravity = gravity.parse().expect("gravity is a number");
    let arm = Arm::<N>::new([1.0; N], [1.0; N], gravity).expect("gravity is not negative");
    let (arm, effort, states) = (black_box(arm), black_box([0.3; N]), states::<N>());
    let mut out = vec![[0.0; N]; CALLS];
    for _ in 0..1000 / CALLS {
        if what == "forward" {
            counted(|| independent(&arm, &effort, &states, &mut out));
        } else {
            let method = what.parse().expect("forward or a method");
            black_box(counted(|| steps(&arm, method, &effort, start())));
        }
    }
}

/// Runs the part that callgrind counts.
#[inline(never)]
fn counted<T>(run: impl FnOnce() -> T) -> T {
    run()
}
