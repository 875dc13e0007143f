//! Pendularm beside Pinocchio and MuJoCo: the states for all, our own row of the table, and the table.
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
//! *Throughput*: independent states; *chained*: every result moves the next state. A *step* is `increment` and two sums, under an
//! effort held over the step; a *live step* is the arm's own, with compensated sums, clock and check for divergence, PID off.

use std::collections::BTreeMap;
use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::forward_dynamics;
use pendularm::math::integrator::Method;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::{Simulation, step_under};

// As in harness.h, which says what they mean.
const CALLS: usize = 500;
const RUNS_MAX: usize = 20_000;
const RUNS_MIN: usize = 20;
const SWING_STEPS: usize = 1000;
const ROW: Duration = Duration::from_millis(200);
const TIMESTEP: f64 = 1e-3;

/// Two results of one name may differ by this much, relative to the largest number of the result. Mass matrices of these arms
/// have condition numbers up to some hundred, so rounding alone makes some 1e-14; a wrong inertia, sign or stage, 1e-3.
const BOUND: f64 = 1e-13;
/// The end of the swing: a thousand steps' roundings add up.
const SWING_BOUND: f64 = 1e-12;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["states", "2"] => print_states::<2>(),
        ["states", "3"] => print_states::<3>(),
        ["check", "2", path] => check::<2>(path),
        ["check", "3", path] => check::<3>(path),
        ["time", "2", path] => time::<2>(path),
        ["time", "3", path] => time::<3>(path),
        ["compare", folder] => compare(Path::new(folder)),
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

/// Positions over a few turns, velocities to 3 rad/s, efforts to 10 N m, the same in every run (xorshift).
fn print_states<const N: usize>() {
    let mut bits = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = |range: f64| {
        bits ^= bits << 13;
        bits ^= bits >> 7;
        bits ^= bits << 17;
        (bits as f64 / u64::MAX as f64 - 0.5) * range
    };
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

fn step<const N: usize>(
    arm: &Arm<N>,
    method: Method,
    effort: &[f64; N],
    state: &mut State<N>,
    h: f64,
) {
    *state = state.plus(&step_under(arm, method, state, effort, h));
}

fn check<const N: usize>(path: &str) {
    let arm = Arm::<N>::default();
    let show = |name: &str, k: usize, numbers: &[f64]| {
        let numbers: Vec<String> = numbers.iter().map(f64::to_string).collect();
        println!("{name} {k} {}", numbers.join(" "));
    };
    for (k, (state, effort)) in read_states::<N>(path).iter().enumerate() {
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
    for method in [Method::Euler, Method::Rk4].map(black_box) {
        measure::<N, _>(&format!("{method} step"), || {
            let mut state = black_box(start());
            for _ in 0..CALLS {
                step(&arm, method, &effort, &mut state, h);
            }
            state
        });
    }
    for method in [Method::Euler, Method::Rk4] {
        let gains = Gains {
            kp: [200.0; N],
            ki: [10.0; N],
            kd: [10.0; N],
        };
        measure::<N, _>(&format!("{method} step, live"), || {
            let mut simulation = Simulation::new(arm, gains);
            simulation.set_method(method);
            assert_eq!(simulation.advance(CALLS as u64), CALLS as u64, "diverged");
            simulation
        });
    }
}

/// Times `run`, which makes [`CALLS`] calls, and prints its row.
fn measure<const N: usize, T>(what: &str, mut run: impl FnMut() -> T) {
    let begun = Instant::now();
    let mut times = Vec::with_capacity(RUNS_MAX);
    while times.len() < RUNS_MAX && (times.len() < RUNS_MIN || begun.elapsed() < ROW) {
        let start = Instant::now();
        black_box(run());
        times.push(start.elapsed().as_secs_f64() * 1e9 / CALLS as f64);
    }
    times.sort_unstable_by(f64::total_cmp);
    println!(
        "pendularm,{N},\"{what}\",{:.2},{:.2}",
        times[0],
        times[times.len() / 2]
    );
}

/// Results of one program, by name and number.
type Results = BTreeMap<String, Vec<f64>>;

fn read_results(path: &Path) -> Results {
    let text = fs::read_to_string(path).expect("results can be read");
    let result = |line: &str| {
        let mut words = line.split(' ');
        let name = words
            .next()
            .into_iter()
            .chain(words.next())
            .collect::<Vec<_>>()
            .join(" ");
        (name, words.map(|x| x.parse().expect("a number")).collect())
    };
    text.lines().map(result).collect()
}

/// Largest difference of two results, relative to the largest number of the first. Not a number counts as infinite.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "numbers in a result");
    let largest = a.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs() / largest);
    apart.fold(0.0, |worst, x| {
        if x.is_nan() {
            f64::INFINITY
        } else {
            worst.max(x)
        }
    })
}

fn compare(folder: &Path) {
    let mut agree = true;
    for links in [2, 3] {
        agree &= compare_results(folder, links);
    }
    if !agree {
        eprintln!("peers: the results differ, so the times mean nothing");
        std::process::exit(1);
    }
    compare_times(folder);
}

