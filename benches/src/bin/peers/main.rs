//! Pendularm beside Pinocchio, the C that Pinocchio generates, and MuJoCo: the states for all, our own row of the table, and the table.
//!
//! ```text
//! peers states LINKS             the states that every program is given, a line each
//! peers check LINKS STATES       our results at those states
//! peers time LINKS STATES        our times: system,links,what,shortest,median [ns per call]
//! peers compare FOLDER           results (check-LINKS-SYSTEM.txt) against each other, then ratios of the times (times.csv)
//! ```
//!
//! `benches/peers/run.sh` calls them in this order. The peers' own programs are `benches/peers/*.cpp` and `*.c`; their
//! `harness.h` has the same constants as this file. A result that strays from another's ends the run before any ratio.
//!
//! *Throughput* and *independent*: the states are independent. *Chained*, and steps without such a word: every result
//! moves the next state. A *step* is `increment` and two sums, under an effort held over the step. A *live step* is the
//! arm's own, with compensated sums, clock and check for divergence, PID off. *Lanes* are many such live arms side by
//! side, a lane of a register for each, over ADVANCE steps a call. For forward dynamics they are all states, in columns.

mod compare;

use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::forward_dynamics;
use pendularm::math::integrator::{Method, increment};
use pendularm::math::number::Registers;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::Simulation;
use pendularm_benches::random::spread;

// The same as in harness.h, which explains them.
const CALLS: usize = 500;
const RUNS_MAX: usize = 20_000;
const RUNS_MIN: usize = 20;
const SWING_STEPS: usize = 1000;
const ROW: Duration = Duration::from_millis(200);
const TIMESTEP: f64 = 1e-3;

/// Steps of arms in lanes in a call; the cost of putting them there is shared by all of these.
const ADVANCE: u64 = 200;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["states", "2"] => print_states::<2>(),
        ["states", "3"] => print_states::<3>(),
        ["check", "2", path] => check::<2>(path),
        ["check", "3", path] => check::<3>(path),
        ["time", "2", path] => time::<2>(path),
        ["time", "3", path] => time::<3>(path),
        ["compare", folder] => compare::compare(Path::new(folder)),
        _ => {
            eprintln!(
                "peers: usage: states LINKS | check LINKS STATES | time LINKS STATES | compare FOLDER"
            );
            std::process::exit(2);
        }
    }
}

/// A state and the effort at it.
type Case<const N: usize> = (State<N>, [f64; N]);

/// Positions over a few turns, velocities to 3 rad/s, efforts to 10 N m, the same in every run.
fn print_states<const N: usize>() {
    let mut random = spread();
    for _ in 0..CALLS {
        let line: Vec<String> = [8.0, 6.0, 20.0]
            .into_iter()
            .flat_map(|range| [range; N])
            .map(|range| random(range).to_string())
            .collect();
        println!("{}", line.join(" "));
    }
}

fn read_states<const N: usize>(path: &str) -> Vec<Case<N>> {
    let text = fs::read_to_string(path).expect("the states can be read");
    let case = |line: &str| {
        let x: Vec<f64> = line
            .split(' ')
            .map(|x| x.parse().expect("a number"))
            .collect();
        let part = |k: usize| std::array::from_fn(|i| x[k * N + i]);
        let state = State {
            position: part(0),
            velocity: part(1),
        };
        (state, part(2))
    };
    let cases: Vec<Case<N>> = text.lines().map(case).collect();
    assert_eq!(cases.len(), CALLS, "states in {path}");
    cases
}

fn start<const N: usize>() -> State<N> {
    State {
        position: [0.3; N],
        velocity: [0.2; N],
    }
}

/// A step of an arm with gravity, as in the peers. It omits the check for work that can be left out.
#[inline(always)]
fn step<const N: usize>(
    arm: &Arm<N>,
    method: Method,
    effort: &[f64; N],
    state: &mut State<N>,
    h: f64,
) {
    let State { position, velocity } = state;
    let moved = if method == Method::Euler {
        // Within the loop, as in `step_under`.
        increment(
            method,
            #[inline(always)]
            |_, q: &[f64; N], qd: &[f64; N]| forward_dynamics(arm, q, qd, effort),
            0.0,
            position,
            velocity,
            h,
        )
    } else {
        let acceleration = |_, q: &[f64; N], qd: &[f64; N]| forward_dynamics(arm, q, qd, effort);
        increment(method, acceleration, 0.0, position, velocity, h)
    };
    *state = state.plus(&moved);
}

