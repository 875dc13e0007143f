//! How the source is cut and worded: short files, short lines, one style of modules, plain words.
//!
//! **Invariant:** where something is still to be mended, its place or its number is in `standing.rs`, and that can only
//! shrink: a test fails as well when less is found than is listed.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{TokenStream, TokenTree};

use crate::standing;
use crate::tree::rust_files;

/// Longest file, in lines: more than can be taken in at one sitting.
const MAX_LINES: usize = 400;
/// Longest line, in characters.
const MAX_WIDTH: usize = 120;

/// In this file each link has a tip, of which one at most is the end effector.
const LINKS_HAVE_TIPS: &str = "math/dynamics/articulated_body.rs";
/// Words that a sentence about code does well without: who begins with one has to be read twice.
const DANGLING: [&str; 6] = ["What", "Whatever", "Whoever", "Of", "That", "Those"];
fn source() -> impl Iterator<Item = (String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    rust_files("src").into_iter().map(move |path: PathBuf| {
        let text = fs::read_to_string(&path).unwrap();
        let path = path.strip_prefix(&folder).unwrap();
        (path.to_str().unwrap().to_owned(), text)
    })
}

/// Compares what is found with how much of it is known.
fn holds(what: &str, known: usize, found: &[String]) {
    assert!(
        found.len() <= known,
        "{what}: {known} are known, and there are {}:\n{}",
        found.len(),
        found.join("\n")
    );
    assert!(
        found.len() == known,
        "{what}: only {} are left; the number listed is {known}",
        found.len()
    );
}

/// Code and comment of a line.
fn halves(line: &str) -> (&str, &str) {
    line.split_once("//").unwrap_or((line, ""))
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|one: char| !(one.is_alphanumeric() || one == '_'))
}

#[test]
fn no_file_is_longer_than_a_reader_takes_in() {
    let long: BTreeSet<String> = source()
        .filter(|(_, text)| text.lines().count() > MAX_LINES)
        .map(|(path, _)| path)
        .collect();
    let listed = standing::LONG_FILES
        .iter()
        .map(|&path| path.to_owned())
        .collect();
    assert_eq!(long, listed, "left: too long; right: listed as such");
}

#[test]
fn no_line_is_longer_than_a_screen_is_wide() {
    let mut long = Vec::new();
    for (path, text) in source() {
        for (number, line) in (1..).zip(text.lines()) {
            if line.chars().count() > MAX_WIDTH {
                long.push(format!("{path}:{number}"));
            }
        }
    }
    holds("lines that are too long", standing::LONG_LINES, &long);
}

#[test]
fn a_folder_of_modules_is_opened_by_its_mod_rs() {
    for path in rust_files("src") {
        let folder = path.with_extension("");
        assert!(
            !folder.is_dir(),
            "{} stands beside its folder",
            path.display()
        );
    }
}

#[test]
fn nobody_reaches_three_floors_up() {
    for (path, text) in source() {
        assert!(!text.contains("super::super::super"), "{path}");
    }
}

#[test]
fn comments_are_sentences_that_begin_with_their_subject_or_their_verb() {
    let mut dangling = Vec::new();
    for (path, text) in source() {
        let mut before = "";
        for (number, line) in (1..).zip(text.lines()) {
            let line = line.trim_start();
            // The first line of a comment, or the first behind an empty one.
            let comment = line
                .strip_prefix("//")
                .map(|rest| rest.trim_start_matches(['/', '!']));
            let opens =
                !before.starts_with("//") || before.trim_matches(['/', '!', ' ']).is_empty();
            before = line;
            if let Some(first) = comment
                .filter(|_| opens)
                .and_then(|text| words(text.trim()).next())
                && DANGLING.contains(&first)
            {
                dangling.push(format!("{path}:{number}: {line}"));
            }
        }
    }
    holds(
        "comments that dangle",
        standing::DANGLING_COMMENTS,
        &dangling,
    );
}

/// Every name in the code, of macros' arguments too; text and comments are none.
fn names(tokens: TokenStream, found: &mut Vec<String>) {
    for token in tokens {
        match token {
            TokenTree::Ident(name) => found.push(name.to_string()),
            TokenTree::Group(group) => names(group.stream(), found),
            TokenTree::Punct(_) | TokenTree::Literal(_) => {}
        }
    }
}

/// The types that a file defines. A `type` within a trait or its implementation defines none.
fn types(tokens: TokenStream, found: &mut Vec<String>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    for pair in tokens.windows(2) {
        if let [TokenTree::Ident(keyword), TokenTree::Ident(name)] = pair
            && ["struct", "enum", "trait", "type"].contains(&keyword.to_string().as_str())
        {
            found.push(name.to_string());
        }
    }
}

#[test]
fn no_two_types_have_one_name() {
    let mut files: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (path, text) in source() {
        let mut defined = Vec::new();
        types(text.parse().unwrap(), &mut defined);
        for name in defined {
            files.entry(name).or_default().push(path.clone());
        }
    }
    files.retain(|_, places| places.len() > 1);
    let found: BTreeSet<&str> = files.keys().map(String::as_str).collect();
    let listed: BTreeSet<&str> = standing::NAMESAKES.iter().copied().collect();
    let gone: Vec<_> = listed.difference(&found).collect();
    assert!(
        gone.is_empty(),
        "one thing by now, to be struck from the list: {gone:?}"
    );
    files.retain(|name, _| !listed.contains(name.as_str()));
    assert!(files.is_empty(), "two things of one name: {files:#?}");
}

#[test]
fn names_are_the_fields_and_say_one_thing() {
    for (banned, known) in standing::NAMES {
        let mut found = Vec::new();
        for (path, text) in source() {
            let mut here = Vec::new();
            names(text.parse().unwrap(), &mut here);
            if path == LINKS_HAVE_TIPS && banned.eq_ignore_ascii_case("tip") {
                continue;
            }
            let is_banned = |name: &String| {
                let rest = name.replace("at_hand", "");
                let rest = if banned == "hand" {
                    rest.replace("by_hand", "")
                } else {
                    rest
                };
                format!("_{rest}_").contains(&format!("_{banned}_"))
            };
            here.retain(is_banned);
            found.extend(here.iter().map(|name| format!("{path}: {name}")));
        }
        holds(banned, known, &found);
    }
}

#[test]
fn comments_say_end_effector() {
    let mut found = Vec::new();
    for (path, text) in source() {
        if path == LINKS_HAVE_TIPS {
            continue;
        }
        for (number, line) in (1..).zip(text.lines()) {
            let comment = halves(line).1.replace("by hand", "").replace("at hand", "");
            let here = words(&comment).any(|word| ["hand", "hand's", "tip"].contains(&word));
            if here {
                found.push(format!("{path}:{number}: {line}"));
            }
        }
    }
    holds(
        "comments that say hand or tip",
        standing::HANDS_IN_COMMENTS,
        &found,
    );
}
