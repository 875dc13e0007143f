//! Work that a scene does not need, and whether it is left out.
//!
//! Times and bits are measured here. Instructions, allocations and the server's own work are counted by
//! `scripts/measure-work.sh`, which leaves them in `work.csv` beside the page; what is not there is said to be unmeasured.
//!
//! **Invariant:** no number in here that was not measured for this report.

use std::collections::HashMap;
use std::hint::black_box;

use super::super::Desk;
use super::super::csv::Csv;
use super::super::section::{Block, Cell, Section, Table, Verdict};
use super::super::svg::{number, seconds};
use super::super::timing::{Effort, Timing, time};
use crate::math::arm::{Arm, State};
use crate::math::expression::Expression;
use crate::math::integrator::Method;
use crate::math::particle::Particle;
use crate::math::pid::{Gains, Setpoint};
use crate::math::simulation::Simulation;

const STEPS: u64 = 20_000;

/// One kind of step, by the name that `benches/src/bin/work.rs` knows it by.
struct Kind {
    name: &'static str,
    timing: Timing,
}

/// Counts by name, as the script left them.
type Counts = HashMap<String, f64>;

pub(super) fn make(desk: &mut Desk<'_>) -> Section {
    let counts = read(desk);
    let kinds = time_kinds(desk);
    let same_bits = off_is_zero_gains::<2>() && off_is_zero_gains::<3>();
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
    desk.keep("left-out", csv);
    let table = table(&kinds, &counts, same_bits);
    Section {
        findings: findings(&kinds, &counts),
        verdicts: verdicts(&counts, same_bits),
        blocks: vec![
            Block::Table(table),
            Block::Table(steps_table(&kinds, &counts)),
        ],
        ..Section::default()
    }
}

fn read(desk: &Desk<'_>) -> Counts {
    let text = std::fs::read_to_string(desk.out.join("work.csv")).unwrap_or_default();
    text.lines()
        .skip(1)
        .filter_map(|line| {
            let mut fields = line.split(',');
            let name = fields.next()?.to_owned();
            Some((name, fields.next()?.parse().ok()?))
        })
        .collect()
}

fn start<const N: usize>(
    gravity: f64,
    integral: bool,
    control: bool,
    method: Method,
) -> Simulation<N>
where
    Gains<N>: Default,
{
    let arm = Arm::new([1.0; N], [1.0; N], gravity).unwrap_or_default();
    let mut gains = Gains::default();
    if !integral {
        gains.ki = [0.0; N];
    }
    let mut simulation = Simulation::new(arm, gains);
    simulation.set_method(method);
    simulation.set_state(State {
        position: [0.4; N],
        velocity: [0.0; N],
    });
    simulation.set_setpoint(Setpoint {
        position: [0.4; N],
        velocity: [0.0; N],
    });
    simulation.enable(control);
    simulation
}

