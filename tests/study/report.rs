//! `pendularm report`: files, refusals. Their contents are tested in the study.

use std::fs;
use std::path::{Path, PathBuf};

use pendularm::report::{ReportError, ReportOptions, run};
use serde_json::Value;

use crate::folder::Folder;

/// Makes these sections quickly.
fn make(out: &Path, only: &[&str]) -> Result<PathBuf, ReportError> {
    run(&ReportOptions {
        out: out.to_owned(),
        only: only.iter().map(|&name| name.to_owned()).collect(),
        quick: true,
        method: None,
    })
}

/// The text of the page with these sections, and the report in numbers.
fn made(out: &Path, only: &[&str]) -> (String, Value) {
    let page = make(out, only).unwrap();
    let report = fs::read_to_string(out.join("report.json")).unwrap();
    let html = fs::read_to_string(page).unwrap();
    (html, serde_json::from_str(&report).unwrap())
}

#[test]
fn a_section_leaves_page_figures_and_numbers() {
    let folder = Folder::new("report-files");
    let out = folder.join("out");
    let (html, _) = made(&out, &["conditioning"]);
    assert!(html.contains("<svg class=\"plot\""));
    // Self-contained: nothing is fetched, nothing is run.
    for fetched in ["src=", "@import", "url(", "<script", "<link"] {
        assert!(!html.contains(fetched), "{fetched}");
    }
    for file in ["conditioning.csv", "conditioning.svg", "report.json"] {
        assert!(out.join(file).exists(), "{file}");
    }
    let svg = fs::read_to_string(out.join("conditioning.svg")).unwrap();
    let is_picture = svg.starts_with("<svg xmlns=\"http://www.w3.org/2000/svg\"");
    // The colours also work in viewers without `light-dark()`.
    let themes = ["--if-light:initial", "--method4: var(--if-light, #"];
    assert!(is_picture && themes.iter().all(|part| svg.contains(part)));
    // Three poses, three ways of solving, 19 mass ratios, and the head.
    let csv = fs::read_to_string(out.join("conditioning.csv")).unwrap();
    assert_eq!(csv.lines().count(), 3 * 3 * 19 + 1);
}

/// Sections are made in parallel, and appear in their order.
#[test]
fn several_sections_are_made_and_shown_in_their_order() {
    let out = Folder::new("report-several");
    let (html, report) = made(&out, &["scenarios", "conditioning", "drift"]);
    let at = |name: &str| html.find(&format!("<section id=\"{name}\">")).unwrap();
    assert!(at("scenarios") < at("drift") && at("drift") < at("conditioning"));
    let sections = report["sections"].as_array().unwrap().iter();
    let mut verdicts = sections.flat_map(|one| one["verdicts"].as_array().unwrap());
    assert!(verdicts.all(|one| one["holds"] == true), "{report}");
    let csv = fs::read_to_string(out.join("energy-drift.csv")).unwrap();
    assert_eq!(csv.matches(",6e1,").count(), 15);
}

/// The reader's own method is a line of the first figure. A file that is no method is refused with its fault.
#[test]
fn a_method_in_a_file_is_a_line_of_the_first_figure() {
    let out = Folder::new("report-method");
    let file = out.join("heun.json");
    let make = |tableau: &str| {
        fs::write(&file, tableau).unwrap();
        run(&ReportOptions {
            out: out.join("out"),
            only: vec!["error".to_owned()],
            quick: true,
            method: Some(file.clone()),
        })
    };
    for (tableau, fault) in [
        (r#"{"a": [[], [1]], "b": [0.5]}"#, "rows"),
        (r#"{"a": [[], ["1/0"]], "b": [0.5, 0.5]}"#, "a[1][0]"),
        ("{", "EOF"),
        ("3", "tableau"),
    ] {
        let error = make(tableau).unwrap_err().to_string();
        assert!(
            error.contains("heun.json") && error.contains(fault),
            "{error}"
        );
    }
    make(r#"{"a": [[], [1]], "b": ["1/2", "1/2"]}"#).unwrap();
    let csv = fs::read_to_string(out.join("out/work-precision-time.csv")).unwrap();
    for curve in [
        "heun, dashed",
        "semi-implicit Euler",
        "DOP853",
        "Taylor series",
        "Rodas3",
    ] {
        assert!(
            csv.contains(&format!("Free swing, 2 links, by time: {curve}")),
            "{curve}"
        );
    }
}

/// A count without a kept number would be shown as not measured, and a line of the wrong columns would be left out.
#[test]
fn every_line_and_every_count_of_the_work_is_shown() {
    let out = Folder::new("report-work");
    let (html, report) = made(&out, &["work"]);
    assert!(!html.contains("not measured"));
    assert!(html.contains("by callgrind, with pendularm "), "no version");
    let work = &report["sections"][0];
    let count = |list: &Value| list.as_array().unwrap().len();
    let lines = |text: &str| text.lines().count();
    let left_out = include_str!("../../src/report/figures/left_out.txt");
    assert_eq!(count(&work["tables"][0]["rows"]), lines(left_out) - 1);
    // Two more claims compare counts with each other.
    let below = include_str!("../../src/report/figures/below.txt");
    assert_eq!(count(&work["verdicts"]), lines(below) + 2);
}
