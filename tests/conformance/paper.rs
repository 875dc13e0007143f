//! `docs/conformance.md` has every rule with its ground, and `--strict-specification` leaves those without one off.

use std::fmt::Write;

use pendularm_conformance::command::list;
use pendularm_conformance::{CATEGORIES, REMARKS, Selection, launch, rules};

use crate::papers;

/// The section of the document, from the table of rules.
fn section() -> String {
    let mut paper = String::new();
    // Marks of Markdown are text here.
    let plain = |text: &str| ['|', '*', '<', '['].iter().fold(text.to_owned(), |text, mark| text.replace(*mark, &format!("\\{mark}")));
    for category in CATEGORIES.into_iter().chain([REMARKS]) {
        let _ = write!(paper, "\n### {category}\n\n| rule | what it says | words of the specification |\n| --- | --- | --- |\n");
        for rule in rules::all().chain(launch::RULES).filter(|rule| rule.category == category) {
            let ground = if rule.rests_on.is_empty() { "**common sense**".to_owned() } else { plain(rule.rests_on) };
            let _ = writeln!(paper, "| `{}` | {} | {ground} |", rule.id, plain(rule.says));
        }
    }
    paper
}

#[test]
fn the_document_has_each_rule_with_the_words_that_it_rests_on() {
    let (paper, expected) = (papers::text("docs/conformance.md"), section());
    let (_, found) = paper.split_once("\n### Integrators\n").map(|(before, _)| paper.split_at(before.len())).unwrap();
    if found != expected {
        let right = concat!(env!("CARGO_TARGET_TMPDIR"), "/rules.md");
        std::fs::write(right, expected).unwrap();
        panic!("the rules in docs/conformance.md are not those of rules.txt: the right ones are in {right}");
    }
}

#[test]
fn the_strict_specification_leaves_off_what_rests_on_common_sense() {
    let strict = list(&Selection { is_strict: true, ..Selection::default() });
    let all = list(&Selection::default());
    let left_off: Vec<&str> = all.iter().filter(|rule| !strict.iter().any(|one| one.id == rule.id)).map(|rule| rule.id).collect();
    let expected = "envelope-7 trajectory-6 trajectory-7 trajectory-8 reset-6 enable-7 pace-1 pace-2 launch-3 launch-4 launch-5";
    assert_eq!(left_off.join(" "), expected);
    // A ground is a sentence or a part of one, and no summary.
    assert!(strict.iter().all(|rule| rule.rests_on.len() >= 15 && rule.counts()), "a remark has no ground");
}
