//! `pendularm conformance`: the specification's rules against any server.
//!
//! The rules are in the package `pendularm-conformance`, which shares no code with the runtime.
//!
//! **Invariant:** the tested server gets its settings back, also after a signal.

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use clap::Args;
use pendularm_conformance::Selection;
use pendularm_conformance::command::{Files, Order, conduct, list};
use pendularm_conformance::points::Points;

use crate::output::{self, print_error};
use crate::signals;
use crate::value::{ValueReader, needed, one_of};

/// Exit status if a rule does not hold, or if the run was disturbed.
const FAILED: u8 = 1;
/// Exit status if no rule was tried: no rosbridge server, or bad usage.
const NOT_TRIED: u8 = 2;

/// Any number of links.
const ANY: usize = 0;

/// Test any server of the protocol against the rules of the specification
#[derive(Debug, Clone, PartialEq, Args)]
#[command(after_help = "\
Examples:
  pendularm conformance 127.0.0.1:9095
  pendularm conformance --start 'make run' --junit report.xml --html report.html
  pendularm conformance --rule method-4

A run resets the arm and ends its goals. Afterwards the server has the settings that it had before.
Exit status: 0 if every rule holds, 1 if one does not, 2 without a server that speaks rosbridge.")]
pub struct ConformanceOptions {
    /// Where the server listens
    #[arg(value_name = "ADDRESS", default_value = "127.0.0.1:9095")]
    address: String,
    /// List the rules, and try none
    #[arg(long)]
    list: bool,
    /// Only a category whose name contains this text
    #[arg(long, value_name = "TEXT")]
    category: Option<String>,
    /// Only this rule, such as method-4, or the rules of a section, such as reset
    #[arg(long, value_name = "ID")]
    rule: Option<String>,
    /// Leave out rules that rest on common sense alone
    #[arg(long)]
    strict_specification: bool,
    /// Number of links that the server must have: 2, 3 or auto
    #[arg(long, value_name = "N", default_value = "auto")]
    #[arg(value_parser = ValueReader(|text| one_of(&[("2", 2), ("3", 3), ("auto", ANY)], text)))]
    links: usize,
    /// Longest wait for an answer, in s
    #[arg(long, value_name = "SECONDS", default_value = "3")]
    #[arg(value_parser = ValueReader(read_timeout))]
    timeout: Duration,
    /// File for the results as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// File for the results as XML for a CI
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// File for the results as one page
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// File with the points of rules, sections or categories, such as `method-4 = 5`
    #[arg(long, value_name = "FILE")]
    points: Option<PathBuf>,
    /// Command of the shell that starts the server; it is stopped afterwards, and its start and end are tested too
    #[arg(long, value_name = "COMMAND")]
    start: Option<String>,
}

fn read_timeout(text: &str) -> Result<Duration, String> {
    let seconds = text
        .parse()
        .ok()
        .filter(|seconds| (0.1..=60.0).contains(seconds));
    needed(
        seconds.map(Duration::from_secs_f64),
        "a time in seconds from 0.1 to 60",
        text,
    )
}

/// Reads a file of points.
fn read_points(path: &Path) -> Result<Points, String> {
    let text = std::fs::read_to_string(path).map_err(|error| error.to_string());
    let points = text.and_then(|text| Points::read(&text));
    points.map_err(|why| format!("{}: {why}", path.display()))
}

/// Tries the rules, prints the results, and returns the exit status.
#[must_use]
pub fn run(options: &ConformanceOptions) -> u8 {
    let ending = Arc::new(AtomicBool::new(false));
    let selection = Selection {
        patience: options.timeout,
        category: options.category.clone(),
        rule: options.rule.clone(),
        is_strict: options.strict_specification,
        links: Some(options.links).filter(|links| *links != ANY),
        ending: Arc::clone(&ending),
        ..Selection::default()
    };
    // A reader may close the pipe early. The run goes on, because it restores the server.
    let mut say = |text: &str| drop(output::print(text));
    if options.list {
        for rule in list(&selection) {
            say(&format!(
                "{:<17} {:<30} {}\n",
                rule.id, rule.category, rule.says
            ));
        }
        return 0;
    }
    let points = options.points.as_deref().map(read_points).transpose();
    let points = match points {
        Ok(points) => points,
        Err(why) => {
            print_error(&why);
            return NOT_TRIED;
        }
    };
    if let Err(error) = signals::at_request(move || ending.store(true, Ordering::Relaxed)) {
        print_error(&error);
        return FAILED;
    }
    let files = Files {
        json: options.json.clone(),
        junit: options.junit.clone(),
        html: options.html.clone(),
    };
    let (address, start) = (options.address.clone(), options.start.clone());
    let order = Order {
        address,
        selection,
        start,
        files,
        points,
    };
    match conduct(&order, &mut say, &mut progress) {
        Ok(results) => u8::from(!results.is_good()) * FAILED,
        Err(why) => {
            print_error(&why);
            NOT_TRIED
        }
    }
}

/// Replaces the line of progress on a terminal.
fn progress(text: &str) {
    let mut terminal = std::io::stderr();
    if terminal.is_terminal() {
        let _ = write!(terminal, "\r\x1b[K{text}");
        let _ = terminal.flush();
    }
}
