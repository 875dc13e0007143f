//! Rules for every file of the tree.
//!
//! **Invariant:** these checks read every file that is written by hand, also files that are added later.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

/// Names of files that are made by tools or by other projects, anywhere in the tree.
const NOT_OURS: [&str; 7] = [
    ".git",
    "target",
    "vendor",
    ".cargo",
    ".venv",
    "node_modules",
    "submission.tar.gz",
];

pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every file below `folder` that belongs to the project.
pub(crate) fn files(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        // `make report` writes to `report/`, but `src/report` is source. The seeds of the fuzz targets are any bytes.
        let made = [root().join("report"), root().join("fuzz/seeds")].contains(&path);
        if made || NOT_OURS.iter().any(|name| path.ends_with(name)) {
            continue;
        }
        if path.is_dir() {
            found.extend(files(&path));
        } else {
            found.push(path);
        }
    }
    found
}

/// The project's files below `folder` with one of these extensions.
pub(crate) fn files_in(folder: &str, extensions: &[&str]) -> Vec<PathBuf> {
    let mut files = files(&root().join(folder));
    files.retain(|path| {
        let extension = path.extension().and_then(OsStr::to_str);
        extension.is_some_and(|extension| extensions.contains(&extension))
    });
    assert!(!files.is_empty(), "no file in {folder}: {extensions:?}");
    files
}

pub(crate) fn rust_files(folder: &str) -> Vec<PathBuf> {
    files_in(folder, &["rs"])
}

/// The file of a module of the library.
pub(crate) fn module_file(path: &str) -> Option<String> {
    let module = path.replace("::", "/");
    let files = [format!("src/{module}.rs"), format!("src/{module}/mod.rs")];
    files.into_iter().find(|file| root().join(file).exists())
}

/// Longest source file, in lines.
const MAX_LINES: usize = 800;

#[test]
fn no_source_file_is_longer_than_a_reader_takes_in() {
    let lines = |path: &PathBuf| fs::read_to_string(path).unwrap().lines().count();
    let mut long = files_in("", &["rs", "py", "js", "mjs", "sh"]);
    long.retain(|path| lines(path) > MAX_LINES);
    assert!(long.is_empty(), "longer than {MAX_LINES} lines: {long:?}");
}

/// Crates and parts of the standard library that the pure layers may not use. Comments do not count.
/// `imports/layers.rs` has the layers of the project.
#[test]
fn pure_layers_import_only_allowed_crates() {
    let world = [
        "actix",
        "tokio",
        "std::net",
        "std::thread",
        "std::io",
        "Instant::now",
        "SystemTime",
    ];
    for (folder, stranger) in [
        ("src/math", Some("serde")),
        ("src/protocol", Some("glam")),
        ("src/study", Some("serde")),
        ("src/services", None),
        ("src/live", Some("serde_json")),
        ("src/report/experiments", Some("serde")),
    ] {
        // Unit tests may use anything.
        let is_code = |path: &PathBuf| !path.ends_with("tests.rs");
        for path in rust_files(folder).into_iter().filter(is_code) {
            let text = fs::read_to_string(&path).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap_or_default();
            for line in code.lines().filter_map(|line| line.split("//").next()) {
                let mut words = world.iter().chain(stranger.as_ref());
                let word = words.find(|word| line.contains(**word));
                assert_eq!(word, None, "{}: {line}", path.display());
            }
        }
    }
}

/// `unsafe` is forbidden. If a tool needs it, its package denies it, and its source allows each place with a reason.
#[test]
fn every_package_forbids_unsafe_code() {
    let all = files(root());
    let manifests = all.iter().filter(|path| path.ends_with("Cargo.toml"));
    let mut seen = 0;
    for path in manifests {
        let text = fs::read_to_string(path).unwrap();
        let lints = text.split("[lints.rust]\n").nth(1).unwrap_or_default();
        let lints = lints.split("\n[").next().unwrap();
        let ours = path.parent() == Some(root());
        let forbids = lints.contains("unsafe_code = \"forbid\"");
        let denies = lints.contains("unsafe_code = \"deny\"");
        let is_safe = forbids || (denies && !ours);
        assert!(is_safe, "{} does not forbid unsafe_code", path.display());
        seen += 1;
    }
    assert!(seen >= 2, "{seen} packages");
}

/// A path on the author's machine is useless to other people.
#[test]
fn no_file_names_a_folder_of_a_build_machine() {
    // Joined here, so that this file does not contain them.
    let homes = ["/root", "/home", "/Users", "/work", "/tmp"].map(|home| format!("{home}/"));
    for path in files(root()) {
        let Ok(text) = fs::read_to_string(&path) else {
            continue;
        };
        for home in &homes {
            // A longer path that contains such a name, for example `/a/home/b`, does not count.
            let named = text.match_indices(home.as_str()).any(|(at, _)| {
                !text[..at]
                    .ends_with(|before: char| before.is_alphanumeric() || "._-}~*".contains(before))
            });
            assert!(!named, "{} names {home}", path.display());
        }
    }
}

/// Decisions use only the monotonic clock: a wall clock may jump.
#[test]
fn nothing_asks_the_wall_clock() {
    for path in rust_files("src") {
        // The time of day is only written to records and log lines.
        if path.ends_with("actors/recorder/tape.rs") || path.ends_with("logging/mod.rs") {
            continue;
        }
        let text = fs::read_to_string(&path).unwrap();
        for clock in ["SystemTime", "UNIX_EPOCH"] {
            assert!(!text.contains(clock), "{} names {clock}", path.display());
        }
    }
}
