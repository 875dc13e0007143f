//! Work that a scene does not need, and whether it is left out.
//!
//! Times and bits are measured here. Instructions, allocations and the server's own work are counted by
//! `scripts/measure-work.sh`, which leaves them in `work.csv` beside the page. A missing count is said to be
//! unmeasured.
//!
//! **Invariant:** no number in here that was not measured for this report.

mod cells;
mod counts;
mod server;
mod tables;

use std::hint::black_box;

use counts::{Counts, Kind, STEPS, read};
use tables::table;

use crate::math::arm::State;
use crate::math::count::in_f64;
use crate::math::dynamics::forward_dynamics;
use crate::math::expression::Expression;
use crate::math::integrator::{Method, increment};
use crate::math::particle::Particle;
use crate::math::pid::Gains;
use crate::math::simulation::{Simulation, step_under};
use crate::report::csv::Csv;
use crate::report::experiments::step_scene::{ready, undamped};
use crate::report::making::Making;
use crate::report::section::{Block, Figure, Section, Verdict};
use crate::report::svg::{Bars, number};
use crate::report::timing::{Effort, time};

pub(super) fn make(making: &mut Making<'_>) -> Section {
    let counts = read(making);
    let kinds = time_kinds(making);
    let same_bits = [
        off_is_zero_gains::<2>() && off_is_zero_gains::<3>(),
        weightless_is_gravity_zero::<2>() && weightless_is_gravity_zero::<3>(),
    ];
    let mut csv = Csv::new("name,ns_per_step,ns_iqr,instructions_per_step");
    for kind in &kinds {
        let per_step = 1e9 / in_f64(STEPS);
        let (low, high) = kind.timing.quartiles;
        csv.row(&[
            kind.name.into(),
            (kind.timing.minimum * per_step).into(),
            ((high - low) * per_step).into(),
            counts.get(kind.name).copied().into(),
        ]);
    }
    making.keep("left-out", csv);
    let table = table(&kinds, &counts, same_bits);
    Section {
        findings: findings(&counts),
        verdicts: verdicts(&counts, same_bits),
        blocks: vec![Block::Figure(figure(&kinds, &counts)), Block::Table(table)],
        ..Section::default()
    }
}

fn time_kinds(making: &Making<'_>) -> Vec<Kind> {
    let effort = making.choose(
        Effort {
            least: 15,
            most: 60,
            seconds: 0.5,
        },
        Effort {
            least: 5,
            most: 10,
            seconds: 0.02,
        },
    );
    let mut kinds = Vec::new();
    let mut add = |name, work: &mut dyn FnMut() -> f64| {
        kinds.push(Kind {
            name,
            timing: time(effort, work),
        });
    };
    let two = |gravity, integral, control, method| {
        let ready = ready::<2>(gravity, integral, control, method);
        move || run(&ready)
    };
    let three = |gravity, control| {
        let ready = ready::<3>(gravity, true, control, Method::Rk4);
        move || run(&ready)
    };
    add(
        "step-2-euler-free",
        &mut two(9.81, true, false, Method::Euler),
    );
    add(
        "step-2-midpoint-free",
        &mut two(9.81, true, false, Method::Midpoint),
    );
    add(
        "step-2-verlet-free",
        &mut two(9.81, true, false, Method::Verlet),
    );
    add("step-2-rk4-free", &mut two(9.81, true, false, Method::Rk4));
    add(
        "step-2-rk4-weightless",
        &mut two(0.0, true, false, Method::Rk4),
    );
    add("step-2-rk4-pd", &mut two(9.81, false, true, Method::Rk4));
    let mut without_damping = ready::<2>(9.81, true, true, Method::Rk4);
    without_damping.set_gains(undamped());
    add("step-2-rk4-pi", &mut || run(&without_damping));
    let mut pushed = ready::<2>(9.81, true, true, Method::Rk4);
    pushed.disturb([0.0; 2], 1e9);
    add("step-2-rk4-pushed", &mut || run(&pushed));
    add("step-2-rk4-pid", &mut two(9.81, true, true, Method::Rk4));
    add("step-3-rk4-free", &mut three(9.81, false));
    add("step-3-rk4-weightless", &mut three(0.0, false));
    add("step-3-rk4-pid", &mut three(9.81, true));
    add("particle-rk4-constant", &mut || particle("1"));
    add("particle-rk4-cosine", &mut || particle("cos(2*t)"));
    kinds
}

