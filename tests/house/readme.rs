//! The papers of the house say what is so: the tables of README and docs/ against the Makefile, the manifest and the catalog.
//!
//! **Invariant:** each check reads both sides, so that neither can change alone.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::process::Command;

use crate::papers::{table, text};
use crate::tree::rust_files;
use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::{Direction, Field, Playback, Rosapi, Service, Topic, types};
use pendularm::protocol::op;

/// The texts between the code marks of a cell, in order.
fn codes(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).collect()
}

#[test]
fn the_readme_is_read_in_one_sitting() {
    let length = text("README.md").len();
    assert!(length <= 10_000, "README.md has {length} bytes");
}

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

/// The lines of a manifest, each with the section that it stands in.
fn by_section(manifest: &str) -> impl Iterator<Item = (&str, &str)> {
    let mut section = "";
    manifest.lines().filter_map(move |line| {
        if line.starts_with('[') {
            section = line;
            return None;
        }
        Some((section, line))
    })
}

#[test]
fn the_papers_have_a_reason_for_every_dependency() {
    let manifest = text("Cargo.toml");
    let dependencies: BTreeSet<String> = by_section(&manifest)
        .filter(|(section, _)| section.ends_with("dependencies]"))
        .filter_map(|(_, line)| Some(line.split_once(" =")?.0.to_owned()))
        .collect();
    let mut named = BTreeSet::new();
    for row in table(&text("docs/development.md"), "crate") {
        assert!(row[1].len() > 10, "no reason: {row:?}");
        named.insert(codes(&row[0])[0].to_owned());
    }
    assert_eq!(named, dependencies);
}

#[test]
fn the_papers_list_every_topic_with_its_type_and_owner() {
    let rows = table(&text("docs/protocol.md"), "topic");
    assert_eq!(rows.len(), Topic::ALL.len());
    for (row, topic) in rows.iter().zip(Topic::ALL) {
        assert_eq!(codes(&row[0]), [topic.name()]);
        assert_eq!(codes(&row[1]), [topic.type_name()], "{}", topic.name());
        let (name, is_ours) = (topic.name(), topic.direction() == Direction::Published);
        assert_eq!(row[2].starts_with("anybody"), !is_ours, "{name}");
        assert!(
            !is_ours || codes(&row[2]) == [topic.owner().name()],
            "{name}"
        );
    }
}

#[test]
fn the_papers_list_every_op() {
    let rows = table(&text("docs/protocol.md"), "op");
    let listed: Vec<&str> = rows.iter().map(|row| codes(&row[0])[0]).collect();
    let (mut listed, mut known) = (listed, op::OPS.to_vec());
    listed.sort_unstable();
    known.sort_unstable();
    assert_eq!(listed, known);
}

#[test]
fn the_papers_list_the_fields_of_our_own_messages() {
    let rows = table(&text("docs/protocol.md"), "message");
    let ours = |name: &str| name.starts_with("pendularm_interfaces/msg/");
    let topics = Topic::ALL.into_iter().map(Topic::type_name);
    for name in topics.filter(|name| ours(name)) {
        assert!(rows.iter().any(|row| codes(&row[0]) == [name]), "{name}");
    }
    for row in &rows {
        let name = codes(&row[0])[0];
        let fields = types::find(name).expect(name).fields;
        let names: Vec<&str> = fields.iter().map(|field| field.name).collect();
        let written: Vec<&str> = codes(&row[1]);
        let written: Vec<&str> = written.into_iter().filter(|code| *code != "null").collect();
        assert_eq!(written, names, "{name}");
    }
}

#[test]
fn the_papers_list_every_service_with_its_fields_in_order() {
    let rows = table(&text("docs/protocol.md"), "service");
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
        // Explanations come behind a colon.
        let said = row[2].split(':').next().unwrap();
        let echoes = ["both", "all three", "the three"];
        let values: Vec<&str> = if echoes.iter().any(|all| said.starts_with(all)) {
            written.iter().map(|(name, _)| *name).collect()
        } else {
            codes(said)
        };
        let fields = service.response_fields().iter();
        let fields: Vec<&str> = fields.map(|field| field.name).collect();
        assert_eq!(values, fields, "{}", service.name());
        if service == Service::SetIntegrator {
            let methods = codes(&row[2])
                .into_iter()
                .filter_map(|name| name.parse().ok());
            assert_eq!(methods.collect::<Vec<Method>>(), Method::ALL);
        }
    }
}

