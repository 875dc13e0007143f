//! The tables of work left out.
//!
//! **Invariant:** what was not counted for this report is called not measured.

use super::super::super::section::{Cell, Table};
use super::super::super::svg::{number, seconds};
use super::{Counts, Kind, STEPS, in_f64};

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
        place: "not left out: one number that the recursion starts from, not a term of its own",
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
        place: "math::particle knows no arm; here with a constant force, so that no formula is counted",
        with: "step-2-rk4-free",
        without: "particle-rk4-constant",
    },
];

const UNMEASURED: &str = "not measured in this run";

fn unmeasured() -> Cell {
    Cell::new(UNMEASURED).class("soft")
}

fn percent_saved(with: Option<f64>, without: Option<f64>) -> Cell {
    match (with, without) {
        (Some(with), Some(without)) => Cell::new(format!(
            "{} %",
            number((100.0 * (1.0 - without / with)).round())
        )),
        _ => Cell::default(),
    }
}

/// The table of the section: rows of the step, of the server, and of what nobody measured.
pub(super) fn table(kinds: &[Kind], counts: &Counts, same_bits: bool) -> Table {
    let mut table = Table::new(
        "left-out",
        "What is left out, and the proof",
        "Instructions are counted by callgrind over the same number of steps on both sides, start of the program taken off; times are \
         the minimum of repeats on this machine and follow the instructions only loosely, since a step is one chain of dependent \
         operations.",
        &[
            "Work",
            "Where it is left out",
            "With it",
            "Without it",
            "Saved",
        ],
    );
    for row in &ROWS {
        table.rows.push(step_row(row, kinds, counts));
    }
    table.rows.push(paused_row(counts));
    table.rows.push(unheard_row(counts));
    table.rows.push(encoding_row(counts));
    table.rows.push(further_row(counts));
    table.rows.push(allocation_row(counts));
    table.rows.push(vec![
        Cell::new("The same bits without the control law"),
        Cell::new("controller off against gains of zero, 5000 steps, all methods, 2 and 3 links"),
        Cell::default(),
        Cell::default(),
        if same_bits {
            Cell::new("same bits").class("good")
        } else {
            Cell::new("bits differ").class("bad")
        },
    ]);
    for (work, place) in NOT_COUNTED {
        let row = [Cell::new(work), Cell::new(place), unmeasured()];
        table.rows.push(
            row.into_iter()
                .chain([Cell::default(), Cell::default()])
                .collect(),
        );
    }
    table
}

/// What has no count yet.
const NOT_COUNTED: [(&str, &str); 3] = [
    (
        "Goal and trial timers while nothing is asked for",
        "no count of it yet",
    ),
    (
        "Local error estimate without a subscriber",
        "no count of it yet",
    ),
    (
        "Web code without its feature",
        "there is no such feature to leave out",
    ),
];

fn step_row(row: &Row, kinds: &[Kind], counts: &Counts) -> Vec<Cell> {
    let cell = |name| {
        let count = counts.get(name).map_or_else(
            || UNMEASURED.to_owned(),
            |count| format!("{} instructions", number(count.round())),
        );
        let time = kinds
            .iter()
            .find(|kind| kind.name == name)
            .map(Kind::step_time);
        Cell::new(count).detail(time.map(seconds).unwrap_or_default())
    };
    let count = |name| counts.get(name).copied();
    vec![
        Cell::new(row.work),
        Cell::new(row.place),
        cell(row.with),
        cell(row.without),
        percent_saved(count(row.with), count(row.without)),
    ]
}

/// Instructions that the server executed per second, if they were counted.
fn per_second(counts: &Counts, name: &str) -> Option<f64> {
    counts.get(name).copied().filter(|count| *count > 0.0)
}

fn rate(count: Option<f64>, detail: &str) -> Cell {
    count.map_or_else(unmeasured, |count| {
        Cell::new(format!(
            "{} million instructions a second",
            number(count / 1e6)
        ))
        .detail(detail)
    })
}

fn paused_row(counts: &Counts) -> Vec<Cell> {
    let running = per_second(counts, "server-running");
    let paused = per_second(counts, "server-paused");
    vec![
        Cell::new("Stepping while paused"),
        Cell::new("actors::arm_sim asks the pacer for no steps"),
        rate(running, "running, nobody subscribed"),
        rate(paused, "paused"),
        percent_saved(running, paused),
    ]
}

fn unheard_row(counts: &Counts) -> Vec<Cell> {
    let one = per_second(counts, "server-1-subscriber");
    let none = per_second(counts, "server-running");
    vec![
        Cell::new("JSON that nobody subscribes to"),
        Cell::new("the registry tells the arm which topics are wanted"),
        rate(one, "one subscriber of /joint_states"),
        rate(none, "none"),
        percent_saved(one, none),
    ]
}

fn encoding_row(counts: &Counts) -> Vec<Cell> {
    let none = per_second(counts, "server-running");
    let one = per_second(counts, "server-1-subscriber");
    let eleven = per_second(counts, "server-11-subscribers");
    // Were each subscriber's message encoded anew, ten more would cost ten times what the first one did.
    let further = match (none, one, eleven) {
        (Some(none), Some(one), Some(eleven)) => Cell::new(format!(
            "a further one costs {} of the first",
            number((eleven - one) / 10.0 / (one - none))
        )),
        _ => Cell::default(),
    };
    vec![
        Cell::new("Encoding once more for each further subscriber"),
        Cell::new("one frame of shared bytes goes to every outbox"),
        rate(eleven, "eleven subscribers"),
        rate(one, "one"),
        further,
    ]
}

fn further_row(counts: &Counts) -> Vec<Cell> {
    let each = counts.get("allocations-per-subscriber");
    vec![
        Cell::new("Allocations for each further subscriber of a message"),
        Cell::new("counting allocator, 10 against 110 subscribers"),
        each.map_or_else(unmeasured, |each| Cell::new(number(*each))),
        Cell::default(),
        Cell::default(),
    ]
}

fn allocation_row(counts: &Counts) -> Vec<Cell> {
    let seen = counts
        .get("allocations-in-steps")
        .zip(counts.get("steps-counted"));
    vec![
        Cell::new("Allocation in the loop"),
        Cell::new("every state is an array of constant length"),
        Cell::default(),
        seen.map_or_else(unmeasured, |(allocations, steps)| {
            Cell::new(format!(
                "{} in {} million steps",
                number(*allocations),
                number(steps / 1e6)
            ))
        }),
        Cell::default(),
    ]
}

pub(super) fn steps_table(kinds: &[Kind], counts: &Counts) -> Table {
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