fn run<const N: usize>(ready: &Simulation<N>) -> f64 {
    let mut simulation = ready.clone();
    simulation.advance(STEPS);
    black_box(simulation.state().position.iter().sum())
}

fn particle(function: &str) -> f64 {
    let Ok(function) = Expression::parse(function) else {
        return f64::NAN;
    };
    let Ok(mut particle) = Particle::new(function, 0.5, -0.25, 1e-4, STEPS, Method::Rk4) else {
        return f64::NAN;
    };
    particle.advance(usize::MAX);
    particle.positions().last().copied().unwrap_or(f64::NAN)
}

/// Whether an arm without control takes the same steps, bit for bit, as one under control with gains of zero.
fn off_is_zero_gains<const N: usize>() -> bool
where
    Gains<N>: Default,
{
    Method::ALL.into_iter().all(|method| {
        let mut off = ready::<N>(9.81, true, false, method);
        let mut zero = ready::<N>(9.81, true, true, method);
        zero.set_gains(Gains {
            kp: [0.0; N],
            ki: [0.0; N],
            kd: [0.0; N],
        });
        off.advance(5000);
        zero.advance(5000);
        let bits = |simulation: &Simulation<N>| simulation.state().position.map(f64::to_bits);
        bits(&off) == bits(&zero)
    })
}

/// Whether a live arm at gravity 0, which does not look at its first angle, moves by the same bits as steps that do.
fn weightless_is_gravity_zero<const N: usize>() -> bool
where
    Gains<N>: Default,
{
    Method::ALL.into_iter().all(|method| {
        let mut live = ready::<N>(0.0, true, false, method);
        let mut state = State {
            position: [0.4; N],
            velocity: [1.5; N],
        };
        live.set_state(state);
        let (arm, h) = (*live.arm(), live.timestep());
        (0..5000).all(|_| {
            // From the same state each: the live arm carries its rounding, these steps do not.
            let State { position, velocity } = &state;
            let acceleration =
                |_, q: &[f64; N], v: &[f64; N]| forward_dynamics(&arm, q, v, &[0.0; N]);
            let looked_at = increment(method, acceleration, 0.0, position, velocity, h);
            let left_out = step_under(&arm, method, &state, &[0.0; N], h);
            live.advance(1);
            state = *live.state();
            looked_at == left_out
        })
    })
}

/// Bars of what a step and the server execute, and of how long a step takes.
fn figure(kinds: &[Kind], counts: &Counts) -> Figure {
    let of_kinds = |value: &dyn Fn(&Kind) -> Option<f64>| {
        kinds
            .iter()
            .map(|kind| (kind.name.to_owned(), value(kind)))
            .collect()
    };
    let server = [
        ("paused", "server-paused"),
        ("running, nobody listens", "server-running"),
        ("1 subscriber", "server-1-subscriber"),
        ("11 subscribers", "server-11-subscribers"),
    ];
    let panels = [
        Bars {
            title: "Instructions per step".to_owned(),
            class: "c1",
            rows: of_kinds(&|kind| counts.get(kind.name).map(|count| count.round())),
        },
        Bars {
            title: "Time per step [ns]".to_owned(),
            class: "c2",
            rows: of_kinds(&|kind| Some(1e9 * kind.step_time())),
        },
        Bars {
            title: "The server: million instructions per second".to_owned(),
            class: "c3",
            rows: server
                .map(|(label, name)| (label.to_owned(), counts.get(name).map(|n| n / 1e6)))
                .into(),
        },
    ];
    let allocations = counts.get("allocations-in-steps").map_or_else(
        || "Allocations were not counted.".to_owned(),
        |count| format!("Allocations in these steps: {}.", number(*count)),
    );
    Figure::of_panels(
        "left-out",
        "What a step and the server do, scene by scene",
        format!("Instructions by callgrind, time as the minimum of repeats. {allocations}"),
        &[],
        panels.iter().map(Bars::render).collect(),
    )
}

