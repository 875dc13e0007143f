//! The documents agree with the sources: the tables of README and docs/ against the Makefile, the manifest and the
//! catalog. This file has the options, the page's methods and the kept report.
//!
//! **Invariant:** each check reads both sides, so that neither can change alone.

mod architecture;
mod make;
mod manifest;
mod protocol;

use std::process::Command;

use pendularm::math::integrator::Method;
use serde_json::Value;

use crate::papers::{table, text};

/// The texts between the code marks of a cell, in order.
fn codes(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).collect()
}

/// The standard output of a command that is started in the project's folder and succeeds.
fn printed(command: &mut Command) -> String {
    let output = command
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn the_papers_list_every_option_of_the_help_with_its_variable_and_default() {
    let help = printed(Command::new(env!("CARGO_BIN_EXE_pendularm")).arg("--help"));
    let rows = table(&text("docs/command-line.md"), "option");
    for row in &rows {
        let (option, variable) = (codes(&row[0])[0], codes(&row[1])[0]);
        let line = help.lines().find(|line| {
            line.contains(&format!("{option} <")) || line.contains(&format!("{option}[=<"))
        });
        let line = line.unwrap_or_else(|| panic!("{option} is not in the help"));
        let mut expected = format!("[env: {variable}]");
        if let Some(default) = codes(&row[2]).first() {
            expected += &format!(" [default: {default}]");
        }
        assert!(line.ends_with(&expected), "{line}");
    }
    assert_eq!(help.matches("[env: ").count(), rows.len());
}

/// Each method with its order, if it is a Runge-Kutta method with as many evaluations.
#[test]
fn the_page_has_every_method_in_its_order() {
    let script = text("page/format.js");
    let mut lines = script.lines();
    let line = lines.find_map(|line| line.strip_prefix("export const METHODS = "));
    let line = line.unwrap().trim_end_matches(';');
    let rows: Vec<Vec<Value>> = serde_json::from_str(line).unwrap();
    let order = |row: &[Value]| row.get(2).map(|order| order.as_u64().unwrap());
    let rows = rows.iter();
    let named: Vec<_> = rows
        .map(|row| (row[0].as_str().unwrap(), order(row)))
        .collect();
    let expected = Method::ALL.map(|method| {
        let order = (method != Method::Verlet).then(|| u64::from(method.order()));
        (method.name(), order)
    });
    assert_eq!(named, expected);
}

#[test]
fn the_papers_agree_with_the_kept_report() {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/scripts/keep-report.py");
    let check = Command::new("python3").args([script, "--check"]).output();
    let Ok(check) = check else {
        assert!(std::env::var_os("CI").is_none(), "python3 is missing");
        return;
    };
    let said = String::from_utf8_lossy(&check.stderr);
    assert!(check.status.success(), "{said}");
}