fn gains<const N: usize>() -> Gains<N> {
    Gains {
        kp: [200.0; N],
        ki: [10.0; N],
        kd: [10.0; N],
    }
}

/// A live arm at a state, under an effort that does not end.
fn live<const N: usize>((state, effort): &Case<N>, method: Method) -> Simulation<N> {
    let mut simulation = Simulation::new(Arm::default(), gains());
    simulation.set_method(method);
    simulation.set_timestep(TIMESTEP);
    simulation.set_state(*state);
    simulation.disturb(*effort, f64::MAX);
    simulation
}

/// [`ADVANCE`] steps of every case in lanes of these registers, each compared to the bit with those of an arm alone.
/// The first step of that arm is compared with the step that the others are shown.
fn check_lanes<const N: usize>(registers: Registers, cases: &[Case<N>], method: Method) {
    let bits = |state: &State<N>| [state.position, state.velocity].map(|x| x.map(f64::to_bits));
    let mut arms: Vec<Simulation<N>> = cases.iter().map(|case| live(case, method)).collect();
    registers.advance(arms.iter_mut().map(|arm| (arm, ADVANCE)));
    for (arm, case) in arms.iter().zip(cases) {
        let mut alone = live(case, method);
        let (mut next, effort) = *case;
        step(alone.arm(), method, &effort, &mut next, TIMESTEP);
        alone.advance(1);
        assert_eq!(bits(alone.state()), bits(&next), "a step");
        alone.advance(ADVANCE - 1);
        let lanes = registers.lanes();
        assert_eq!(
            bits(arm.state()),
            bits(alone.state()),
            "one of {lanes} lanes"
        );
    }
}

/// A column of each joint's numbers.
fn columns<const N: usize>(cases: &[Case<N>], row: impl Fn(&Case<N>) -> [f64; N]) -> [Vec<f64>; N] {
    std::array::from_fn(|i| cases.iter().map(|case| row(case)[i]).collect())
}

/// Positions, velocities and efforts in columns, and where accelerations go.
type Columns<const N: usize> = [[Vec<f64>; N]; 4];

fn in_columns<const N: usize>(cases: &[Case<N>]) -> Columns<N> {
    [
        columns(cases, |(state, _)| state.position),
        columns(cases, |(state, _)| state.velocity),
        columns(cases, |(_, effort)| *effort),
        columns(cases, |_| [0.0; N]),
    ]
}

/// Accelerations of all states side by side.
fn accelerate<const N: usize>(registers: Registers, arm: &Arm<N>, columns: &mut Columns<N>) {
    let [q, qd, tau, qdd] = columns;
    registers.forward_dynamics(
        arm,
        q.each_ref().map(Vec::as_slice),
        qd.each_ref().map(Vec::as_slice),
        tau.each_ref().map(Vec::as_slice),
        qdd.each_mut().map(Vec::as_mut_slice),
    );
}

fn check<const N: usize>(path: &str) {
    let arm = Arm::<N>::default();
    let show = |name: &str, k: usize, numbers: &[f64]| {
        let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
        println!("{name} {k} {}", numbers.join(" "));
    };
    let cases = read_states::<N>(path);
    for registers in Registers::all() {
        check_lanes(registers, &cases, Method::Euler);
        check_lanes(registers, &cases, Method::Rk4);
        let mut columns = in_columns(&cases);
        accelerate(registers, &arm, &mut columns);
        for (k, (state, effort)) in cases.iter().enumerate() {
            let qdd = forward_dynamics(&arm, &state.position, &state.velocity, effort);
            let together: [f64; N] = std::array::from_fn(|i| columns[3][i][k]);
            assert_eq!(
                together.map(f64::to_bits),
                qdd.map(f64::to_bits),
                "one of many accelerations"
            );
        }
    }
    for (k, (state, effort)) in cases.iter().enumerate() {
        let qdd = forward_dynamics(&arm, &state.position, &state.velocity, effort);
        show("forward", k, &qdd);
        let mut next = *state;
        step(&arm, Method::Euler, effort, &mut next, TIMESTEP);
        show("euler", k, &next.velocity);
        let mut next = *state;
        step(&arm, Method::Rk4, effort, &mut next, TIMESTEP);
        show("rk4", k, &[next.position, next.velocity].concat());
    }
    let mut state = start();
    for _ in 0..SWING_STEPS {
        step(&arm, Method::Rk4, &[0.0; N], &mut state, TIMESTEP);
    }
    show("swing", 0, &[state.position, state.velocity].concat());
}

