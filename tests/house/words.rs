//! Sentences in documents and comments: their length, and their subjects.
//!
//! **Invariant:** code, tables and headings are not sentences. Every other sentence of the tree is counted.

use std::fs;

use crate::tree::{files, root};

/// Longest sentence, in words. A piece of code counts as one.
const MAX_WORDS: usize = 30;
/// Forbidden beginnings of a sentence, and of its parts after a colon or a semicolon: a subject has a name.
const SUBJECTS: [&str; 9] = [
    "what", "whatever", "who", "whoever", "whose", "those", "of those", "so many", "so much",
];
/// One in this many sentences may break a rule.
const ONE_IN: usize = 100;

/// A paragraph, and the line that it begins on.
type Paragraph = (usize, String);

/// The text of a comment's line; `None` for a line of code.
fn comment<'a>(line: &'a str, mark: &str) -> Option<&'a str> {
    let line = line.trim();
    if mark == "//" {
        let block = ["/**", "*/", "*"]
            .iter()
            .find_map(|start| line.strip_prefix(start));
        let body = line
            .strip_prefix("//")
            .map(|body| body.trim_start_matches(['/', '!']))
            .or(block);
        return body.map(|body| body.trim().trim_end_matches("*/").trim());
    }
    let body = line.strip_prefix('#').filter(|body| !body.starts_with('!'));
    body.map(|body| body.trim_start_matches('#').trim())
}

/// The paragraphs of a file's prose.
fn paragraphs(text: &str, extension: &str) -> Vec<Paragraph> {
    let mark = match extension {
        "md" => "",
        "rs" | "js" | "mjs" => "//",
        _ => "#",
    };
    let mut found: Vec<Paragraph> = Vec::new();
    let mut is_open = false;
    let mut is_code = false;
    for (number, line) in (1..).zip(text.lines()) {
        let body = if mark.is_empty() {
            Some(line.trim())
        } else {
            comment(line, mark)
        };
        let Some(body) = body else {
            (is_open, is_code) = (false, false);
            continue;
        };
        let is_fence = body.starts_with("```");
        is_code ^= is_fence;
        // A table, a heading, markup, a rule, a tag, or where a link leads.
        let is_apart = body.starts_with(['|', '#', '<', '!', '@']) || body.starts_with("---");
        let is_link = body.starts_with('[') && body.contains("]: ");
        if body.is_empty() || is_code || is_fence || is_apart || is_link {
            is_open = false;
            continue;
        }
        let digits = body.trim_start_matches(|one: char| one.is_ascii_digit());
        let item = body.strip_prefix("- ").or(body.strip_prefix("* "));
        let item = item.or(digits.strip_prefix(". ").filter(|_| digits != body));
        if !is_open || item.is_some() {
            found.push((number, String::new()));
        }
        is_open = true;
        let paragraph = &mut found.last_mut().unwrap().1;
        paragraph.push(' ');
        paragraph.push_str(item.unwrap_or(body));
    }
    found
}

/// The same with `x` in place of each piece of code and each address.
fn without_code(paragraph: &str) -> String {
    let mut plain = String::new();
    for (place, piece) in paragraph.split('`').enumerate() {
        plain.push_str(if place % 2 == 0 { piece } else { "x" });
    }
    let mut rest = plain.as_str();
    let mut text = String::new();
    while let Some(start) = rest.find("](") {
        let (before, link) = rest.split_at(start);
        text.push_str(before);
        rest = link.find(')').map_or("", |end| &link[end..]);
    }
    text + rest
}

/// The sentences of a paragraph: each ends with a mark before a space and a capital letter, or code.
fn sentences(paragraph: &str) -> Vec<String> {
    let mut found = vec![String::new()];
    let words: Vec<&str> = paragraph.split_whitespace().collect();
    for (place, word) in words.iter().enumerate() {
        let sentence = found.last_mut().unwrap();
        sentence.push_str(word);
        sentence.push(' ');
        let ends = word.trim_end_matches([')', '"', '\'', '*']);
        let next = words
            .get(place + 1)
            .map(|next| next.trim_start_matches(['(', '"', '\'', '*', '[', '_']));
        let begins =
            next.is_some_and(|next| next.starts_with(char::is_uppercase) || next.starts_with("x"));
        if ends.ends_with(['.', '!', '?']) && begins {
            found.push(String::new());
        }
    }
    found
}

/// Why a sentence breaks a rule, if it does.
fn fault(sentence: &str) -> Option<String> {
    let is_word = |one: &&str| one.contains(|letter: char| letter.is_ascii_alphanumeric());
    let words = sentence.split_whitespace().filter(is_word).count();
    if words > MAX_WORDS {
        return Some(format!("{words} words"));
    }
    let lower = sentence.to_lowercase();
    let clauses = lower.split([':', ';']).enumerate();
    for (place, clause) in clauses {
        // A colon within a name such as `math::arm` begins no clause.
        let is_clause = place == 0 || clause.starts_with(' ');
        let clause = clause.trim_start_matches(|one: char| !one.is_alphanumeric());
        let subject = SUBJECTS.iter().find(|subject| {
            let rest = clause.strip_prefix(**subject);
            rest.is_some_and(|rest| {
                !rest.starts_with(|one: char| one.is_alphanumeric() || one == '\'')
            })
        });
        if let Some(subject) = subject.filter(|_| is_clause) {
            return Some(format!("begins with {subject:?}"));
        }
    }
    None
}

#[test]
fn a_long_sentence_and_a_nameless_subject_are_found_and_no_others() {
    let long = "word ".repeat(31);
    for (text, faults) in [
        ("/// The arm stands still.\n/// Who asks is told.", 1),
        ("//! One thing: what comes is read.", 1),
        (&*format!("// {long}."), 1),
        (&*format!("// `{long}` is code."), 0),
        ("// It says what it does.\nlet who = \"Who is there?\";", 0),
        ("//! ```text\n//! Those are code.\n//! ```", 0),
        ("//! | what | that |", 0),
        ("//! [`What`]: path::What", 0),
    ] {
        let found = paragraphs(text, "rs");
        let sentences = found
            .iter()
            .flat_map(|(_, one)| sentences(&without_code(one)));
        assert_eq!(
            sentences.filter_map(|one| fault(&one)).count(),
            faults,
            "{text}"
        );
    }
}

#[test]
fn sentences_are_short_and_their_subjects_have_names() {
    let (mut count, mut found) = (0, Vec::new());
    for path in files(root()) {
        let extension = path
            .extension()
            .and_then(|one| one.to_str())
            .unwrap_or_default();
        // The kept report is made by the program, whose sentences are counted in its source.
        let is_made = path.starts_with(root().join("docs/report"));
        if !["md", "rs", "js", "mjs", "py", "sh", "toml"].contains(&extension) || is_made {
            continue;
        }
        let Ok(text) = fs::read_to_string(&path) else {
            continue;
        };
        for (line, paragraph) in paragraphs(&text, extension) {
            for sentence in sentences(&without_code(&paragraph)) {
                count += 1;
                if let Some(fault) = fault(&sentence) {
                    let place = path.strip_prefix(root()).unwrap().display();
                    found.push(format!("{place}:{line}: {fault}: {sentence}"));
                }
            }
        }
    }
    let allowed = count / ONE_IN;
    let are_few = found.len() <= allowed;
    assert!(
        are_few,
        "{} of {count} sentences, {allowed} allowed:\n{}",
        found.len(),
        found.join("\n")
    );
}
