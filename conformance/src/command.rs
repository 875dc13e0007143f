//! A whole run as a command: the server is started if necessary, the results are shown and written to files.

use std::path::{Path, PathBuf};

use crate::launch::{self, Launch, Started};
use crate::points::Points;
use crate::{Results, Row, Rule, Selection, export, report, rules, run};

/// An order for a run.
#[derive(Debug, Clone, Default)]
pub struct Order {
    /// The server's address.
    pub address: String,
    /// The selected rules and the limits.
    pub selection: Selection,
    /// A command that starts the server.
    pub start: Option<String>,
    /// Files for the results.
    pub files: Files,
    /// What the rules are worth, if that is given.
    pub points: Option<Points>,
}

/// Files for the results.
#[derive(Debug, Clone, Default)]
pub struct Files {
    /// As JSON.
    pub json: Option<PathBuf>,
    /// As JUnit's XML.
    pub junit: Option<PathBuf>,
    /// As one page.
    pub html: Option<PathBuf>,
}

/// Conducts a run. `say` gets the lines for standard output, `progress` those for a terminal. Returns the results.
///
/// # Errors
/// If there is no server at the address, or if no rule is selected: no rule was tried then. If a file cannot be written.
pub fn conduct(order: &Order, say: &mut dyn FnMut(&str), progress: &mut dyn FnMut(&str)) -> Result<Results, String> {
    if list(&order.selection).is_empty() {
        return Err("no rule is left by --category, --rule and --strict-specification; --list lists all".to_owned());
    }
    let launch = order.start.as_ref().map(|command| Launch {
        command: command.clone(),
        address: order.address.clone(),
        ending: order.selection.ending.clone(),
    });
    let links = order.selection.links.map(|links| links.to_string());
    let started: Option<Started> = launch.as_ref().map(|launch| launch.start(links.as_deref())).transpose()?;
    let mut tried = 0;
    let mut tell = |row: &Row, all: usize| {
        tried += 1;
        progress("");
        if row.holds() || row.is_aside {
            say(&report::line(row));
        }
        progress(&format!("{tried} of {all} rules"));
    };
    let results = run(&order.address, &order.selection, &mut tell);
    progress("");
    let mut results = results?;
    if let (Some(launch), Some(started)) = (&launch, started) {
        if let Err(why) = started.stop() {
            results.notes.push(format!("the started server had to be ended by force: {why}"));
        }
        for row in launch.rows(|rule| order.selection.includes(rule)) {
            if row.holds() {
                say(&report::line(&row));
            }
            results.rows.push(row);
        }
    }
    results.points.clone_from(&order.points);
    say(&report::summary(&results));
    order.files.write(&results)?;
    Ok(results)
}

impl Files {
    fn write(&self, results: &Results) -> Result<(), String> {
        let write = |path: &Option<PathBuf>, text: &dyn Fn() -> String| {
            let Some(path): Option<&Path> = path.as_deref() else { return Ok(()) };
            std::fs::write(path, text()).map_err(|error| format!("{}: {error}", path.display()))
        };
        write(&self.json, &|| format!("{:#}\n", export::json(results)))?;
        write(&self.junit, &|| export::junit(results))?;
        write(&self.html, &|| export::html(results))
    }
}

/// The selected rules, for any number of links if none is selected. Those about the start are last.
#[must_use]
pub fn list(selection: &Selection) -> Vec<Rule> {
    let all = rules::all().chain(launch::RULES);
    all.filter(|rule| selection.links.is_none_or(|links| rule.applies_to(links)) && selection.includes(rule)).collect()
}
