//! ARCHITECTURE.md and the glossary: the modules, paths, functions and types that they name exist.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use super::codes;
use crate::papers::{table, text};
use crate::tree::{module_file, root, rust_files};

/// The file of a module, or of the module that an item is in, and the item's name.
fn place_of(path: &str) -> Option<(String, Option<&str>)> {
    let whole = module_file(path).map(|file| (file, None));
    whole.or_else(|| {
        let (module, item) = path.rsplit_once("::")?;
        Some((module_file(module)?, Some(item)))
    })
}

#[test]
fn every_word_of_the_glossary_is_the_name_of_its_item() {
    let rows = table(&text("docs/glossary.md"), "word | means");
    assert!(rows.len() > 25, "{} words", rows.len());
    for row in rows {
        let paths = codes(&row[2]).into_iter();
        for path in paths.filter(|path| path.contains("::")) {
            let place = place_of(path);
            let (file, item) = place.unwrap_or_else(|| panic!("{path}: no such module"));
            let Some(item) = item else { continue };
            let source = text(&file);
            let is_public = |kind: &str| {
                let name = format!(" {kind} {item}");
                let mut lines = source.lines().map(str::trim_start);
                lines.any(|line| line.starts_with("pub") && line.contains(&name))
            };
            let kinds = ["struct", "enum", "const", "fn", "trait"];
            assert!(kinds.into_iter().any(is_public), "{file} has no {item}");
        }
    }
}

#[test]
fn every_path_that_the_architecture_names_exists() {
    let paper = text("ARCHITECTURE.md");
    let folders = [
        "src/", "tests/", "docs/", "benches/", "scripts/", "page/", "fuzz/", "client/",
    ];
    let is_path = |code: &str| folders.iter().any(|folder| code.starts_with(folder));
    let mut named = codes(&paper);
    named.retain(|code| is_path(code) && !code.contains('*'));
    assert!(named.len() > 20, "{} paths", named.len());
    for path in named {
        assert!(root().join(path).exists(), "ARCHITECTURE.md names {path}");
    }
}

/// Names such as `Registry::fan_out` in the drawing of a frame's path.
#[test]
fn every_function_on_the_path_of_a_frame_exists() {
    let paper = text("ARCHITECTURE.md");
    let (_, drawing) = paper.split_once("## Path of a published frame").unwrap();
    let (_, drawing) = drawing.split_once("```mermaid").unwrap();
    let (drawing, _) = drawing.split_once("```").unwrap();
    let is_part = |one: char| one.is_alphanumeric() || one == '_' || one == ':';
    let named: BTreeSet<(&str, &str)> = drawing
        .split(|one| !is_part(one))
        .filter_map(|word| word.trim_end_matches(':').rsplit_once("::"))
        .collect();
    assert!(named.len() > 15, "{named:?}");
    let sources = rust_files("src").into_iter();
    let sources: Vec<(PathBuf, String)> = sources
        .map(|path| (path.clone(), fs::read_to_string(path).unwrap()))
        .collect();
    for (owner, function) in named {
        let is_there = sources.iter().any(|(path, source)| {
            let is_impl = |line: &str| line.starts_with("impl") && line.contains(owner);
            let is_owner = path.with_extension("").iter().any(|part| part == owner)
                || source.lines().any(is_impl);
            // A function may be passed on by its module.
            let is_passed_on = |line: &str| line.starts_with("pub use") && line.contains(function);
            let is_defined = ["(", "<"].map(|end| source.contains(&format!("fn {function}{end}")));
            is_owner && (is_defined.contains(&true) || source.lines().any(is_passed_on))
        });
        assert!(is_there, "{owner}::{function}");
    }
}

/// The names in the cell of a file are in it, and the first one is defined there. The bounds are the present numbers
/// of files.
#[test]
fn the_walks_name_existing_files_and_become_no_longer() {
    let paper = text("ARCHITECTURE.md");
    let walks = [
        ("message", 14),
        ("setpoint", 6),
        ("joint state", 5),
        ("call", 16),
    ];
    let rows = walks.into_iter().flat_map(|(what, most)| {
        let rows = table(&paper, &format!("a {what} passes"));
        assert!(rows.len() <= most, "{what}: {} files", rows.len());
        rows
    });
    for row in rows {
        let path = codes(&row[0])[0];
        let (source, names) = (text(path), codes(&row[1]));
        let kinds = ["fn", "struct", "enum", "trait"];
        let defines = |kind: &&str| source.contains(&format!("{kind} {}", names[0]));
        let is_there = kinds.iter().any(defines) && names.iter().all(|name| source.contains(name));
        assert!(is_there, "{path}: {names:?}");
    }
}

/// In the drawings: paths by their slash, actors and messages by their capitals.
#[test]
fn every_name_in_the_architectures_drawings_exists() {
    let paper = text("ARCHITECTURE.md");
    let drawings: Vec<&str> = paper.split("```mermaid\n").skip(1).collect();
    assert!(drawings.len() >= 2);
    let sources = rust_files("src").into_iter().map(fs::read_to_string);
    let sources: String = sources.map(Result::unwrap).collect();
    let mut named = 0;
    for drawing in drawings {
        let drawing = drawing.split("```").next().unwrap().replace("<br/>", " ");
        // A label is between quotes. Its type names and paths are separated by spaces and commas.
        let labels = drawing.split('"').skip(1).step_by(2);
        for word in labels.flat_map(|label| label.split([' ', ','])) {
            if word.contains('/') {
                assert!(root().join(word).exists(), "ARCHITECTURE.md draws {word}");
            } else if word.starts_with(char::is_uppercase) && word.contains(char::is_lowercase) {
                // `WebSocket` is the name of the protocol, not of a type.
                let is_type = |kind: &str| sources.contains(&format!("{kind} {word}"));
                let is_known = is_type("struct") || is_type("enum") || word == "WebSocket";
                assert!(is_known, "ARCHITECTURE.md draws {word}");
            } else {
                continue;
            }
            named += 1;
        }
    }
    assert!(named > 40, "{named} names");
}
