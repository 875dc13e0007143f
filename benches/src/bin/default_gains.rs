//! The search behind the default gains of 3 links, and how often they keep what is asked of them.
//!
//! ```text
//! default_gains judge [MOVES] [KP KI KD ...]   how often the effort is the load once the arm is slow, by kind of move
//! default_gains search [SECONDS] [SEED]        better ones, from the shipped ones on, by random steps of all nine gains
//! ```
//!
//! Criterion: an arm within 0.02 rad and 0.02 m of its setpoint becomes slower than 0.01 rad/s. From that instant on
//! the effort is within 2 % of the gravity load, of links of 1 kg and of 2 kg. The gains must keep the contract's
//! promises of the defaults. They are within tolerance after 4 s, from rest and out of ten seconds of free swing. They
//! are stable up to 3 ms in every pose with every method, and `ki >= kp`. Turns of 2π at every joint do not diverge at
//! 3 ms. The same seed finds the same gains in as many tries.

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::gravity_load;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::Linear;
use pendularm::study::stability::{Sampling, largest_timestep, limits};

/// How close the joints \[rad\] and the end effector \[m\] must come.
const TOLERANCE: f64 = 0.02;
/// Time to get there \[s\].
const SETTLING: f64 = 4.0;
/// An arm whose joints are all slower is slow \[rad/s\].
const SLOW: f64 = 0.01;
/// How far the effort of a slow arm may be off the load, in parts of the load's largest entry.
const ASKED: f64 = 0.02;
/// Timestep up to which every pose must be stable \[s\].
const STABLE: f64 = 3e-3;

type Three = Gains<3>;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |index: usize, otherwise: f64| -> f64 {
        let text = arguments.get(index);
        text.map_or(otherwise, |text| text.parse().expect("a number"))
    };
    match arguments.first().map(String::as_str) {
        Some("judge") => {
            let gains = if arguments.len() > 2 {
                let part = |of: usize| std::array::from_fn(|i| number(2 + 3 * of + i, f64::NAN));
                Gains {
                    kp: part(0),
                    ki: part(1),
                    kd: part(2),
                }
            } else {
                Gains::default()
            };
            judge(&gains, number(1, 1000.0) as usize);
        }
        Some("search") => search(
            Duration::from_secs_f64(number(1, 600.0)),
            number(2, 1.0) as u64,
        ),
        _ => {
            eprintln!(
                "default_gains: usage: judge [MOVES] [KP KI KD ...] | search [SECONDS] [SEED]"
            );
            std::process::exit(2);
        }
    }
}

/// One move: out of a swing or from rest, to a setpoint far away or near.
#[derive(Debug, Clone, Copy)]
struct Move {
    swings: bool,
    far: bool,
    setpoint: [f64; 3],
}

fn moves(count: usize, seed: u64) -> Vec<Move> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let one = |case: usize| {
        let far = case.is_multiple_of(2);
        let scale = if far { TAU } else { 1.5 };
        Move {
            swings: case % 4 / 2 == 1,
            far,
            setpoint: std::array::from_fn(|_| scale * (2.0 * rng.f64() - 1.0)),
        }
    };
    (0..count).map(one).collect()
}

fn arms() -> [(&'static str, Arm<3>); 2] {
    [1.0, 2.0].map(|mass| {
        let arm = Arm::new([1.0; 3], [mass; 3], 9.81).expect("an arm");
        (if mass == 1.0 { "1 kg" } else { "2 kg" }, arm)
    })
}

/// The arm after ten seconds of free swing.
fn swung(arm: &Arm<3>) -> State<3> {
    let mut free = Simulation::new(*arm, Gains::default());
    free.advance(10_000);
    *free.state()
}

fn arrived(q: &[f64; 3], setpoint: &[f64; 3]) -> bool {
    let tip = |q: &[f64; 3]| {
        let mut direction = 0.0;
        q.iter().fold((0.0, 0.0), |(x, y), q| {
            direction += q;
            (x + f64::cos(direction), y + f64::sin(direction))
        })
    };
    let (got, want) = (tip(q), tip(setpoint));
    q.iter()
        .zip(setpoint)
        .all(|(q, setpoint)| (q - setpoint).abs() <= TOLERANCE)
        && (got.0 - want.0).hypot(got.1 - want.1) <= TOLERANCE
}

/// The outcome of a move.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// When the arm was last out of tolerance \[s\].
    settled: f64,
    /// Effort off the load, in parts of its largest entry, from the first slow instant within tolerance on.
    off: f64,
    /// The same at that instant, its time \[s\], and the largest entry of the load there in parts of the stretched arm's.
    first: (f64, f64, f64),
    /// As `off`, from the first slow instant on wherever the arm is, once it has moved.
    anywhere: f64,
    /// The largest acceleration of a joint where `off` was seen \[rad/s²\], times its speed's sign: an arm that turns
    /// back has a negative one.
    turning: f64,
}

