//! Work that a scene does not need, and the check that it is left out.
//!
//! Instructions, allocations and the server's own work are counted by `scripts/measure-work.sh`, which writes them to
//! `work.csv` next to the page. Without that file the counts of the kept report are shown. A missing count is shown as
//! not measured.
//!
//! **Invariant:** every number was counted, with the version in the caption.

use std::collections::HashMap;

use crate::report::section::{Cell, Section, Table};
use crate::report::svg::number;

/// The counts of the kept report. The first line has the version and the processor.
const KEPT: &str = include_str!("../../../docs/report/work.csv");

/// Counts by their names in `scripts/measure-work.sh`.
struct Measured {
    counts: HashMap<String, f64>,
    /// The version and the processor.
    with: String,
}

pub(super) fn make(section: &mut Section) {
    let new = std::fs::read_to_string(section.out.join("work.csv"));
    let text = new.unwrap_or_else(|_| KEPT.to_owned());
    let counts = text.lines().filter_map(|line| {
        let (name, rest) = line.split_once(',')?;
        Some((name.to_owned(), rest.split(',').next()?.parse().ok()?))
    });
    let with = text.lines().find_map(|line| line.strip_prefix("# "));
    let measured = Measured {
        counts: counts.collect(),
        with: with.unwrap_or_default().to_owned(),
    };
    section.table(&measured.table());
    measured.findings(section);
    measured.verdicts(section);
}

/// The work that is left out, one line per item. The columns: the work, the place in the source, the counts with and
/// without it, and whether the difference is a saving. A count may have a detail after a colon.
const LEFT_OUT: &str = include_str!("left_out.txt");

fn columns(line: &'static str) -> Vec<&'static str> {
    line.split('|').map(str::trim).collect()
}

/// The factor and the unit in which a count is shown.
fn unit(name: &str) -> (f64, &'static str) {
    const RATE: &str = "million instructions a second";
    match name {
        // Ten estimates per second.
        "estimate-2-rk4" => (1e-5, RATE),
        "program-size" | "program-size-bare" => (1e-6, "MB"),
        _ if name.ends_with("-encoded") => (1.0, "messages encoded a second"),
        _ if name.starts_with("server-") => (1e-6, RATE),
        _ if name.starts_with("wakes-") => (1.0, "wake-ups a second"),
        _ if name.starts_with("allocations-") => (1.0, "allocations"),
        _ => (1.0, "instructions"),
    }
}

/// Claims about counts, one per line: the claim, the count's name and unit, and a bound. For a whole number, a bound of
/// one half means none.
const BELOW: &str = include_str!("below.txt");

impl Measured {
    fn count(&self, name: &str) -> Option<f64> {
        self.counts.get(name).copied()
    }

    /// The cell of a count and its detail.
    fn cell(&self, told: &str) -> Cell {
        let (name, detail) = told.split_once(": ").unwrap_or((told, ""));
        if name.is_empty() {
            return Cell::default();
        }
        let Some(count) = self.count(name) else {
            return Cell::new("not measured").class("soft");
        };
        let (factor, unit) = unit(name);
        let whole = unit == "instructions";
        let count = if whole { count.round() } else { count };
        Cell::new(format!("{} {unit}", number(factor * count))).detail(detail)
    }

    fn table(&self) -> Table {
        let mut lines = LEFT_OUT.lines().map(columns);
        let mut table = Table::new(
            "left-out",
            "Work that is left out, and its measured cost",
            format!(
                "Instructions are counted by callgrind, with {}, over the same number of steps on both sides, without \
                 the start of the program. The server: 2 links, RK4 at 1 ms, controller off, 4 s of real time; \
                 subscribers of /joint_states over TCP.",
                self.with
            ),
            lines.next().into_iter().flatten(),
        );
        let count = |told: &str| self.count(told.split(": ").next()?);
        for line in lines {
            let [work, place, with, without, saved] = line[..] else {
                continue;
            };
            let both = count(with).zip(count(without)).filter(|_| saved == "yes");
            let saved = both.map(|(with, without)| (100.0 * (1.0 - without / with)).round());
            let saved = saved.map(|percent| Cell::new(format!("{} %", number(percent))));
            table.rows.push(vec![
                Cell::new(work),
                Cell::new(place),
                self.cell(with),
                self.cell(without),
                saved.unwrap_or_default(),
            ]);
        }
        table
    }

    /// Messages encoded per second, and the instructions per message.
    fn encoded(&self, server: &str) -> Option<(f64, f64)> {
        let messages = self.count(&format!("{server}-encoded"))?;
        let json = self.count(&format!("{server}-json"))?;
        Some((messages, (json / messages.max(1.0)).round()))
    }

    fn findings(&self, section: &mut Section) {
        if let (Some(none), Some(one), Some(eleven)) = (
            self.encoded("server-running"),
            self.encoded("server-1-subscriber"),
            self.encoded("server-11-subscribers"),
        ) {
            section.findings.push(format!(
                "**Without a subscriber the server encodes {} messages a second**. With one it encodes {}, with {} \
                 instructions for each. With eleven it encodes {}, with {} for each.",
                number(none.0),
                number(one.0),
                number(one.1),
                number(eleven.0),
                number(eleven.1)
            ));
        }
        let [off, on] = ["step-2-rk4-free", "step-2-rk4-pid"].map(|name| self.count(name));
        if let (Some(off), Some(on)) = (off, on) {
            section.findings.push(format!(
                "**The control law is a small part of a step**. A 2-link RK4 step takes {} instructions with it, and {} \
                 without it.",
                number(on.round()),
                number(off.round())
            ));
        }
    }

    fn verdicts(&self, section: &mut Section) {
        for line in BELOW.lines() {
            if let [claim, name, unit, bound] = columns(line)[..]
                && let (Some(count), Ok(bound)) = (self.count(name), bound.parse::<f64>())
            {
                section.claim(claim, format!("{} {unit}", number(count)), count < bound);
            }
        }
        let each = ["server-1-subscriber", "server-11-subscribers"].map(|name| self.encoded(name));
        if let [Some((_, one)), Some((_, eleven))] = each {
            section.claim(
                "A message is encoded once, for eleven subscribers as for one (within 1 %)",
                format!(
                    "{} and {} instructions of JSON a message",
                    number(eleven),
                    number(one)
                ),
                (eleven / one - 1.0).abs() <= 0.01,
            );
        }
        let rates = ["server-running", "server-paused"].map(|name| self.count(name));
        if let [Some(running), Some(paused)] = rates {
            section.claim(
                "A paused server executes less than half the instructions of a running one",
                format!(
                    "{} against {} million a second",
                    number(paused / 1e6),
                    number(running / 1e6)
                ),
                paused < 0.5 * running,
            );
        }
    }
}