/// Each beside its order, where it is a Runge-Kutta method with as many evaluations.
#[test]
fn the_page_has_every_method_in_its_order() {
    let script = text("page/format.js");
    let line = script
        .lines()
        .find_map(|line| line.strip_prefix("export const METHODS = "));
    let line = line.unwrap().trim_end_matches(';');
    let rows: Vec<Vec<serde_json::Value>> = serde_json::from_str(line).unwrap();
    let named: Vec<(&str, Option<u64>)> = rows
        .iter()
        .map(|row| {
            (
                row[0].as_str().unwrap(),
                row.get(2).map(|one| one.as_u64().unwrap()),
            )
        })
        .collect();
    let expected = Method::ALL.map(|method| {
        let is_runge_kutta = method != Method::Verlet;
        (
            method.name(),
            is_runge_kutta.then(|| u64::from(method.order())),
        )
    });
    assert_eq!(named, expected);
}

#[cfg(feature = "web")]
#[test]
fn the_papers_list_every_question_of_rosapi_with_its_fields_in_order() {
    let rows = table(&text("docs/protocol.md"), "rosapi");
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
fn the_papers_list_every_service_of_the_player_with_its_fields_in_order() {
    let rows = table(&text("docs/protocol.md"), "player");
    assert_eq!(rows.len(), Playback::ALL.len());
    for (row, one) in rows.iter().zip(Playback::ALL) {
        let service = Service::Playback(one);
        assert_eq!(codes(&row[0]), [one.short_name()]);
        let names = |fields: &[Field]| -> Vec<&str> { fields.iter().map(|one| one.name).collect() };
        assert_eq!(codes(&row[1]), names(service.fields()), "{one:?}");
        let values = names(service.response_fields());
        assert_eq!(codes(&row[2]), values, "{one:?}");
    }
}

/// The column of an arm of `N` links in the table of what it begins with.
fn defaults<const N: usize>() -> Vec<String>
where
    Gains<N>: Default,
{
    let gains = Gains::<N>::default();
    let simulation = Simulation::new(Arm::<N>::default(), gains);
    let arm = simulation.arm();
    let list = |values: &[f64]| {
        values
            .iter()
            .map(f64::to_string)
            .collect::<Vec<_>>()
            .join(", ")
    };
    let [masses, lengths] = [arm.masses(), arm.lengths()].map(|values| {
        assert!(values.iter().all(|value| *value == values[0]));
        values[0]
    });
    vec![
        list(&[arm.gravity(), masses, lengths]),
        format!("`{}`, {}", simulation.method(), simulation.timestep()),
        list(&gains.kp),
        list(&gains.ki),
        list(&gains.kd),
    ]
}

#[test]
fn the_papers_list_what_the_arm_begins_with() {
    let rows = table(&text("docs/protocol.md"), "default");
    let column = |k: usize| rows.iter().map(|row| row[k].clone()).collect::<Vec<_>>();
    assert_eq!(column(1), defaults::<2>());
    assert_eq!(column(2), defaults::<3>());
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

/// Where they are built otherwise, nothing that `make test` has built serves them, and CI builds all of it twice.
#[test]
fn the_fuzz_targets_are_built_as_the_tests_are() {
    let profile = |path: &str| -> BTreeSet<String> {
        by_section(&text(path))
            .filter(|(section, line)| section.starts_with("[profile.dev") && line.contains('='))
            .map(|(section, line)| format!("{section} {line}"))
            .collect()
    };
    let lock = text("fuzz/Cargo.lock");
    let mut tests = profile("Cargo.toml");
    tests.retain(|setting| {
        let package = setting.strip_prefix("[profile.dev.package.");
        package.is_none_or(|rest| {
            let name = rest.split(']').next().unwrap();
            lock.contains(&format!("name = \"{name}\""))
        })
    });
    assert!(tests.len() > 3, "{tests:?}");
    assert_eq!(profile("fuzz/Cargo.toml"), tests);
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

/// The file of a module, or of the module that an item is in, and the item's name.
fn place_of(path: &str) -> Option<(String, Option<String>)> {
    let mut module = path.replace("::", "/");
    let mut item = None;
    loop {
        let files = [format!("src/{module}.rs"), format!("src/{module}/mod.rs")];
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        if let Some(file) = files.into_iter().find(|file| root.join(file).exists()) {
            return Some((file, item));
        }
        let (before, last) = module.rsplit_once('/')?;
        if item.is_some() {
            return None;
        }
        item = Some(last.to_owned());
        module = before.to_owned();
    }
}

#[test]
fn every_word_of_the_glossary_is_carried_by_what_it_names() {
    let rows = table(&text("docs/glossary.md"), "word | means");
    assert!(rows.len() > 25, "{} words", rows.len());
    for row in rows {
        for path in codes(&row[2])
            .into_iter()
            .filter(|path| path.contains("::"))
        {
            let (file, item) = place_of(path).unwrap_or_else(|| panic!("{path}: no such module"));
            if let Some(item) = item {
                let source = text(&file);
                let is_there = ["struct", "enum", "const", "fn", "trait"]
                    .iter()
                    .any(|kind| source.contains(&format!("pub {kind} {item}")));
                assert!(is_there, "{file} has no {item}");
            }
        }
    }
}

#[test]
fn every_path_that_the_architecture_names_exists() {
    let paper = text("ARCHITECTURE.md");
    let folders = [
        "src/", "tests/", "docs/", "benches/", "scripts/", "page/", "fuzz/", "client/",
    ];
    let named: BTreeSet<&str> = codes(&paper)
        .into_iter()
        .filter(|code| folders.iter().any(|folder| code.starts_with(folder)) && !code.contains('*'))
        .collect();
    assert!(named.len() > 20, "{} paths", named.len());
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    for path in named {
        assert!(root.join(path).exists(), "ARCHITECTURE.md names {path}");
    }
}

/// Names such as `Registry::fan_out` in the drawing of a frame's way.
#[test]
fn every_function_on_the_way_of_a_frame_exists() {
    let paper = text("ARCHITECTURE.md");
    let (_, drawing) = paper.split_once("## The way of a published frame").unwrap();
    let (_, drawing) = drawing.split_once("```mermaid").unwrap();
    let (drawing, _) = drawing.split_once("```").unwrap();
    let is_part = |one: char| one.is_alphanumeric() || one == '_' || one == ':';
    let named: BTreeSet<(&str, &str)> = drawing
        .split(|one| !is_part(one))
        .filter_map(|word| word.trim_end_matches(':').rsplit_once("::"))
        .collect();
    assert!(named.len() > 15, "{named:?}");
    let sources = rust_files("src");
    for (owner, function) in named {
        let is_type = owner.starts_with(char::is_uppercase);
        let is_there = sources.iter().any(|path| {
            let source = std::fs::read_to_string(path).unwrap();
            let folder = path.to_str().unwrap();
            let is_owner = if is_type {
                source.contains(&format!("impl {owner} {{"))
                    || source.contains(&format!("trait {owner} {{"))
            } else {
                folder.ends_with(&format!("/{owner}.rs"))
                    || folder.ends_with(&format!("/{owner}/mod.rs"))
            };
            let is_defined = ["(", "<"]
                .iter()
                .any(|next| source.contains(&format!("fn {function}{next}")));
            is_owner && is_defined
        });
        // A function may be passed on by its module.
        let is_passed_on = !is_type
            && sources.iter().any(|path| {
                path.to_str()
                    .unwrap()
                    .ends_with(&format!("/{owner}/mod.rs"))
                    && std::fs::read_to_string(path)
                        .unwrap()
                        .lines()
                        .any(|line| line.starts_with("pub use") && line.contains(function))
            });
        assert!(is_there || is_passed_on, "{owner}::{function}");
    }
}

/// In the drawings: paths by their slash, actors and messages by their capitals.
#[test]
fn whatever_the_architectures_drawings_name_exists() {
    let paper = text("ARCHITECTURE.md");
    let drawings: Vec<&str> = paper.split("```mermaid\n").skip(1).collect();
    assert!(drawings.len() >= 2);
    let sources: String = rust_files("src")
        .iter()
        .map(|path| std::fs::read_to_string(path).unwrap())
        .collect();
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut named = 0;
    for drawing in drawings {
        let drawing = drawing.split("```").next().unwrap().replace("<br/>", " ");
        // A label is between quotes; its type names and paths stand between spaces and commas.
        let labels = drawing.split('"').skip(1).step_by(2);
        for word in labels.flat_map(|label| label.split([' ', ','])) {
            if word.contains('/') {
                assert!(root.join(word).exists(), "ARCHITECTURE.md draws {word}");
            } else if word.starts_with(char::is_uppercase) && word.contains(char::is_lowercase) {
                // WebSocket is no type of ours, but the protocol's name.
                let is_ours = ["struct", "enum"]
                    .iter()
                    .any(|kind| sources.contains(&format!("{kind} {word}")));
                assert!(
                    is_ours || word == "WebSocket",
                    "ARCHITECTURE.md draws {word}"
                );
            } else {
                continue;
            }
            named += 1;
        }
    }
    assert!(named > 40, "{named} names");
}

#[test]
fn the_papers_say_what_the_kept_report_says() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let check = Command::new("python3")
        .arg(root.join("scripts/keep-report.py"))
        .arg("--check")
        .output();
    let Ok(check) = check else {
        assert!(std::env::var_os("CI").is_none(), "python3 is missing");
        return;
    };
    let said = String::from_utf8_lossy(&check.stderr);
    assert!(check.status.success(), "{said}");
}
