//! The Makefile: its targets, its help, and `make run` where there is no cargo.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

use super::{codes, printed};
#[cfg(unix)]
use crate::folder::Folder;
use crate::papers::{table, text};
use crate::tree::{files_in, root, rust_files};

/// The targets with their help, and the prerequisites before it.
fn rules(makefile: &str) -> impl Iterator<Item = (&str, &str)> {
    let is_rule = |line: &&str| line.contains("## ") && !line.starts_with(['\t', '#']);
    let lines = makefile.lines().filter(is_rule);
    lines.filter_map(|line| line.split_once(':'))
}

#[test]
fn the_papers_list_the_targets_that_make_help_lists() {
    let makefile = text("Makefile");
    let documented: BTreeSet<&str> = rules(&makefile).map(|(target, _)| target).collect();
    let mut lines = makefile.lines();
    let phony = lines.find_map(|line| line.strip_prefix(".PHONY: "));
    let phony: BTreeSet<&str> = phony.unwrap().split(' ').collect();
    assert_eq!(documented, phony, "a target without help, or not phony");
    let rows = table(&text("docs/development.md"), "target");
    let readme = rows.iter().map(|row| codes(&row[0])[0]);
    let readme: BTreeSet<&str> = readme
        .filter_map(|code| code.strip_prefix("make "))
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
            let module = |file: &PathBuf| {
                let file = file.strip_prefix(root().join(&folder)).unwrap();
                let module = file.with_extension("").to_str().unwrap().to_owned();
                module.replace("/mod", "").replace('/', "::") + "::"
            };
            let modules: Vec<String> = rust_files(&folder).iter().map(module).collect();
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
    let script = text(".ci/run");
    let words = |part: &str| -> BTreeSet<String> {
        let split = part.split(|c: char| !(c.is_alphanumeric() || "_-".contains(c)));
        split.map(str::to_owned).collect()
    };
    // Functions by name; a body ends with a brace alone.
    let mut bodies = std::collections::BTreeMap::new();
    let mut reached = String::new();
    let mut open: Option<&str> = None;
    let is_code = |line: &&str| !line.trim_start().starts_with('#');
    for line in script.lines().filter(is_code) {
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
    let rules: Vec<(&str, &str)> = rules(&makefile).collect();
    for _ in &rules {
        for (target, rule) in &rules {
            if run.contains(target) {
                let needs = rule.split("##").next().unwrap_or_default();
                run.extend(needs.split([' ', ',', ')']).filter(|word| !word.is_empty()));
            }
        }
    }
    let mut forgotten: Vec<&str> = rules.iter().map(|(target, _)| *target).collect();
    forgotten.retain(|target| !run.contains(target));
    assert!(rules.len() > 30 && forgotten.is_empty(), "{forgotten:?}");
}

/// Under `make test` the outer make passes its own flags.
fn make(arguments: &[&str]) -> Command {
    let mut command = Command::new("make");
    command.args(arguments).current_dir(root());
    command.env_remove("MAKEFLAGS").env_remove("MAKELEVEL");
    command
}

#[test]
fn make_alone_shows_the_help() {
    let help = printed(&mut make(&[]));
    assert_eq!(help, printed(&mut make(&["help"])));
    for row in table(&text("docs/development.md"), "target") {
        let target = codes(&row[0])[0];
        assert!(help.contains(target), "{target} is not in\n{help}");
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
        let mut command = make(&["run", "CARGO=/nowhere/cargo", "ARGS=--version"]);
        command.env("CARGO_TARGET_DIR", &*target).output().unwrap()
    };
    let without = run();
    assert!(!without.status.success());
    let why = String::from_utf8_lossy(&without.stderr);
    let needs = "needs cargo, or a program that is built already";
    assert!(why.contains(needs), "{why}");
    let program = target.join("release/pendularm");
    symlink(env!("CARGO_BIN_EXE_pendularm"), program).unwrap();
    let with = run();
    let said = String::from_utf8_lossy(&with.stdout);
    let runs = with.status.success() && said.contains("\npendularm ");
    assert!(runs, "{said}");
}
