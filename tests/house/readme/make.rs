//! The Makefile: its targets, its help, and `make run` where there is no cargo.

use std::collections::BTreeSet;
#[cfg(unix)]
use std::fs;
#[cfg(unix)]
use std::path::Path;
use std::process::Command;

use super::{codes, printed};
use crate::papers::{table, text};

#[test]
fn the_papers_list_the_targets_that_make_help_lists() {
    let makefile = text("Makefile");
    let documented: BTreeSet<String> = makefile
        .lines()
        .filter(|line| line.contains(":") && line.contains("## ") && !line.starts_with(['\t', '#']))
        .filter_map(|line| line.split_once(':'))
        .map(|(target, _)| format!("make {target}"))
        .collect();
    let phony = makefile
        .lines()
        .find_map(|line| line.strip_prefix(".PHONY: "))
        .unwrap();
    let phony: BTreeSet<String> = phony
        .split(' ')
        .map(|target| format!("make {target}"))
        .collect();
    assert_eq!(documented, phony, "a target without help, or not phony");
    let readme: BTreeSet<String> = table(&text("docs/development.md"), "target")
        .iter()
        .map(|row| codes(&row[0])[0].to_owned())
        .collect();
    assert_eq!(readme, documented);
}

#[test]
fn make_alone_shows_the_help() {
    let make = |arguments: &[&str]| {
        // Under `make test` the outer make hands its own flags down.
        let mut command = Command::new("make");
        printed(
            command
                .args(arguments)
                .env_remove("MAKEFLAGS")
                .env_remove("MAKELEVEL"),
        )
    };
    let help = make(&[]);
    assert_eq!(help, make(&["help"]));
    for row in table(&text("docs/development.md"), "target") {
        assert!(
            help.contains(codes(&row[0])[0]),
            "{row:?} is not in\n{help}"
        );
    }
}

/// As after unpacking a release on a machine without a toolchain.
#[cfg(unix)]
#[test]
fn make_run_runs_a_program_that_is_there_where_there_is_no_cargo() {
    use std::os::unix::fs::symlink;
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).join("make-run");
    let _ = fs::remove_dir_all(&target);
    fs::create_dir_all(target.join("release")).unwrap();
    let run = || {
        Command::new("make")
            .args(["run", "CARGO=/nowhere/cargo", "ARGS=--version"])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .env("CARGO_TARGET_DIR", &target)
            .env_remove("MAKEFLAGS")
            .env_remove("MAKELEVEL")
            .output()
            .unwrap()
    };
    let without = run();
    assert!(!without.status.success());
    let why = String::from_utf8_lossy(&without.stderr);
    assert!(
        why.contains("needs cargo, or a program that is built already"),
        "{why}"
    );
    symlink(
        env!("CARGO_BIN_EXE_pendularm"),
        target.join("release/pendularm"),
    )
    .unwrap();
    let with = run();
    let said = String::from_utf8_lossy(&with.stdout);
    assert!(
        with.status.success() && said.contains("\npendularm "),
        "{said}"
    );
}