fn run(arm: &Arm<3>, gains: &Three, start: State<3>, one: &Move) -> Seen {
    let mut live = Simulation::new(*arm, *gains);
    live.set_state(start);
    live.set_setpoint(Setpoint::at(one.setpoint));
    live.enable(true);
    let stretched = gravity_load(arm, &[0.0; 3])[0];
    let mut seen = Seen {
        settled: 0.0,
        off: 0.0,
        anywhere: 0.0,
        first: (f64::NAN, f64::NAN, f64::NAN),
        turning: 0.0,
    };
    let (mut is_slow, mut has_moved, mut stands) = (false, false, false);
    let mut before = [0.0; 3];
    let taken = live.advance_with(7000, |now| {
        let State { position, velocity } = now.state();
        let inside = arrived(position, &one.setpoint);
        if !inside {
            seen.settled = now.time();
        }
        let slow = velocity.iter().all(|v| v.abs() < SLOW);
        has_moved |= !slow;
        stands |= has_moved && slow;
        let begins = !is_slow && inside && now.time() > 0.05 && slow;
        is_slow |= begins;
        if is_slow || stands {
            let load = gravity_load(arm, position);
            let largest = load.iter().fold(0.0, |max: f64, load| max.max(load.abs()));
            let off = now
                .effort()
                .iter()
                .zip(load)
                .map(|(effort, load)| (effort - load).abs());
            let off = off.fold(0.0, f64::max) / largest;
            if stands {
                seen.anywhere = seen.anywhere.max(off);
            }
            if begins {
                seen.first = (off, now.time(), largest / stretched);
            }
            if is_slow && off > seen.off {
                seen.off = off;
                let speeding =
                    (0..3).map(|i| (velocity[i] - before[i]) / 1e-3 * velocity[i].signum());
                seen.turning = speeding.fold(
                    0.0,
                    |most: f64, one| if one.abs() > most.abs() { one } else { most },
                );
            }
        }
        before = *velocity;
        ControlFlow::Continue(())
    });
    if taken < 7000 {
        seen.settled = f64::INFINITY;
        seen.off = f64::INFINITY;
    }
    if !is_slow {
        seen.off = f64::INFINITY;
    }
    seen
}

/// Shares of moves on which what is asked holds, by kind, and the worst that do not.
fn judge(gains: &Three, count: usize) {
    println!("{gains:?}");
    for (name, arm) in arms() {
        let swung = swung(&arm);
        let all: Vec<(Move, Seen)> = moves(count, 3)
            .into_iter()
            .map(|one| {
                (
                    one,
                    run(
                        &arm,
                        gains,
                        if one.swings { swung } else { State::rest() },
                        &one,
                    ),
                )
            })
            .collect();
        for (kind, is_it) in [
            ("all", (|_: &Move| true) as fn(&Move) -> bool),
            ("from rest, within 2π", |one| !one.swings && one.far),
            ("from rest, within 1.5 rad", |one| !one.swings && !one.far),
            ("out of a swing, within 2π", |one| one.swings && one.far),
            ("out of a swing, within 1.5 rad", |one| {
                one.swings && !one.far
            }),
        ] {
            let of: Vec<&Seen> = all
                .iter()
                .filter(|(one, _)| is_it(one))
                .map(|(_, seen)| seen)
                .collect();
            let share = |holds: &dyn Fn(&Seen) -> bool| {
                100.0 * of.iter().filter(|seen| holds(seen)).count() as f64 / of.len() as f64
            };
            let loaded: Vec<&&Seen> = of.iter().filter(|seen| seen.first.2 > 0.25).collect();
            let of_loaded = 100.0 * loaded.iter().filter(|seen| seen.off <= ASKED).count() as f64
                / loaded.len() as f64;
            println!(
                "{name}, {kind}: {:.1} % of {} at the first slow instant, {:.1} % ever after, {:.1} % wherever it is \
                 first slow; {of_loaded:.1} % of the {} with a quarter of the stretched arm's load at least; worst {:.3}, settled within {:.2} s",
                share(&|seen| seen.first.0 <= ASKED),
                of.len(),
                share(&|seen| seen.off <= ASKED),
                share(&|seen| seen.anywhere <= ASKED),
                loaded.len(),
                of.iter().map(|seen| seen.off).fold(0.0, f64::max),
                of.iter().map(|seen| seen.settled).fold(0.0, f64::max),
            );
        }
        let mut bad: Vec<&(Move, Seen)> = all.iter().filter(|(_, seen)| seen.off > ASKED).collect();
        bad.sort_by(|a, b| b.1.off.total_cmp(&a.1.off));
        let back = bad.iter().filter(|(_, seen)| seen.turning < 0.0).count();
        println!(
            "{name}: of {} that fail {back} brake where they are furthest off",
            bad.len()
        );
        for (one, seen) in bad.iter().take(8) {
            println!("  {seen:.4?} {one:.3?}");
        }
    }
    println!(
        "stable up to {:.3} ms in every pose",
        1e3 * stable_up_to(gains)
    );
    println!(
        "{}",
        if survives(gains) {
            "turns of 2π at 3 ms arrive"
        } else {
            "turns of 2π at 3 ms DIVERGE"
        }
    );
}

