//! ARCHITECTURE.md and the glossary: the modules, paths, functions and types that they name exist.

use std::collections::BTreeSet;

use super::codes;
use crate::papers::{table, text};
use crate::tree::rust_files;

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
fn every_word_of_the_glossary_is_the_name_of_its_item() {
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
                let is_public = |kind: &&str| {
                    let name = format!(" {kind} {item}");
                    let mut lines = source.lines().map(str::trim_start);
                    lines.any(|line| line.starts_with("pub") && line.contains(&name))
                };
                let kinds = ["struct", "enum", "const", "fn", "trait"];
                let is_there = kinds.iter().any(is_public);
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

/// Names such as `Registry::fan_out` in the drawing of a frame's path.
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

/// The files in the table with this header, and the names in each. Returns the number of files and of their lines.
fn walk(header: &str) -> (usize, usize) {
    let rows = table(&text("ARCHITECTURE.md"), header);
    let mut lines = 0;
    for row in &rows {
        let path = codes(&row[0])[0];
        let source = text(path);
        lines += source.lines().count();
        let names = codes(&row[1]);
        assert!(!names.is_empty(), "{path}: no name");
        for name in names {
            let is_defined = ["fn", "struct", "enum", "trait"].iter().any(|kind| {
                ["(", "<", " ", ":"]
                    .iter()
                    .any(|next| source.contains(&format!("{kind} {name}{next}")))
            });
            let is_named = source.contains(name);
            assert!(
                is_defined || (name != codes(&row[1])[0] && is_named),
                "{path}: no {name}"
            );
        }
    }
    let paths: BTreeSet<&str> = rows.iter().map(|row| codes(&row[0])[0]).collect();
    assert_eq!(paths.len(), rows.len(), "a file is listed twice");
    (rows.len(), lines)
}

/// The bounds are the present lengths, so a longer walk fails the test.
#[test]
fn the_walks_name_existing_files_and_become_no_longer() {
    let (files, lines) = walk("a message passes");
    assert!(
        files <= 17 && lines <= 6_070,
        "a message passes {files} files, {lines} lines"
    );
    let (files, lines) = walk("a call passes");
    assert!(
        files <= 21 && lines <= 7_407,
        "a call passes {files} files, {lines} lines"
    );
}

/// In the drawings: paths by their slash, actors and messages by their capitals.
#[test]
fn every_name_in_the_architectures_drawings_exists() {
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
        // A label is between quotes. Its type names and paths are separated by spaces and commas.
        let labels = drawing.split('"').skip(1).step_by(2);
        for word in labels.flat_map(|label| label.split([' ', ','])) {
            if word.contains('/') {
                assert!(root.join(word).exists(), "ARCHITECTURE.md draws {word}");
            } else if word.starts_with(char::is_uppercase) && word.contains(char::is_lowercase) {
                // `WebSocket` is the name of the protocol, not of a type.
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
