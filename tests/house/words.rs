//! Sentences in documents and comments: few are long.
//!
//! **Invariant:** code, tables and headings are not sentences. Every other sentence of the tree is counted.

use std::ffi::OsStr;
use std::fs;
use std::path::PathBuf;

use crate::tree::{files_in, root};

/// Longest sentence, in words. A piece of code counts as one.
const MAX_WORDS: usize = 30;
/// One in this many sentences may be longer.
const ONE_IN: usize = 100;

/// A paragraph, and the line that it begins on.
type Paragraph = (usize, String);

/// The text of a comment's line; `None` for a line of code.
fn comment<'a>(line: &'a str, mark: &str) -> Option<&'a str> {
    let line = line.trim();
    if mark == "//" {
        let mut marks = ["//!", "///", "//", "/**", "*/", "*"].iter();
        let body = marks.find_map(|start| line.strip_prefix(start))?;
        return Some(
            body.trim_start_matches(['/', '!'])
                .trim()
                .trim_end_matches("*/")
                .trim(),
        );
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
        let next = words.get(place + 1).copied().unwrap_or_default();
        let next = next.trim_start_matches(['(', '"', '\'', '*', '[', '_']);
        let begins = next.starts_with(char::is_uppercase) || next.starts_with('x');
        if ends.ends_with(['.', '!', '?']) && begins {
            found.push(String::new());
        }
    }
    found
}

fn is_long(sentence: &str) -> bool {
    let is_word = |one: &&str| one.contains(|letter: char| letter.is_ascii_alphanumeric());
    sentence.split_whitespace().filter(is_word).count() > MAX_WORDS
}

#[test]
fn few_sentences_are_long() {
    let (mut count, mut found) = (0, Vec::new());
    // The kept report is made by the program, whose sentences are counted in its source.
    let is_made = |path: &PathBuf| path.starts_with(root().join("docs/report"));
    let written = files_in("", &["md", "rs", "js", "mjs", "py", "sh", "toml"]);
    for path in written.into_iter().filter(|path| !is_made(path)) {
        let extension = path.extension().and_then(OsStr::to_str).unwrap_or_default();
        let text = fs::read_to_string(&path).unwrap();
        for (line, paragraph) in paragraphs(&text, extension) {
            for sentence in sentences(&without_code(&paragraph)) {
                count += 1;
                if is_long(&sentence) {
                    let place = path.strip_prefix(root()).unwrap().display();
                    found.push(format!("{place}:{line}: {sentence}"));
                }
            }
        }
    }
    let told = format!(
        "{} of {count} sentences:\n{}",
        found.len(),
        found.join("\n")
    );
    assert!(count > 5000 && found.len() <= count / ONE_IN, "{told}");
}
