//! The results for programs and browsers: JSON, JUnit and one page of HTML.

use std::fmt::Write;

use serde_json::{Value, json};

use crate::run::{Frame, Side};
use crate::{CATEGORIES, Results, Row, report};

fn got(row: &Row) -> &str {
    row.got.as_ref().map_or_else(String::as_str, String::as_str)
}

fn verdict(row: &Row) -> &'static str {
    match (row.holds(), row.is_aside) {
        (true, _) => "holds",
        (false, true) => "not judged",
        (false, false) => "fails",
    }
}

fn side(frame: &Frame) -> &'static str {
    if frame.0 == Side::Client { "suite" } else { "server" }
}

/// The results as JSON.
#[must_use]
pub fn json(results: &Results) -> Value {
    let row = |row: &Row| {
        let frames: Vec<Value> = row.frames.iter().map(|frame| json!({"from": side(frame), "frame": frame.1})).collect();
        json!({
            "id": row.rule.id, "category": row.rule.category, "says": row.rule.says, "expected": row.rule.expected,
            "specification": row.rule.rests_on, "verdict": verdict(row), "counts": row.rule.counts() && !row.is_aside, "got": got(row), "cause": row.cause,
            "needs": row.needs.intersection(&results.lacking).collect::<Vec<_>>(), "frames": frames,
        })
    };
    let total = |category: &str| {
        let (holding, all) = report::count(results, category);
        match results.points.as_ref().map(|points| points.earned(results, category)) {
            None => json!({"holding": holding, "all": all}),
            Some([earned, most]) => json!({"holding": holding, "all": all, "points": earned, "most_points": most}),
        }
    };
    let totals: serde_json::Map<String, Value> = CATEGORIES.iter().map(|name| ((*name).to_owned(), total(name))).collect();
    json!({
        "address": results.address, "links": results.links, "seconds": results.time.as_secs_f64(), "good": results.is_good(),
        "totals": totals, "all": total(""), "notes": results.notes, "lacking": results.lacking,
        "rules": results.rows.iter().map(row).collect::<Vec<_>>(),
    })
}

/// A text inside XML or HTML. Characters that XML does not allow become `?`.
fn text(text: &str) -> String {
    let mut safe = String::new();
    for one in text.chars() {
        match one {
            '&' => safe += "&amp;",
            '<' => safe += "&lt;",
            '>' => safe += "&gt;",
            '"' => safe += "&quot;",
            '\u{fffe}' | '\u{ffff}' => safe.push('?'),
            one if one.is_control() && !['\n', '\t'].contains(&one) => safe.push('?'),
            one => safe.push(one),
        }
    }
    safe
}

/// The categories with their rows, remarks last.
fn parts(results: &Results) -> impl Iterator<Item = (&'static str, Vec<&Row>)> {
    let names = CATEGORIES.into_iter().chain([crate::REMARKS]);
    names
        .map(|name| (name, results.rows.iter().filter(|row| row.rule.category == name).collect::<Vec<_>>()))
        .filter(|(_, rows)| !rows.is_empty())
}