fn time<const N: usize>(path: &str) {
    let cases = read_states::<N>(path);
    let arm = black_box(Arm::<N>::default());
    let (effort, h) = (black_box([0.0; N]), black_box(TIMESTEP));
    let mut results = vec![[0.0; N]; CALLS];
    measure::<N, _>("forward dynamics, throughput", || {
        for ((state, effort), result) in black_box(&cases).iter().zip(black_box(&mut results)) {
            *result = forward_dynamics(&arm, &state.position, &state.velocity, effort);
        }
    });
    for registers in Registers::all() {
        let mut columns = in_columns(&cases);
        row::<N, _, _>(
            &format!("pendularm {} lanes", registers.lanes()),
            "forward dynamics, throughput",
            CALLS as u64,
            || (),
            |()| accelerate(registers, &arm, black_box(&mut columns)),
        );
    }
    measure::<N, _>("forward dynamics, chained", || {
        let mut state = black_box(start::<N>());
        for _ in 0..CALLS {
            let qdd = forward_dynamics(&arm, &state.position, &state.velocity, &effort);
            for (position, qdd) in state.position.iter_mut().zip(qdd) {
                *position += 1e-9 * qdd;
            }
        }
        state
    });
    // With its method written into the loop, as in the peers' programs.
    time_steps(
        &cases,
        "euler",
        #[inline(always)]
        |effort, state| step(&arm, Method::Euler, effort, state, h),
    );
    time_steps(
        &cases,
        "rk4",
        #[inline(always)]
        |effort, state| step(&arm, Method::Rk4, effort, state, h),
    );
    for method in [Method::Euler, Method::Rk4] {
        measure::<N, _>(&format!("{method} step, live"), || {
            let mut simulation = Simulation::new(arm, gains());
            simulation.set_method(method);
            assert_eq!(simulation.advance(CALLS as u64), CALLS as u64, "diverged");
            simulation
        });
        for registers in Registers::all() {
            time_lanes(registers, &cases, method);
        }
    }
}

/// Times steps of one method, each from the one before and each from a state of its own.
fn time_steps<const N: usize>(
    cases: &[Case<N>],
    method: &str,
    step: impl Fn(&[f64; N], &mut State<N>),
) {
    let effort = black_box([0.0; N]);
    let mut results: Vec<State<N>> = vec![start(); CALLS];
    measure::<N, _>(&format!("{method} step"), || {
        let mut state = black_box(start());
        for _ in 0..CALLS {
            step(&effort, &mut state);
        }
        state
    });
    measure::<N, _>(&format!("{method} step, independent"), || {
        for ((state, effort), result) in black_box(cases).iter().zip(black_box(&mut results)) {
            *result = *state;
            step(effort, result);
        }
    });
}

/// Times live arms in lanes of these registers, [`ADVANCE`] steps a call.
fn time_lanes<const N: usize>(registers: Registers, cases: &[Case<N>], method: Method) {
    let arms: Vec<Simulation<N>> = cases.iter().map(|case| live(case, method)).collect();
    row::<N, _, _>(
        &format!("pendularm {} lanes", registers.lanes()),
        &format!("{method} step, independent"),
        CALLS as u64 * ADVANCE,
        || arms.clone(),
        |mut arms| {
            registers.advance(arms.iter_mut().map(|arm| (arm, ADVANCE)));
            arms
        },
    );
}

/// Times `run`, which makes [`CALLS`] calls, and prints its row.
fn measure<const N: usize, T>(what: &str, mut run: impl FnMut() -> T) {
    row::<N, _, _>("pendularm", what, CALLS as u64, || (), |()| run());
}

/// Times `run` on what `prepare` makes, and prints its row, per call.
fn row<const N: usize, P, T>(
    system: &str,
    what: &str,
    calls: u64,
    mut prepare: impl FnMut() -> P,
    mut run: impl FnMut(P) -> T,
) {
    let begun = Instant::now();
    let mut times = Vec::with_capacity(RUNS_MAX);
    while times.len() < RUNS_MAX && (times.len() < RUNS_MIN || begun.elapsed() < ROW) {
        let prepared = black_box(prepare());
        let start = Instant::now();
        black_box(run(prepared));
        times.push(start.elapsed().as_secs_f64() * 1e9 / calls as f64);
    }
    times.sort_unstable_by(f64::total_cmp);
    println!(
        "{system},{N},\"{what}\",{:.2},{:.2}",
        times[0],
        times[times.len() / 2]
    );
}
