//! How the source is cut: short files, short lines, one style of modules, one name for one type.
//!
//! **Invariant:** no rule has an exception but those that stand here with their reason.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};

use crate::tree::{files_in, rust_files};

/// Longest file, in lines.
const MAX_LINES: usize = 800;
/// Folders of what is kept as source, tests and tools too, and the extensions of its languages.
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
fn a_folder_of_modules_is_opened_by_its_mod_rs() {
    for path in rust_files("src") {
        let folder = path.with_extension("");
        assert!(
            !folder.is_dir(),
            "{} stands beside its folder",
            path.display()
        );
    }
}

#[test]
fn nobody_reaches_three_floors_up() {
    for (path, text) in source() {
        assert!(!text.contains("super::super::super"), "{path}");
    }
}

/// The types that a file defines, in the body of a macro too. A `type` within a trait or its implementation defines none.
fn types(tokens: TokenStream, found: &mut Vec<String>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    for pair in tokens.windows(2) {
        if let [TokenTree::Punct(mark), TokenTree::Group(body)] = pair
            && mark.as_char() == '!'
        {
            types(body.stream(), found);
        }
    }
    for pair in tokens.windows(2) {
        if let [TokenTree::Ident(keyword), TokenTree::Ident(name)] = pair
            && ["struct", "enum", "trait", "type"].contains(&keyword.to_string().as_str())
        {
            found.push(name.to_string());
        }
    }
}

#[test]
fn types_are_found_in_the_bodies_of_macros_and_nowhere_else_within() {
    let text = "struct A; table! { /// A row.\n pub enum B of Row { C = 1, } } impl A { type D = (); } mod e { enum F {} }";
    let mut found = Vec::new();
    types(text.parse().unwrap(), &mut found);
    found.sort();
    assert_eq!(found, ["A", "B"]);
}

#[test]
fn no_two_types_have_one_name() {
    let mut files: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (path, text) in source() {
        let mut defined = Vec::new();
        types(text.parse().unwrap(), &mut defined);
        for name in defined {
            files.entry(name).or_default().push(path.clone());
        }
    }
    files.retain(|_, places| places.len() > 1);
    assert!(files.is_empty(), "two things of one name: {files:#?}");
}
