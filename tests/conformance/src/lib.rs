//! The specification's own tests: black box, over TCP, against any server of the protocol.
//!
//! A rule is a sentence of the specification, the expected outcome, and a function that checks it. `rules/rules.txt` has
//! the sentences, and the files in `rules/` have the functions. All follow the sections of the specification. Reference values come from formulas in this crate (`arm.rs`,
//! `method.rs`), from closed forms and from conservation laws, never from a server.

pub mod arm;
pub mod bench;
pub mod method;
pub mod peer;
pub mod rules;
pub mod values;

use std::fmt;
use std::time::{Duration, Instant};

use bench::{Bench, Found};

/// The specification's categories of grading.
pub const CATEGORIES: [&str; 4] = ["Integrators", "PID control", "Dynamics and service contract", "Inverse kinematics"];

/// The outcome of a check: a description of the answer, as a success or as a failure.
pub type Got = Result<String, String>;

/// The id of a rule, and the function that checks it.
pub type Check = (&'static str, fn(&mut Bench) -> Got);

/// A rule of the specification.
#[derive(Debug, Clone, Copy)]
pub struct Rule {
    /// The section of the specification and a number in it.
    pub id: &'static str,
    /// The category that it counts for.
    pub category: &'static str,
    /// The number of links that it is for. `None`: any.
    pub links: Option<usize>,
    /// The rule in plain words.
    pub says: &'static str,
    /// The expected outcome.
    pub expected: &'static str,
    /// Checks it.
    pub check: fn(&mut Bench) -> Got,
}

impl Rule {
    /// Whether the rule is for an arm with this many links.
    #[must_use]
    pub fn applies_to(&self, links: usize) -> bool {
        self.links.is_none_or(|one| one == links)
    }
}

/// The result of a rule.
#[derive(Debug)]
pub struct Row {
    /// The rule.
    pub rule: Rule,
    /// The outcome.
    pub got: Got,
}

impl Row {
    /// Whether the rule holds.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.got.is_ok()
    }
}

impl fmt::Display for Row {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (mark, got) = match &self.got {
            Ok(got) => ("ok  ", got),
            Err(got) => ("FAIL", got),
        };
        write!(out, "{mark} {:<18} {} | expected: {} | got: {got}", self.rule.id, self.rule.says, self.rule.expected)
    }
}

/// Which rules to try, and for how long.
#[derive(Debug, Clone)]
pub struct Selection {
    /// The longest time of a whole run; rules that are not tried by then fail.
    pub time: Duration,
    /// A category whose name contains this text.
    pub category: Option<String>,
    /// Rules whose id starts with this text.
    pub rule: Option<String>,
}

impl Default for Selection {
    fn default() -> Self {
        Self { time: Duration::from_secs(180), category: None, rule: None }
    }
}

impl Selection {
    fn includes(&self, rule: &Rule) -> bool {
        let name = rule.category.to_lowercase();
        self.category.as_ref().is_none_or(|part| name.contains(&part.to_lowercase()))
            && self.rule.as_ref().is_none_or(|start| rule.id == start || rule.id.starts_with(&format!("{start}-")))
    }
}

/// Tries the selected rules one after another against the server at `address`, and reports each result as it
/// comes. Afterwards the server has the settings that it had before.
///
/// # Errors
/// If the server cannot be reached or does not say how many links it has.
pub fn run(address: &str, selection: &Selection, mut tell: impl FnMut(&Row)) -> Result<Vec<Row>, String> {
    let began = Instant::now();
    let found = Found::at(address)?;
    let mut rows = Vec::new();
    for rule in rules::all() {
        if !selection.includes(&rule) || !rule.applies_to(found.links) {
            continue;
        }
        let got = if began.elapsed() < selection.time {
            Bench::prepared(address, &found).map_err(|why| format!("while preparing: {why}")).and_then(|mut bench| (rule.check)(&mut bench))
        } else {
            Err(format!("not tried: the run had taken {} s; --rule {} tries it alone", selection.time.as_secs(), rule.id))
        };
        let row = Row { rule, got };
        tell(&row);
        rows.push(row);
    }
    found.restore(address);
    Ok(rows)
}

/// The totals, one line a category.
#[must_use]
pub fn totals(rows: &[Row]) -> String {
    let lines = CATEGORIES.into_iter().chain(["All"]).map(|name| {
        let here = rows.iter().filter(|row| row.rule.category == name || name == "All");
        let (holding, all) = here.fold((0, 0), |(holding, all), row| (holding + usize::from(row.holds()), all + 1));
        format!("{name:<30} {holding:>3} of {all:>3}")
    });
    lines.collect::<Vec<_>>().join("\n")
}
