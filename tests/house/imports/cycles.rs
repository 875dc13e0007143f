//! Cycles of arrows: between files, and between the subfolders of a folder.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use super::arrows::{Arrows, PACKAGES, SourceTree};

/// The arrows that are part of a cycle: their end leads back to their beginning.
fn cycles(arrows: &Arrows) -> (BTreeSet<String>, String) {
    let mut next: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (from, to) in arrows.keys() {
        next.entry(from).or_default().push(to);
    }
    let reaches = |from: &str, goal: &str| {
        let mut open = vec![from];
        let mut seen = BTreeSet::new();
        while let Some(one) = open.pop() {
            if one == goal {
                return true;
            }
            if seen.insert(one.to_owned()) {
                open.extend(next.get(one).into_iter().flatten());
            }
        }
        false
    };
    let (mut in_cycle, mut shown) = (BTreeSet::new(), String::new());
    for ((from, to), names) in arrows {
        if reaches(to, from) {
            in_cycle.extend([from.clone(), to.clone()]);
            let _ = writeln!(shown, "  {from} -> {to}: {names:?}");
        }
    }
    (in_cycle, shown)
}

fn assert_none((in_cycle, shown): (BTreeSet<String>, String)) {
    assert!(in_cycle.is_empty(), "in a cycle: {in_cycle:#?}\n{shown}");
}

#[test]
fn imports_between_files_have_no_cycle() {
    for package in &PACKAGES {
        assert_none(cycles(&SourceTree::read(package).arrows()));
    }
}

/// Each folder contains its files and folders. Its own `mod.rs` is the folder itself.
#[test]
fn imports_between_folders_have_no_cycle() {
    for package in &PACKAGES {
        assert_none(cycles(&folders(SourceTree::read(package).arrows())));
    }
}

/// Arrows between folders.
fn folders(files: Arrows) -> Arrows {
    let mut folders = Arrows::new();
    for ((from, to), names) in files {
        let (from, to) = (from.split('/'), to.split('/'));
        let shared: Vec<&str> = from
            .clone()
            .zip(to.clone())
            .take_while(|(a, b)| a == b)
            .map(|(a, _)| a)
            .collect();
        let [from, to] = [from, to].map(|mut path| path.nth(shared.len()).unwrap_or_default());
        if ![from, to].contains(&"mod.rs") {
            let ends = [from, to].map(|folder| [shared.as_slice(), &[folder]].concat().join("/"));
            let [from, to] = ends;
            folders.entry((from, to)).or_default().extend(names);
        }
    }
    folders
}