fn findings(counts: &Counts) -> Vec<String> {
    let mut findings = Vec::new();
    if let (Some((none, _)), Some((one, each)), Some((eleven, again))) = (
        server::encoded(counts, "server-running"),
        server::encoded(counts, "server-1-subscriber"),
        server::encoded(counts, "server-11-subscribers"),
    ) {
        findings.push(format!(
            "**While nobody listens the server encodes {} messages a second**, for one subscriber {} at {} \
             instructions each, for eleven {} at {}.",
            number(none),
            number(one),
            number(each.round()),
            number(eleven),
            number(again.round())
        ));
    }
    if let (Some(off), Some(on)) = (counts.get("step-2-rk4-free"), counts.get("step-2-rk4-pid")) {
        findings.push(format!(
            "**The arm is what a step costs, not what is around it**: without the control law a 2-link RK4 step is {} \
             instructions instead of {}.",
            number(off.round()),
            number(on.round())
        ));
    }
    findings
}

/// Claims about a count: its name, its unit, and what it must be below. Whole numbers below one half are none.
const BELOW: [(&str, &str, &str, f64); 5] = [
    (
        "A physics step allocates nothing",
        "allocations-in-steps",
        "allocations",
        0.5,
    ),
    (
        "The 1-DOF service runs none of the arm's code",
        "arm-in-particle-rk4-constant",
        "instructions a step",
        0.5,
    ),
    (
        "Nothing is encoded while nobody subscribes",
        "server-running-json",
        "instructions of JSON a second",
        0.5,
    ),
    (
        "The gateway does not wake while nothing is asked of it (less than once a second)",
        "wakes-idle",
        "wake-ups a second",
        1.0,
    ),
    (
        "Without its feature no web code is in the program",
        "web-symbols-bare",
        "symbols of HTTP and WebSocket",
        0.5,
    ),
];

fn verdicts(counts: &Counts, [off, weightless]: [bool; 2]) -> Vec<Verdict> {
    let no_bit = |work: &str, holds| Verdict {
        claim: format!("Leaving out {work} changes no bit"),
        seen: "5000 steps of every method, 2 and 3 links".to_owned(),
        holds,
    };
    let mut verdicts = vec![
        no_bit("the control law", off),
        no_bit("the first angle at gravity 0", weightless),
    ];
    for (claim, name, unit, bound) in BELOW {
        if let Some(count) = counts.get(name) {
            verdicts.push(Verdict {
                claim: claim.to_owned(),
                seen: format!("{} {unit}", number(*count)),
                holds: *count < bound,
            });
        }
    }
    if let (Some((_, one)), Some((_, eleven))) = (
        server::encoded(counts, "server-1-subscriber"),
        server::encoded(counts, "server-11-subscribers"),
    ) {
        verdicts.push(Verdict {
            claim: "A message is encoded once, for eleven subscribers as for one (within 1 %)"
                .to_owned(),
            seen: format!(
                "{} and {} instructions of JSON a message",
                number(eleven.round()),
                number(one.round())
            ),
            holds: (eleven / one - 1.0).abs() <= 0.01,
        });
    }
    if let (Some(running), Some(paused)) =
        (counts.get("server-running"), counts.get("server-paused"))
    {
        verdicts.push(Verdict {
            claim: "A paused server executes less than half the instructions of a running one"
                .to_owned(),
            seen: format!(
                "{} against {} million a second",
                number(paused / 1e6),
                number(running / 1e6)
            ),
            holds: paused < &(0.5 * running),
        });
    }
    verdicts
}
