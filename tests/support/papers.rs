//! Parts that the tests of the documents share: a file's text, and a table in it.
//!
//! **Invariant:** a missing text or table fails the test.

use std::fs;
use std::path::Path;

/// The text of a file of the project.
pub fn text(path: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The rows of the first table whose header begins with `header`, cell by cell, without code marks.
pub fn table(paper: &str, header: &str) -> Vec<Vec<String>> {
    let start = format!("| {header} |");
    let rows: Vec<Vec<String>> = paper
        .lines()
        .skip_while(|line| !line.starts_with(&start))
        .skip(2)
        .take_while(|line| line.starts_with('|'))
        .map(|line| {
            line.trim_matches('|')
                .split(" |")
                .map(|cell| cell.trim().to_owned())
                .collect()
        })
        .collect();
    assert!(!rows.is_empty(), "no table of {header}");
    rows
}
