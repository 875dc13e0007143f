//! The table of limits in docs/protocol.md against the source: every limit is a constant there, with the value that the table says, and a test names it.
//!
//! **Invariant:** neither the table, the constant nor its test can change alone.

use std::fs;
use std::path::PathBuf;

use crate::papers::{table, text};
use crate::tree::{module_file, rust_files};

/// The rows of the table: name, limit, effect beyond it, constant.
fn rows() -> Vec<Vec<String>> {
    let header = "what | limit | beyond it | constant";
    let rows = table(&text("docs/protocol.md"), header);
    assert!((20..=35).contains(&rows.len()), "{} limits", rows.len());
    rows
}

/// The file of a module and the name of the constant in it.
fn place(row: &[String]) -> (String, String) {
    let path = row[3].trim_matches('`');
    let (module, name) = path.rsplit_once("::").unwrap();
    let file = module_file(module).unwrap_or_else(|| panic!("{path}: no such module"));
    (file, name.to_owned())
}

/// The right side of a constant's definition.
fn definition(source: &str, name: &str) -> Option<String> {
    let start = format!("const {name}: ");
    let rest = &source[source.find(&start)? + start.len()..];
    let (_, right) = rest.split_once('=')?;
    Some(right.split(';').next()?.trim().to_owned())
}

/// The value of a constant: bytes, a count, or seconds. Products and sums of numbers and of other constants of the source.
fn value(expression: &str, source: &str) -> f64 {
    let expression = expression.trim();
    if let Some((left, right)) = expression.split_once(" + ") {
        return value(left, source) + value(right, source);
    }
    for (unit, seconds) in [("secs", 1.0), ("millis", 1e-3), ("micros", 1e-6)] {
        let call = format!("Duration::from_{unit}(");
        if let Some(inner) = expression.strip_prefix(&call) {
            return seconds * value(inner.strip_suffix(')').unwrap(), source);
        }
    }
    if let Some((left, right)) = expression.split_once(" * ") {
        return value(left, source) * value(right, source);
    }
    if let Ok(number) = expression.replace('_', "").parse() {
        return number;
    }
    let name = expression.rsplit("::").next().unwrap();
    let files = rust_files("src").into_iter().map(fs::read_to_string);
    let mut sources = std::iter::once(source.to_owned()).chain(files.map(Result::unwrap));
    let found = sources.find_map(|source| Some((definition(&source, name)?, source)));
    let (right, source) = found.unwrap_or_else(|| panic!("{expression}?"));
    value(&right, &source)
}

/// Values as the table says them: numbers with units, added up.
fn said(limit: &str) -> f64 {
    let part = |part: &str| {
        let (number, unit) = part.split_once(' ').unwrap_or((part, ""));
        let number: Result<f64, _> = number.replace(',', "").parse();
        let unit = match unit {
            "" | "byte" | "bytes" | "s" => 1.0,
            "KiB" => 1024.0,
            "MiB" => 1024.0 * 1024.0,
            "GiB" => 1024.0 * 1024.0 * 1024.0,
            "ms" => 1e-3,
            "h" => 3600.0,
            "days" => 24.0 * 3600.0,
            _ => panic!("{limit}: unit?"),
        };
        unit * number.unwrap_or_else(|_| panic!("{limit}?"))
    };
    limit.split(" + ").map(part).sum()
}

fn names(code: &str, name: &str) -> bool {
    let is_part = |byte: Option<char>| byte.is_some_and(|one| one.is_alphanumeric() || one == '_');
    code.match_indices(name).any(|(at, _)| {
        !is_part(code[..at].chars().next_back()) && !is_part(code[at + name.len()..].chars().next())
    })
}

#[test]
fn every_limit_of_the_paper_is_a_constant_of_that_value() {
    for row in rows() {
        let (file, name) = place(&row);
        let source = text(&file);
        let right = definition(&source, &name).unwrap_or_else(|| panic!("{file}: no {name}"));
        let (found, said) = (value(&right, &source), said(&row[1]));
        let is_said = (found - said).abs() <= 1e-9 * said;
        assert!(is_said, "{name} is {found}, the table says {said}");
    }
}

#[test]
fn every_limit_of_the_paper_has_a_test_that_names_it() {
    // This file reads names only from the table.
    let read = |path: &PathBuf| fs::read_to_string(path).unwrap();
    let mut tests: Vec<String> = rust_files("tests").iter().map(read).collect();
    for path in rust_files("src") {
        let source = read(&path);
        if path.ends_with("tests.rs") {
            tests.push(source);
        } else if let Some((_, unit_tests)) = source.split_once("#[cfg(test)]\nmod tests") {
            tests.push(unit_tests.to_owned());
        }
    }
    let mut missing: Vec<String> = rows().iter().map(|row| place(row).1).collect();
    missing.retain(|name| !tests.iter().any(|code| names(code, name)));
    assert!(missing.is_empty(), "no test names {missing:?}");
}