fn time_kinds(desk: &mut Desk<'_>) -> Vec<Kind> {
    let effort = desk.choose(
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
        desk.at(kinds.len(), 11);
    };
    let two = |gravity, integral, control, method| {
        let ready = start::<2>(gravity, integral, control, method);
        move || run(&ready)
    };
    let three = |gravity, control| {
        let ready = start::<3>(gravity, true, control, Method::Rk4);
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
    add("step-2-rk4-pid", &mut two(9.81, true, true, Method::Rk4));
    add("step-3-rk4-free", &mut three(9.81, false));
    add("step-3-rk4-weightless", &mut three(0.0, false));
    add("step-3-rk4-pid", &mut three(9.81, true));
    add("particle-rk4", &mut particle);
    kinds
}

fn run<const N: usize>(ready: &Simulation<N>) -> f64 {
    let mut simulation = ready.clone();
    simulation.advance(STEPS);
    black_box(simulation.state().position.iter().sum())
}

fn particle() -> f64 {
    let Ok(function) = Expression::parse("cos(2*t)") else {
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
        let mut off = start::<N>(9.81, true, false, method);
        let mut zero = start::<N>(9.81, true, true, method);
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

/// Something left out: what, where, and the names of the counts with it and without it.
struct Row {
    work: &'static str,
    place: &'static str,
    with: &'static str,
    without: &'static str,
}

const ROWS: [Row; 5] = [
    Row {
        work: "Control law with the controller off",
        place: "math::simulation asks the law only while it is on",
        with: "step-2-rk4-pid",
        without: "step-2-rk4-free",
    },
    Row {
        work: "Integral with ki = 0",
        place: "not left out: one product and one clamp a joint",
        with: "step-2-rk4-pid",
        without: "step-2-rk4-pd",
    },
    Row {
        work: "Gravity load without gravity",
        place: "gravity is one number that the recursion starts from, not a term of its own",
        with: "step-2-rk4-free",
        without: "step-2-rk4-weightless",
    },
    Row {
        work: "Third link of a 2-link arm",
        place: "links are a compile-time constant: each arm has its own code",
        with: "step-3-rk4-free",
        without: "step-2-rk4-free",
    },
    Row {
        work: "Mass matrix in the 1-DOF service",
        place: "math::particle knows no arm",
        with: "step-2-rk4-free",
        without: "particle-rk4",
    },
];

const UNMEASURED: &str = "not measured in this run";

fn table(kinds: &[Kind], counts: &Counts, same_bits: bool) -> Table {
    let mut table = Table::new(
        "left-out",
        "What is left out, and the proof",
        "Instructions are counted by callgrind over the same number of steps on both sides, start of the program taken off; times are the minimum of repeats on this \
         machine and follow the instructions only loosely, since a step is one chain of dependent operations.",
        &[
            "Work",
            "Where it is left out",
            "With it",
            "Without it",
            "Saved",
        ],
    );
    for row in &ROWS {
        let both = (counts.get(row.with), counts.get(row.without));
        let time = |name| {
            kinds
                .iter()
                .find(|kind| kind.name == name)
                .map(|kind| seconds(kind.timing.minimum / in_f64(STEPS)))
        };
        let cell = |name| {
            let count = counts.get(name).map_or_else(
                || UNMEASURED.to_owned(),
                |count| format!("{} instructions", number(count.round())),
            );
            Cell::new(count).detail(time(name).unwrap_or_default())
        };
        let saved = match both {
            (Some(with), Some(without)) => {
                format!("{} %", number((100.0 * (1.0 - without / with)).round()))
            }
            _ => UNMEASURED.to_owned(),
        };
        table.rows.push(vec![
            Cell::new(row.work),
            Cell::new(row.place),
            cell(row.with),
            cell(row.without),
            Cell::new(saved),
        ]);
    }
    server_rows(&mut table, counts);
    table.rows.push(vec![
        Cell::new("The same bits without the control law"),
        Cell::new("controller off against gains of zero, 5000 steps, all methods, 2 and 3 links"),
        Cell::new(""),
        Cell::new(""),
        if same_bits {
            Cell::new("same bits").class("good")
        } else {
            Cell::new("bits differ").class("bad")
        },
    ]);
    for (work, place) in [
        (
            "Goal and trial timers while nothing is asked for",
            "no number here yet",
        ),
        (
            "Local error estimate without a subscriber",
            "no number here yet",
        ),
        (
            "Web code without its feature",
            "there is no such feature to leave out",
        ),
    ] {
        table.rows.push(vec![
            Cell::new(work),
            Cell::new(place),
            Cell::new(UNMEASURED).class("soft"),
            Cell::new(""),
            Cell::new(""),
        ]);
    }
    table
}

fn server_rows(table: &mut Table, counts: &Counts) {
    let per_second = |name: &str| counts.get(name).filter(|count| **count > 0.0).copied();
    let shown = |count: Option<f64>| {
        count.map_or_else(
            || Cell::new(UNMEASURED).class("soft"),
            |count| {
                Cell::new(format!(
                    "{} million instructions a second",
                    number(count / 1e6)
                ))
            },
        )
    };
    let saved = |with: Option<f64>, without: Option<f64>| match (with, without) {
        (Some(with), Some(without)) => Cell::new(format!(
            "{} %",
            number((100.0 * (1.0 - without / with)).round())
        )),
        _ => Cell::new(""),
    };
    let [running, paused, one, eleven] = [
        "server-running",
        "server-paused",
        "server-1-subscriber",
        "server-11-subscribers",
    ]
    .map(per_second);
    table.rows.push(vec![
        Cell::new("Stepping while paused"),
        Cell::new("actors::arm_sim asks the pacer for no steps"),
        shown(running).detail("running, nobody connected"),
        shown(paused).detail("paused, the client that paused it connected"),
        saved(running, paused),
    ]);
    table.rows.push(vec![
        Cell::new("JSON that nobody subscribes to"),
        Cell::new("the registry tells the arm which topics are wanted"),
        shown(one).detail("one subscriber of /joint_states"),
        shown(running).detail("none"),
        saved(one, running),
    ]);
    // Were each subscriber's message encoded anew, ten more would cost ten times what the first one did.
    let more = match (eleven, one, running) {
        (Some(eleven), Some(one), Some(none)) => Cell::new(format!(
            "a further one costs {} of the first",
            number((eleven - one) / 10.0 / (one - none))
        )),
        _ => Cell::new(""),
    };
    table.rows.push(vec![
        Cell::new("Encoding once more for each further subscriber"),
        Cell::new("one frame of shared bytes goes to every outbox"),
        shown(eleven).detail("eleven subscribers"),
        shown(one).detail("one"),
        more,
    ]);
    let each = counts.get("allocations-per-subscriber");
    table.rows.push(vec![
        Cell::new("Allocations for each further subscriber of a message"),
        Cell::new("counting allocator, 10 against 110 subscribers"),
        each.map_or_else(
            || Cell::new(UNMEASURED).class("soft"),
            |each| Cell::new(number(*each)),
        ),
        Cell::new(""),
        Cell::new(""),
    ]);
    let allocations = match (
        counts.get("allocations-in-steps"),
        counts.get("steps-counted"),
    ) {
        (Some(allocations), Some(steps)) => Cell::new(format!(
            "{} in {} million steps",
            number(*allocations),
            number(steps / 1e6)
        )),
        _ => Cell::new(UNMEASURED).class("soft"),
    };
    table.rows.push(vec![
        Cell::new("Allocation in the loop"),
        Cell::new("every state is an array of constant length"),
        Cell::new(""),
        allocations,
        Cell::new(""),
    ]);
}

fn steps_table(kinds: &[Kind], counts: &Counts) -> Table {
    let mut table = Table::new(
        "steps",
        "One step",
        "Instructions and time of one step of the live arm's simulation, and of the 1-DOF service.",
        &["Step", "Instructions", "Time", "Middle half of repeats"],
    );
    for kind in kinds {
        let per_step = |time: f64| seconds(time / in_f64(STEPS));
        let (low, high) = kind.timing.quartiles;
        table.rows.push(vec![
            Cell::new(kind.name),
            counts.get(kind.name).map_or_else(
                || Cell::new(UNMEASURED).class("soft"),
                |count| Cell::new(number(count.round())),
            ),
            Cell::new(per_step(kind.timing.minimum)),
            Cell::new(format!("{} to {}", per_step(low), per_step(high))),
        ]);
    }
    table
}

fn findings(kinds: &[Kind], counts: &Counts) -> Vec<String> {
    let time = |name| {
        kinds
            .iter()
            .find(|kind| kind.name == name)
            .map(|kind| kind.timing.minimum / in_f64(STEPS))
    };
    let mut findings = Vec::new();
    if let (Some(free), Some(pid)) = (counts.get("step-2-rk4-free"), counts.get("step-2-rk4-pid"))
        && let (Some(free_time), Some(pid_time)) = (time("step-2-rk4-free"), time("step-2-rk4-pid"))
    {
        findings.push(format!(
            "**Without control a 2-link RK4 step is {} instructions instead of {}** ({} instead of {}).",
            number(free.round()),
            number(pid.round()),
            seconds(free_time),
            seconds(pid_time)
        ));
    }
    findings
}

fn verdicts(counts: &Counts, same_bits: bool) -> Vec<Verdict> {
    let mut verdicts = vec![Verdict {
        claim: "Leaving out the control law changes no bit".to_owned(),
        seen: "5000 steps of every method, 2 and 3 links".to_owned(),
        holds: same_bits,
    }];
    if let Some(allocations) = counts.get("allocations-in-steps") {
        verdicts.push(Verdict {
            claim: "A physics step allocates nothing".to_owned(),
            seen: format!("{} allocations", number(*allocations)),
            holds: *allocations < 0.5,
        });
    }
    if let (Some(running), Some(paused)) =
        (counts.get("server-running"), counts.get("server-paused"))
    {
        verdicts.push(Verdict {
            claim: "A paused server works less than a running one".to_owned(),
            seen: format!(
                "{} against {} million instructions a second",
                number(paused / 1e6),
                number(running / 1e6)
            ),
            holds: paused < running,
        });
    }
    verdicts
}

#[allow(
    clippy::cast_precision_loss,
    reason = "counts of steps are far below 2^53"
)]
fn in_f64(count: u64) -> f64 {
    count as f64
}
