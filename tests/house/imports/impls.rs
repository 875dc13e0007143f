//! Impls of a type's own functions: a reader finds what a type does in one file. Impls of traits may stand elsewhere.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use crate::tree::{root, rust_files};

/// The folders that are checked.
const FOLDERS: [&str; 5] = ["actors", "live", "protocol", "services", "web"];

/// The type of an impl that is not of a trait, by the one line on which it begins.
fn own_impl(line: &str) -> Option<String> {
    let head = line.strip_prefix("impl")?.strip_suffix(" {")?;
    let mut depth = 0;
    let outside = head.chars().filter(|character| {
        depth += i32::from(*character == '<') - i32::from(*character == '>');
        depth == 0 && *character != '>'
    });
    let name: String = outside.collect();
    let name = name.trim();
    (!name.contains(" for ")).then(|| name.to_owned())
}

#[test]
fn the_own_functions_of_a_type_are_in_one_file() {
    let mut files: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for path in FOLDERS
        .iter()
        .flat_map(|folder| rust_files(&format!("src/{folder}")))
    {
        let text = fs::read_to_string(&path).unwrap();
        let path = path.strip_prefix(root()).unwrap().display().to_string();
        for name in text.lines().filter_map(own_impl) {
            files.entry(name).or_default().insert(path.clone());
        }
    }
    assert!(files.len() > 100, "{} types", files.len());
    files.retain(|_, files| files.len() > 1);
    assert!(files.is_empty(), "in several files: {files:#?}");
}
