//! The documents agree with the sources: the tables of README and docs/ against the Makefile, the manifest and the
//! catalog. This file checks README itself.
//!
//! **Invariant:** each check reads both sides, so that neither can change alone.

mod architecture;
mod make;
mod manifest;
mod page;
mod protocol;
mod report;

use std::process::Command;

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
fn the_readme_is_read_in_one_sitting() {
    let length = text("README.md").len();
    assert!(length <= 7_000, "README.md has {length} bytes");
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