/// The smallest limit of all methods over all poses \[s\].
fn stable_up_to(gains: &Three) -> f64 {
    let of = |method| {
        let control =
            ControlLoop::new(Arm::default(), *gains, Setpoint::default()).with_method(method);
        limits(&control).trusted().unwrap_or(0.0)
    };
    Method::ALL
        .into_iter()
        .map(of)
        .fold(f64::INFINITY, f64::min)
}

/// A quick look at some poses, among them those that limit.
fn seems_stable(gains: &Three) -> bool {
    let control = ControlLoop::new(Arm::<3>::default(), *gains, Setpoint::default());
    let turns = [0.0, FRAC_PI_2, PI];
    let mut poses = turns
        .into_iter()
        .flat_map(|q2| turns.map(|q3| [0.0, q2, q3]));
    poses.all(|pose| {
        let linear = Linear::at_pose(&control, &pose);
        [Method::Euler, Method::Rk4].into_iter().all(|method| {
            largest_timestep(&linear, method, Sampling::Held)
                .is_none_or(|limit| limit > 1.003 * STABLE)
        })
    })
}

/// Moves from within 2π to within 2π at 3 ms, as tests/math/default_gains.rs has them: all arrive in time.
fn survives(gains: &Three) -> bool {
    let mut rng = fastrand::Rng::with_seed(2);
    (0..60).all(|case| {
        let mut anywhere =
            || -> [f64; 3] { std::array::from_fn(|_| TAU * (2.0 * rng.f64() - 1.0)) };
        let (from, to) = (anywhere(), anywhere());
        let mut live = Simulation::new(Arm::<3>::default(), *gains);
        live.set_method(Method::ALL[case % Method::ALL.len()]);
        live.set_timestep(STABLE);
        live.set_state(State::at_rest(from));
        live.set_setpoint(Setpoint::at(to));
        live.enable(true);
        let mut away = 0.0;
        let taken = live.advance_with(2667, |now| {
            if !arrived(&now.state().position, &to) {
                away = now.time();
            }
            ControlFlow::Continue(())
        });
        taken == 2667 && away <= SETTLING
    })
}

/// How bad gains are: moves that fail, and by how much; infinite where what must be kept is not. Gives up beyond `most`.
fn badness(gains: &Three, cases: &[(Arm<3>, State<3>, Vec<Move>)], most: f64) -> f64 {
    if (0..3).any(|i| gains.ki[i] < gains.kp[i]) || !seems_stable(gains) {
        return f64::INFINITY;
    }
    let mut sum = 0.0;
    let longest = cases.iter().map(|case| case.2.len()).max().unwrap_or(0);
    for index in 0..longest {
        for (number, (arm, swung, moves)) in cases.iter().enumerate() {
            let one = &moves[index];
            let start = if one.swings { *swung } else { State::rest() };
            let seen = run(arm, gains, start, one);
            if number == 0 && seen.settled > 0.95 * SETTLING {
                return f64::INFINITY;
            }
            // A move that fails counts one; how far off it is draws the search on where as many fail.
            sum += if seen.off > ASKED { 1.0 } else { 0.0 }
                + 0.5 * (seen.off / ASKED).min(4.0).powi(2) / 16.0;
        }
        if sum > most {
            return f64::INFINITY;
        }
    }
    if survives(gains) { sum } else { f64::INFINITY }
}

fn search(duration: Duration, seed: u64) {
    let cases: Vec<(Arm<3>, State<3>, Vec<Move>)> = arms()
        .into_iter()
        .map(|(_, arm)| (arm, swung(&arm), moves(60, 100 + seed)))
        .collect();
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut best = Gains::default();
    let mut least = badness(&best, &cases, f64::INFINITY);
    println!("from {least:.3} {best:?}");
    let begun = Instant::now();
    let (mut tries, mut width) = (0_u32, 0.15);
    while begun.elapsed() < duration {
        tries += 1;
        let mut step = |gain: f64| {
            // Some gains stay as they are, so that one at a time can be moved too.
            let normal = (0..4).map(|_| rng.f64() - 0.5).sum::<f64>();
            let size = if rng.f64() < 0.5 { width } else { 0.0 };
            gain * (size * normal * 2.0).exp()
        };
        let tried = Gains {
            kp: best.kp.map(&mut step),
            ki: best.ki.map(&mut step),
            kd: best.kd.map(&mut step),
        };
        let bad = badness(&tried, &cases, least);
        if bad < least {
            (best, least) = (tried, bad);
            width = (1.3 * width).min(0.4);
            println!(
                "{tries} tries, {:.0} s: {least:.3} {best:.1?}",
                begun.elapsed().as_secs_f64()
            );
        } else {
            width = (0.995 * width).max(0.02);
        }
    }
    println!("{tries} tries: {least:.3} {best:?}");
    println!(
        "stable up to {:.3} ms in every pose",
        1e3 * stable_up_to(&best)
    );
}