/// Every program's results against every other's, the worst of each kind printed. False if one is out of bounds.
fn compare_results(folder: &Path, links: usize) -> bool {
    let prefix = format!("check-{links}-");
    let mut programs: Vec<(String, Results)> = Vec::new();
    for entry in fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("an entry").path();
        let name = path
            .file_stem()
            .and_then(|name| name.to_str())
            .unwrap_or_default();
        if let Some(system) = name.strip_prefix(&prefix) {
            programs.push((system.to_owned(), read_results(&path)));
        }
    }
    programs.sort_by(|a, b| a.0.cmp(&b.0));
    assert!(programs.len() > 1, "nothing to compare with");
    // Kind of result: worst difference, and between whom.
    let mut worst: BTreeMap<&str, (f64, String)> = BTreeMap::new();
    for (i, (a_name, a)) in programs.iter().enumerate() {
        for (b_name, b) in &programs[i + 1..] {
            assert!(
                a.keys().eq(b.keys()),
                "{a_name} and {b_name} were asked different things"
            );
            for (name, numbers) in a {
                let kind = name.split(' ').next().unwrap_or_default();
                let apart = difference(numbers, &b[name]);
                let entry = worst.entry(kind).or_insert((0.0, String::from("all")));
                if apart > entry.0 {
                    *entry = (apart, format!("{a_name}, {b_name}"));
                }
            }
        }
    }
    let mut agree = true;
    let names: Vec<&str> = programs.iter().map(|(name, _)| name.as_str()).collect();
    println!(
        "{links} links: {} programs, each against every other ({})",
        names.len(),
        names.join("; ")
    );
    for (kind, (apart, between)) in worst {
        let bound = if kind == "swing" { SWING_BOUND } else { BOUND };
        agree &= apart <= bound;
        println!(
            "  {kind:8} largest relative difference {apart:.1e} of at most {bound:.0e}  ({between})"
        );
    }
    agree
}

/// Shortest and median time of a row over the passes.
#[derive(Default)]
struct Row {
    shortest: Vec<f64>,
    median: Vec<f64>,
}

impl Row {
    fn least(&self) -> f64 {
        self.shortest.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The median of the passes' medians.
    fn middle(&self) -> f64 {
        let mut medians = self.median.clone();
        medians.sort_unstable_by(f64::total_cmp);
        medians[medians.len() / 2]
    }
}

/// `system,links,"what",shortest,median` line by line; `what` may hold a comma.
fn read_times(path: &Path) -> BTreeMap<(String, String, String), Row> {
    let mut rows: BTreeMap<_, Row> = BTreeMap::new();
    for line in fs::read_to_string(path)
        .expect("times can be read")
        .lines()
        .skip(1)
    {
        let (head, tail) = line.split_once(",\"").expect("a quoted name");
        let (what, numbers) = tail.split_once("\",").expect("a quoted name");
        let (system, links) = head.split_once(',').expect("a number of links");
        let (shortest, median) = numbers.split_once(',').expect("two times");
        let row = rows
            .entry((links.to_owned(), what.to_owned(), system.to_owned()))
            .or_default();
        row.shortest.push(shortest.parse().expect("a time"));
        row.median.push(median.parse().expect("a time"));
    }
    rows
}

fn compare_times(folder: &Path) {
    let rows = read_times(&folder.join("times.csv"));
    println!(
        "\nns per call: shortest run (median); ratio to pendularm's of the same kind: of the shortest (of the medians)"
    );
    let mut title = String::new();
    for ((links, what, system), row) in &rows {
        // The same kind, or that of which this is a variant ("... in the world frame", "..., live").
        let same = |what: &str| rows.get(&(links.clone(), what.to_owned(), "pendularm".to_owned()));
        let own = same(what).or_else(|| same(&what.replace(" in the world frame", "")));
        let heading = format!("{links} links, {what}");
        if heading != title {
            println!("{heading}");
            title = heading;
        }
        let ratio = own
            .filter(|_| system != "pendularm")
            .map_or(String::new(), |own| {
                format!(
                    "  x {:.1} ({:.1})",
                    row.least() / own.least(),
                    row.middle() / own.middle()
                )
            });
        println!(
            "  {system:24} {:8.1} ({:.1}){ratio}",
            row.least(),
            row.middle()
        );
    }
    println!();
    for links in ["2", "3"] {
        let least = |what: &str, system: &str| {
            rows.get(&(links.to_owned(), what.to_owned(), system.to_owned()))
                .map_or(f64::NAN, Row::least)
        };
        for (what, own, system, target) in [
            (
                "forward dynamics, throughput",
                "forward dynamics, throughput",
                "pinocchio wheel",
                10.0,
            ),
            ("rk4 step", "rk4 step", "mujoco", 15.0),
            ("rk4 step", "rk4 step, live", "mujoco", 15.0),
        ] {
            let ratio = least(what, system) / least(own, "pendularm");
            let verdict = if ratio >= target { "reached" } else { "MISSED" };
            println!(
                "target, {links} links: {system} / {own}: {ratio:.1}, at least {target:.0}: {verdict}"
            );
        }
    }
}
