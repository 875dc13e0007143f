//! The form of the source: short files, short lines, short paths.
//!
//! **Invariant:** every exception to a rule is listed here with its reason.

use std::fs;
use std::path::{Path, PathBuf};

use crate::tree::{files_in, rust_files};

/// Longest file, in lines.
const MAX_LINES: usize = 800;
/// Folders of source, tests and tools, and the extensions of their languages.
const FOLDERS: [&str; 10] = [
    "src", "tests", "benches", "fuzz", "client", "python", "ros2", "page", "wasm", "scripts",
];
const LANGUAGES: [&str; 5] = ["rs", "py", "js", "mjs", "sh"];
/// Longest line, in characters.
const MAX_WIDTH: usize = 120;

fn source() -> impl Iterator<Item = (String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    rust_files("src").into_iter().map(move |path: PathBuf| {
        let text = fs::read_to_string(&path).unwrap();
        let path = path.strip_prefix(&folder).unwrap();
        (path.to_str().unwrap().to_owned(), text)
    })
}

fn assert_none(what: &str, found: &[String]) {
    assert!(found.is_empty(), "{what}:\n{}", found.join("\n"));
}

#[test]
fn no_file_is_longer_than_a_reader_takes_in() {
    let mut long = Vec::new();
    for path in FOLDERS
        .into_iter()
        .flat_map(|folder| files_in(folder, &LANGUAGES))
    {
        let lines = fs::read_to_string(&path).unwrap().lines().count();
        if lines > MAX_LINES {
            long.push(format!("{}: {lines} lines", path.display()));
        }
    }
    assert_none("files that are too long", &long);
}

#[test]
fn no_line_is_longer_than_a_screen_is_wide() {
    let mut long = Vec::new();
    for (path, text) in source() {
        for (number, line) in (1..).zip(text.lines()) {
            if line.chars().count() > MAX_WIDTH {
                long.push(format!("{path}:{number}"));
            }
        }
    }
    assert_none("lines that are too long", &long);
}

#[test]
fn no_file_imports_from_three_layers_above() {
    for (path, text) in source() {
        assert!(!text.contains("super::super::super"), "{path}");
    }
}
