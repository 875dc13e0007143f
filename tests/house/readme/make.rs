//! The Makefile: its targets, its help, and `make run` where there is no cargo.

use std::collections::BTreeSet;
use std::fs;
use std::process::Command;

use super::{codes, printed};
#[cfg(unix)]
use crate::folder::Folder;
use crate::papers::{table, text};
use crate::tree::{files_in, root, rust_files};

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

/// `cargo test` passes without a test if its filter matches none.
#[test]
fn every_filter_of_a_test_in_the_documents_names_a_module() {
    let mut filters = 0;
    for paper in files_in("docs", &["md"]) {
        let paper = fs::read_to_string(paper).unwrap();
        for command in codes(&paper) {
            let Some((_, command)) = command.split_once("cargo test --test ") else {
                continue;
            };
            let (program, named) = command.split_once(" -- ").unwrap_or((command, ""));
            let folder = format!("tests/{program}");
            let modules: Vec<String> = rust_files(&folder)
                .iter()
                .map(|file| {
                    file.strip_prefix(root().join(&folder))
                        .unwrap()
                        .with_extension("")
                })
                .map(|module| {
                    module
                        .to_str()
                        .unwrap()
                        .replace("/mod", "")
                        .replace('/', "::")
                        + "::"
                })
                .collect();
            for filter in named.split(' ').filter(|filter| filter.ends_with("::")) {
                filters += 1;
                let is_there = modules.iter().any(|module| module.contains(filter));
                assert!(is_there, "{command}: no module {filter}");
            }
        }
    }
    assert!(filters > 10, "{filters} filters");
}

/// A target that CI does not run can break unnoticed. Functions without a call do not count.
#[test]
fn ci_runs_every_target() {
    let makefile = text("Makefile");
    let script: String = text(".ci/run")
        .lines()
        .filter(|line| !line.trim_start().starts_with('#'))
        .flat_map(|line| [line, "\n"])
        .collect();
    let words = |part: &str| -> BTreeSet<String> {
        let split = part.split(|c: char| !(c.is_alphanumeric() || "_-".contains(c)));
        split.map(str::to_owned).collect()
    };
    // Functions by name; a body ends with a brace alone.
    let mut bodies = std::collections::BTreeMap::new();
    let mut reached = String::new();
    let mut open: Option<&str> = None;
    for line in script.lines() {
        if let Some(name) = line.strip_suffix("() {") {
            open = Some(name);
        } else if line == "}" {
            open = None;
        } else if let Some(name) = open {
            *bodies.entry(name).or_insert_with(String::new) += &format!("{line}\n");
        } else {
            reached += &format!("{line}\n");
        }
    }
    while let Some(name) = bodies
        .keys()
        .copied()
        .find(|&name| words(&reached).contains(name))
    {
        reached += &bodies.remove(name).unwrap();
    }
    let mut run: BTreeSet<&str> = BTreeSet::new();
    for line in reached.lines() {
        let mut given = line.split_whitespace().skip_while(|word| *word != "make");
        given.next();
        while let Some(word) = given.next() {
            match word {
                "-o" | "-C" => drop(given.next()),
                word => drop(run.insert(word)),
            }
        }
    }
    // Prerequisites are run with their target.
    let rules: Vec<(&str, &str)> = makefile
        .lines()
        .filter(|line| line.contains("## ") && !line.starts_with(['\t', '#']))
        .filter_map(|line| line.split_once(": "))
        .collect();
    for _ in &rules {
        for (target, rule) in &rules {
            if run.contains(target) {
                let needs = rule.split("##").next().unwrap_or_default();
                run.extend(needs.split([' ', ',', ')']).filter(|word| !word.is_empty()));
            }
        }
    }
    let forgotten: Vec<&str> = rules
        .iter()
        .map(|(target, _)| *target)
        .filter(|target| !run.contains(target))
        .collect();
    assert!(rules.len() > 30 && forgotten.is_empty(), "{forgotten:?}");
}

#[test]
fn make_alone_shows_the_help() {
    let make = |arguments: &[&str]| {
        // Under `make test` the outer make passes its own flags.
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

/// This is the state of an unpacked release on a machine without a toolchain.
#[cfg(unix)]
#[test]
fn make_run_runs_a_program_that_is_there_where_there_is_no_cargo() {
    use std::os::unix::fs::symlink;
    let target = Folder::new("make-run");
    fs::create_dir(target.join("release")).unwrap();
    let run = || {
        Command::new("make")
            .args(["run", "CARGO=/nowhere/cargo", "ARGS=--version"])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .env("CARGO_TARGET_DIR", &*target)
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
