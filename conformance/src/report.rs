//! The results for a reader: lines of at most 120 characters, with the rules that fail last.

use std::collections::BTreeSet;

use crate::mistakes::Subject;
use crate::{CATEGORIES, Results, Row};

/// The longest line.
const WIDTH: usize = 120;
/// Rules about the equations of motion.
const EQUATIONS: [&str; 5] = ["dynamics-2", "dynamics-3", "dynamics-5", "dynamics-6", "dynamics-7"];
/// Rules about the methods of the live arm. They all fail if the equations are wrong.
const STEPS: [&str; 4] = ["set_integrator-6", "set_integrator-7", "set_integrator-8", "set_integrator-9"];
/// Further rules that need right equations.
const FOLLOWING: [&str; 2] = ["set_params-8", "pause-3"];

/// Rules that fail for one reason: the reason, and the rules.
pub type Group<'a> = (String, Vec<&'a Row>);

/// The rules that fail, with those of one reason together. A rule with a reason of its own has no group.
#[must_use]
pub fn failures(results: &Results) -> (Vec<Group<'_>>, Vec<&Row>) {
    let mut rest: Vec<&Row> = results.rows.iter().filter(|row| row.fails()).collect();
    let mut groups = Vec::new();
    let (folded, others): (Vec<&Row>, Vec<&Row>) = rest.into_iter().partition(|row| !row.needs.is_disjoint(&results.lacking));
    rest = others;
    if !folded.is_empty() {
        let services: BTreeSet<&String> = folded.iter().flat_map(|row| row.needs.intersection(&results.lacking)).collect();
        let services: Vec<&str> = services.into_iter().map(String::as_str).collect();
        groups.push((format!("{} {}, which the server lacks", rules(folded.len(), "need"), either(&services)), folded));
    }
    let fails = |id: &str| rest.iter().any(|row| row.rule.id == id);
    if STEPS.iter().all(|id| fails(id)) && EQUATIONS.iter().any(|id| fails(id)) {
        let follows = |row: &&Row| STEPS.contains(&row.rule.id) || FOLLOWING.contains(&row.rule.id);
        let (folded, others): (Vec<&Row>, Vec<&Row>) = rest.into_iter().partition(follows);
        rest = others;
        groups.push((format!("{} on the equations of motion: mend the rules dynamics-2 to -7 first", rules(folded.len(), "rest")), folded));
    }
    (groups, rest)
}

/// `1 rule needs`, `2 rules need`.
fn rules(count: usize, verb: &str) -> String {
    let (plural, singular) = if count == 1 { ("", "s") } else { ("s", "") };
    format!("{count} rule{plural} {verb}{singular}")
}

/// `a, b or c`.
fn either(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => (*one).to_owned(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

/// The ids of rules: `ik-1, -2, goal-1`.
#[must_use]
pub fn ids(rows: &[&Row]) -> String {
    let mut section = "";
    let short = |row: &&Row| {
        let (name, number) = row.rule.id.rsplit_once('-').unwrap_or((row.rule.id, ""));
        let is_same = std::mem::replace(&mut section, name) == name;
        if is_same { format!("-{number}") } else { row.rule.id.to_owned() }
    };
    rows.iter().map(short).collect::<Vec<_>>().join(", ")
}

/// One line for a rule that holds, or cannot be judged.
#[must_use]
pub fn line(row: &Row) -> String {
    let (mark, more) = match &row.got {
        Ok(_) => ("ok", String::new()),
        Err(why) if row.is_aside => ("--", format!(": not judged: {why}")),
        Err(_) => ("FAIL", String::new()),
    };
    wrapped(&format!("{mark:<4} {:<17} ", row.rule.id), &format!("{}{more}", row.rule.says))
}

/// A rule that does not hold.
#[must_use]
pub fn paragraph(row: &Row) -> String {
    let got = row.got.as_ref().map_or_else(String::as_str, String::as_str);
    let mut text = line(row);
    text += &wrapped("     expected: ", row.rule.expected);
    text += &wrapped("     got: ", got);
    match &row.cause {
        Some(cause) => text += &wrapped("     cause: ", cause),
        None if Subject::of(row.rule.id).is_some() => text += "     cause: no known mistake\n",
        None => {}
    }
    text
}

/// What follows the rules that hold: remarks, rules that fail, notes, and totals.
#[must_use]
pub fn summary(results: &Results) -> String {
    let mut text = String::new();
    let remarks: Vec<&Row> = results.rows.iter().filter(|row| !row.rule.counts() && !row.holds()).collect();
    for row in remarks {
        let got = row.got.as_ref().map_or_else(String::as_str, String::as_str);
        text += &wrapped("remark: ", &format!("{}; expected: {}; got: {got} (does not count)", row.rule.says, row.rule.expected));
    }
    let (groups, rest) = failures(results);
    for (reason, rows) in groups {
        text.push('\n');
        text += &wrapped("FAIL ", &format!("{reason}: {}", ids(&rows)));
    }
    for row in rest {
        text.push('\n');
        text += &paragraph(row);
    }
    text.push('\n');
    for note in &results.notes {
        text += &wrapped("note: ", note);
    }
    text + &totals(results)
}

/// Rules of a category that hold, and rules that count; all for an empty name.
#[must_use]
pub fn count(results: &Results, category: &str) -> (usize, usize) {
    let counting = results.rows.iter().filter(|row| row.counts_for(category));
    counting.fold((0, 0), |(holding, all), row| (holding + usize::from(row.holds()), all + 1))
}

/// The totals, one line a category.
#[must_use]
pub fn totals(results: &Results) -> String {
    let named = CATEGORIES.into_iter().map(|name| (name, name)).chain([("All", "")]);
    let lines = named.map(|(name, category)| {
        let (holding, all) = count(results, category);
        format!("{name:<30} {holding:>3} of {all:>3}{}\n", earned(results, category))
    });
    lines.collect()
}

/// The earned points of a category, if points are given.
#[must_use]
pub fn earned(results: &Results, category: &str) -> String {
    let earned = results.points.as_ref().map(|points| points.earned(results, category));
    earned.map_or_else(String::new, |[earned, all]| format!(", {earned} of {all} points"))
}

/// A text in lines of at most [`WIDTH`] characters. The first one begins with `head`, the others with as many spaces.
fn wrapped(head: &str, text: &str) -> String {
    let indent = head.chars().count().min(WIDTH / 2);
    let room = WIDTH - indent;
    let (mut lines, mut line, mut length) = (Vec::new(), String::new(), 0);
    for word in text.split_whitespace() {
        let mut word: Vec<char> = word.chars().collect();
        while !word.is_empty() {
            let space = usize::from(length > 0);
            if length + space + word.len() > room && length > 0 {
                lines.push(std::mem::take(&mut line));
                length = 0;
                continue;
            }
            let part: String = word.drain(..word.len().min(room)).collect();
            length += space + part.chars().count();
            if space == 1 {
                line.push(' ');
            }
            line += &part;
        }
    }
    lines.push(line);
    let spaces = " ".repeat(indent);
    let shown = lines.iter().enumerate().map(|(at, line)| format!("{}{line}\n", if at == 0 { head } else { &spaces }));
    shown.collect()
}
