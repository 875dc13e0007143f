//! The table of limits in docs/protocol.md against the source: every limit is a constant there, with the value that the table says, and a test names it.
//!
//! **Invariant:** neither the table, the constant nor its test can change alone.

use std::fs;
use std::path::PathBuf;

use crate::papers::{table, text};
use crate::tree::{root, rust_files};

/// The rows of the table: name, limit, effect beyond it, constant.
fn rows() -> Vec<Vec<String>> {
    let rows = table(
        &text("docs/protocol.md"),
        "what | limit | beyond it | constant",
    );
    assert!(
        (20..=35).contains(&rows.len()),
        "the table of limits has {} rows",
        rows.len()
    );
    rows
}

/// The file of a module and the name of the constant in it.
fn place(row: &[String]) -> (String, String) {
    let path = row[3].trim_matches('`');
    let (module, name) = path.rsplit_once("::").unwrap();
    let module = module.replace("::", "/");
    let files = [format!("src/{module}.rs"), format!("src/{module}/mod.rs")];
    let file = files.into_iter().find(|file| root().join(file).exists());
    (
        file.unwrap_or_else(|| panic!("{path}: no such module")),
        name.to_owned(),
    )
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
    let here = definition(source, name).map(|right| (right, source.to_owned()));
    let elsewhere = || {
        let mut found = rust_files("src")
            .into_iter()
            .map(|path| fs::read_to_string(path).unwrap());
        found.find_map(|source| Some((definition(&source, name)?, source)))
    };
    let (right, source) = here
        .or_else(elsewhere)
        .unwrap_or_else(|| panic!("{expression}?"));
    value(&right, &source)
}

/// Values as the table says them: numbers with units, added up.
fn said(limit: &str) -> f64 {
    limit
        .split(" + ")
        .map(|part| {
            let (number, unit) = part.split_once(' ').unwrap_or((part, ""));
            let number: f64 = number
                .replace(',', "")
                .parse()
                .unwrap_or_else(|_| panic!("{limit}?"));
            number
                * match unit {
                    "" | "byte" | "bytes" | "s" => 1.0,
                    "KiB" => 1024.0,
                    "MiB" => 1024.0 * 1024.0,
                    "GiB" => 1024.0 * 1024.0 * 1024.0,
                    "ms" => 1e-3,
                    "h" => 3600.0,
                    "days" => 24.0 * 3600.0,
                    _ => panic!("{limit}: unit?"),
                }
        })
        .sum()
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
        assert!(
            (found - said).abs() <= 1e-9 * said,
            "{name} is {found}, the table says {said}"
        );
    }
}

#[test]
fn every_limit_of_the_paper_has_a_test_that_names_it() {
    let mut tests: Vec<(PathBuf, String)> = Vec::new();
    for path in rust_files("tests") {
        // This file reads names only from the table.
        tests.push((path.clone(), fs::read_to_string(&path).unwrap()));
    }
    for path in rust_files("src") {
        let source = fs::read_to_string(&path).unwrap();
        if path.ends_with("tests.rs") {
            tests.push((path, source));
        } else if let Some((_, unit_tests)) = source.split_once("#[cfg(test)]\nmod tests") {
            tests.push((path, unit_tests.to_owned()));
        }
    }
    let missing: Vec<String> = rows()
        .iter()
        .map(|row| place(row).1)
        .filter(|name| !tests.iter().any(|(_, code)| names(code, name)))
        .collect();
    assert!(missing.is_empty(), "no test names {missing:?}");
}
