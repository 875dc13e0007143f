//! The papers of the house say what is so: the README's tables against the Makefile, the manifest and the catalog.
//!
//! **Invariant:** each check reads both sides, so that neither can change alone.

#![allow(
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a helper of a test fails by panicking, as a test does"
)]

mod papers;

use std::collections::BTreeSet;
use std::process::Command;

use papers::{table, text};
use pendularm::protocol::catalog::{Field, Rosapi, Service, Topic};

/// What stands between the code marks of a cell, in order.
fn codes(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).collect()
}

#[test]
fn the_readme_lists_the_targets_that_make_help_lists() {
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
    let readme: BTreeSet<String> = table(&text("README.md"), "target")
        .iter()
        .map(|row| codes(&row[0])[0].to_owned())
        .collect();
    assert_eq!(readme, documented);
}

#[test]
fn make_alone_shows_the_help() {
    let make = |arguments: &[&str]| {
        let output = Command::new("make")
            .args(arguments)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            // Under `make test` the outer make hands its own flags down.
            .env_remove("MAKEFLAGS")
            .env_remove("MAKELEVEL")
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8(output.stdout).unwrap()
    };
    let help = make(&[]);
    assert_eq!(help, make(&["help"]));
    for row in table(&text("README.md"), "target") {
        assert!(
            help.contains(codes(&row[0])[0]),
            "{row:?} is not in\n{help}"
        );
    }
}

#[test]
fn the_readme_has_a_reason_for_every_dependency() {
    let manifest = text("Cargo.toml");
    let mut section = "";
    let mut dependencies = BTreeSet::new();
    for line in manifest.lines() {
        if line.starts_with('[') {
            section = line;
        } else if section.ends_with("dependencies]")
            && let Some((name, _)) = line.split_once(" =")
        {
            dependencies.insert(name.to_owned());
        }
    }
    let mut named = BTreeSet::new();
    for row in table(&text("README.md"), "crate") {
        assert!(row[1].len() > 10, "no reason: {row:?}");
        named.insert(codes(&row[0])[0].to_owned());
    }
    assert_eq!(named, dependencies);
}

#[test]
fn the_readme_lists_every_topic_with_its_type_and_owner() {
    let rows = table(&text("README.md"), "topic");
    assert_eq!(rows.len(), Topic::ALL.len());
    for (row, topic) in rows.iter().zip(Topic::ALL) {
        assert_eq!(codes(&row[0]), [topic.name()]);
        assert_eq!(codes(&row[1]), [topic.type_name()], "{}", topic.name());
        let anybody = row[2].starts_with("anybody");
        assert!(
            anybody || codes(&row[2]) == [topic.owner().name()],
            "{}",
            topic.name()
        );
    }
}

#[test]
fn the_readme_lists_every_service_with_its_fields_in_order() {
    let rows = table(&text("README.md"), "service");
    let listed: BTreeSet<&str> = rows.iter().flat_map(|row| codes(&row[0])).collect();
    let served: BTreeSet<&str> = Service::ALL.iter().map(|service| service.name()).collect();
    assert_eq!(listed, served);
    for row in &rows {
        let service = Service::from_name(codes(&row[0])[0]).unwrap();
        let expected: Vec<(&str, bool)> = service
            .fields()
            .iter()
            .map(|field| (field.name, field.required))
            .collect();
        let written: Vec<(&str, bool)> = codes(&row[1])
            .into_iter()
            .map(|name| (name, !row[1].contains(&format!("*`{name}`*"))))
            .collect();
        assert_eq!(written, expected, "{}", service.name());
    }
}

#[cfg(feature = "web")]
#[test]
fn the_readme_lists_every_question_of_rosapi_with_its_fields_in_order() {
    let rows = table(&text("README.md"), "rosapi");
    assert_eq!(rows.len(), Rosapi::ALL.len());
    for (row, question) in rows.iter().zip(Rosapi::ALL) {
        let service = Service::Rosapi(question);
        assert_eq!(codes(&row[0]), [question.short_name()]);
        let names = |fields: &[Field]| -> Vec<&str> { fields.iter().map(|one| one.name).collect() };
        assert_eq!(codes(&row[1]), names(service.fields()), "{question:?}");
        let values = names(service.response_fields());
        assert_eq!(codes(&row[2]), values, "{question:?}");
    }
}

#[test]
fn every_option_of_the_help_is_in_the_readme_with_its_variable() {
    let help = Command::new(env!("CARGO_BIN_EXE_pendularm"))
        .arg("--help")
        .output()
        .unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let rows = table(&text("README.md"), "option");
    for row in &rows {
        let (option, variable) = (codes(&row[0])[0], codes(&row[1])[0]);
        let line = help.lines().find(|line| {
            line.contains(&format!("{option} <")) || line.contains(&format!("{option}[=<"))
        });
        let line = line.unwrap_or_else(|| panic!("{option} is not in the help"));
        assert!(line.contains(&format!("[env: {variable}]")), "{line}");
    }
    assert_eq!(help.matches("[env: ").count(), rows.len());
}

#[test]
fn the_licence_files_are_those_that_the_manifest_names() {
    assert!(text("Cargo.toml").contains("license = \"MIT OR Apache-2.0\""));
    assert!(text("LICENSE-MIT").contains("Permission is hereby granted, free of charge"));
    assert!(text("LICENSE-APACHE").contains("Apache License"));
}

/// `rust-version` is a promise to whoever has an older compiler than ours: no package may break it.
#[test]
fn no_dependency_asks_for_a_newer_compiler_than_we_do() {
    let run = |command: &mut Command| {
        let output = command
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8(output.stdout).unwrap()
    };
    // Only packages for this platform are sure to be at hand after a build.
    let compiler = run(Command::new("rustc").arg("-vV"));
    let host = compiler
        .lines()
        .find_map(|line| line.strip_prefix("host: "))
        .unwrap();
    let metadata = run(Command::new(env!("CARGO"))
        .args(["metadata", "--locked", "--offline", "--format-version", "1"])
        .args(["--filter-platform", host]));
    let metadata: serde_json::Value = serde_json::from_str(&metadata).unwrap();
    let version = |text: &str| -> Vec<u32> {
        text.split('.')
            .map(|part| part.parse().unwrap())
            .chain([0])
            .take(3)
            .collect()
    };
    let ours = version(env!("CARGO_PKG_RUST_VERSION"));
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 10, "{} packages", packages.len());
    for package in packages {
        if let Some(theirs) = package["rust_version"].as_str() {
            assert!(
                version(theirs) <= ours,
                "{} asks for Rust {theirs}",
                package["name"]
            );
        }
    }
}