/// The results as JUnit's XML: a suite for each category.
#[must_use]
pub fn junit(results: &Results) -> String {
    let mut suites = String::new();
    let (mut tests, mut failed) = (0, 0);
    for (name, rows) in parts(results) {
        let (mut cases, mut failures, mut skipped) = (String::new(), 0, 0);
        for row in &rows {
            let id = row.rule.id;
            let head = format!(
                "    <testcase classname=\"{}\" name=\"{id}: {}\" time=\"{:.3}\"",
                text(name),
                text(row.rule.says),
                row.time.as_secs_f64()
            );
            let inner = if row.fails() {
                failures += 1;
                let cause = row.cause.as_deref().unwrap_or("no known mistake");
                let told = format!("expected: {}\ngot: {}\ncause: {cause}\n{}", row.rule.expected, got(row), row.rule.rests_on);
                format!("<failure message=\"{}\" type=\"rule\">{}</failure>", text(got(row)), text(&told))
            } else if !row.holds() {
                skipped += 1;
                format!("<skipped message=\"{}\"/>", text(got(row)))
            } else {
                String::new()
            };
            let _ = writeln!(cases, "{head}>{inner}</testcase>");
        }
        let count = rows.len();
        tests += count;
        failed += failures;
        let _ = writeln!(
            suites,
            "  <testsuite name=\"{}\" tests=\"{count}\" failures=\"{failures}\" errors=\"0\" skipped=\"{skipped}\">\n{cases}  </testsuite>",
            text(name)
        );
    }
    let seconds = results.time.as_secs_f64();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"conformance\" tests=\"{tests}\" failures=\"{failed}\" errors=\"0\" \
         time=\"{seconds:.3}\">\n{suites}</testsuites>\n"
    )
}

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222;background:#fff}\
table{border-collapse:collapse}td,th{padding:.2rem .8rem .2rem 0;text-align:left;vertical-align:top}\
.fails{color:#a00}.holds{color:#060}pre{background:#f4f4f4;padding:.5rem;overflow-x:auto;font-size:.8rem}\
details{margin:.5rem 0}svg{background:#f8f8f8}";

/// The results as one page, without scripts and without other files.
#[must_use]
pub fn html(results: &Results) -> String {
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Conformance of {0}</title><style>{STYLE}</style></head>\
         <body>\n<h1>Conformance of {0}</h1>\n<p>{1} links, {2:.0} s.</p>\n",
        text(&results.address),
        results.links,
        results.time.as_secs_f64()
    );
    for note in &results.notes {
        let _ = writeln!(page, "<p class=\"fails\">{}</p>", text(note));
    }
    page += "<table><tr><th>Category</th><th>Rules that hold</th></tr>\n";
    for (name, category) in CATEGORIES.into_iter().map(|name| (name, name)).chain([("All", "")]) {
        let (holding, all) = report::count(results, category);
        let _ = writeln!(page, "<tr><td>{name}</td><td>{holding} of {all}{}</td></tr>", report::earned(results, category));
    }
    page += "</table>\n<h2>Mend first</h2>\n";
    let (groups, rest) = report::failures(results);
    for (reason, rows) in &groups {
        let _ = writeln!(page, "<p class=\"fails\">{}: {}.</p>", text(reason), report::ids(rows));
    }
    for row in &rest {
        page += &failure(row);
    }
    if groups.is_empty() && rest.is_empty() {
        page += "<p class=\"holds\">Nothing: every rule holds.</p>\n";
    }
    for (name, rows) in parts(results) {
        let _ = writeln!(page, "<h2>{name}</h2>\n<table>");
        for row in rows {
            let (class, says) = (verdict(row), text(row.rule.says));
            let _ = writeln!(page, "<tr><td>{}</td><td class=\"{class}\">{class}</td><td>{says}</td></tr>", row.rule.id);
        }
        page += "</table>\n";
    }
    page + "</body></html>\n"
}

/// A rule that fails: its cause, its plot, and its exchange.
fn failure(row: &Row) -> String {
    let mut part = format!("<h3 class=\"fails\">{}: {}</h3>\n", row.rule.id, text(row.rule.says));
    let _ = writeln!(part, "<p>Expected: {}.<br>Got: {}.</p>", text(row.rule.expected), text(got(row)));
    if !row.rule.rests_on.is_empty() {
        let _ = writeln!(part, "<blockquote>{}</blockquote>", text(row.rule.rests_on));
    }
    if let Some(cause) = &row.cause {
        let _ = writeln!(part, "<p><strong>Cause: {}.</strong></p>", text(cause));
    }
    if let Some([expected, got]) = &row.plot {
        part += &plot(expected, got);
    }
    let frames: Vec<String> = row.frames.iter().map(|frame| format!("{:<6} {}", side(frame), text(&frame.1))).collect();
    let _ = writeln!(part, "<details><summary>Frames of both sides</summary><pre>{}</pre></details>", frames.join("\n"));
    part
}

/// Two series and their difference.
fn plot(expected: &[f64], got: &[f64]) -> String {
    let difference: Vec<f64> = got.iter().zip(expected).map(|(got, expected)| got - expected).collect();
    let all = expected.iter().chain(got).chain(&difference).copied().filter(|value| value.is_finite());
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    let scale = if high > low { 150.0 / (high - low) } else { 0.0 };
    let mut lines = String::new();
    for (name, colour, values) in [("expected", "#060", expected), ("got", "#a00", got), ("difference", "#888", &difference)] {
        let points: Vec<String> = (0_u32..)
            .zip(values)
            .filter(|(_, value)| value.is_finite())
            .map(|(at, value)| {
                format!("{:.1},{:.1}", 5.0 + 490.0 * f64::from(at) / (values.len().max(2) - 1) as f64, 155.0 - scale * (value - low))
            })
            .collect();
        let _ =
            write!(lines, "<polyline fill=\"none\" stroke=\"{colour}\" points=\"{}\"><title>{name}</title></polyline>", points.join(" "));
    }
    format!(
        "<svg viewBox=\"0 0 500 160\" width=\"500\" height=\"160\" role=\"img\" aria-label=\"expected, got, difference\">{lines}</svg>\
         <p>Green: expected. Red: got. Grey: the difference.</p>\n"
    )
}
