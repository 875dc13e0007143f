//! The tables of work left out; the rows about the server are next door.
//!
//! **Invariant:** what was not counted for this report is called not measured.

use super::cells::{UNMEASURED, percent_saved, unmeasured};
use super::counts::{Counts, Kind};
use super::server;
use crate::report::section::{Cell, Table};
use crate::report::svg::{number, seconds};

/// Something left out, its place, and the names of the counts with it and without it.
struct Row {
    work: &'static str,
    place: &'static str,
    with: &'static str,
    without: &'static str,
}

const ROWS: [Row; 7] = [
    Row {
        work: "Control law with the controller off",
        place: "math::simulation asks the law only while it is on",
        with: "step-2-rk4-pid",
        without: "step-2-rk4-free",
    },
    Row {
        work: "Integral with ki = 0",
        place: "kept: what gathers at ki = 0 acts as soon as ki is set, so it must gather; one product and one clamp a \
                joint",
        with: "step-2-rk4-pid",
        without: "step-2-rk4-pd",
    },
    Row {
        work: "Damping with kd = 0",
        place: "kept: asking whether it is zero would cost as much as its product",
        with: "step-2-rk4-pid",
        without: "step-2-rk4-pi",
    },
    Row {
        work: "A disturbance of zeros",
        place: "kept: none is there until somebody sends one, and one of zeros ends by itself",
        with: "step-2-rk4-pushed",
        without: "step-2-rk4-pid",
    },
    Row {
        work: "First joint's sine and cosine at gravity 0, 2 links",
        place: "kept: both angles are taken in one pass, and left out the first was worth some 4 %",
        with: "step-2-rk4-free",
        without: "step-2-rk4-weightless",
    },
    Row {
        work: "First joint's sine and cosine at gravity 0, 3 links",
        place: "math::simulation takes the recursion that does not look at the first angle; the same bits",
        with: "step-3-rk4-free",
        without: "step-3-rk4-weightless",
    },
    Row {
        work: "Third link of a 2-link arm",
        place: "links are a compile-time constant: each arm has its own code",
        with: "step-3-rk4-free",
        without: "step-2-rk4-free",
    },
];

/// The table of the section: rows of the step, of the server, and of what nobody measured.
pub(super) fn table(kinds: &[Kind], counts: &Counts, same_bits: [bool; 2]) -> Table {
    let mut table = Table::new(
        "left-out",
        "What is left out, and the proof",
        "Instructions are counted by callgrind over the same number of steps on both sides, start of the program taken \
         off; times are the minimum of repeats on this machine and follow the instructions only loosely, since a step \
         is one chain of dependent operations.",
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
    table.rows.push(particle_row(counts));
    table.rows.extend(server::rows(counts));
    table.rows.push(allocation_row(counts));
    table.rows.push(vec![
        Cell::new("A locked joint"),
        Cell::new(
            "there is none: every joint of this arm turns, and a link less is an arm of its own",
        ),
    ]);
    let proofs = [
        (
            "The same bits without the control law",
            "controller off against gains of zero, 5000 steps, all methods, 2 and 3 links",
        ),
        (
            "The same bits without the first angle",
            "gravity 0, against the recursion that looks at it, 5000 steps, all methods, 2 and 3 links",
        ),
    ];
    for ((proof, how), same_bits) in proofs.into_iter().zip(same_bits) {
        table.rows.push(vec![
            Cell::new(proof),
            Cell::new(how),
            Cell::default(),
            Cell::default(),
            if same_bits {
                Cell::new("same bits").class("good")
            } else {
                Cell::new("bits differ").class("bad")
            },
        ]);
    }
    table
}

fn particle_row(counts: &Counts) -> Vec<Cell> {
    let cell = |name| {
        counts.get(name).map_or_else(unmeasured, |count| {
            Cell::new(format!("{} instructions", number(count.round())))
                .detail("of the arm's code, a step")
        })
    };
    vec![
        Cell::new("Mass matrix in the 1-DOF service"),
        Cell::new("math::particle knows no arm: none of the arm's functions runs"),
        cell("arm-in-step-2-rk4-free"),
        cell("arm-in-particle-rk4-constant"),
        percent_saved(
            counts.get("arm-in-step-2-rk4-free").copied(),
            counts.get("arm-in-particle-rk4-constant").copied(),
        ),
    ]
}

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
