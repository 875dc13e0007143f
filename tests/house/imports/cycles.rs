//! Cycles of arrows: between files, and between the subfolders of a folder.

use std::collections::{BTreeMap, BTreeSet};

use super::arrows::{Arrows, PACKAGES, SourceTree};

/// No arrow's end leads back to its beginning.
fn assert_no_cycle(arrows: &Arrows) {
    let mut next: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (from, to) in arrows.keys() {
        next.entry(from).or_default().push(to);
    }
    let reaches = |from: &str, goal: &str| {
        let (mut open, mut seen) = (vec![from], BTreeSet::new());
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
    let in_cycle = arrows.iter().filter(|((from, to), _)| reaches(to, from));
    let shown = in_cycle.map(|((from, to), names)| format!("{from} -> {to}: {names:?}"));
    let shown: Vec<String> = shown.collect();
    assert!(shown.is_empty(), "in a cycle: {shown:#?}");
}

#[test]
fn imports_between_files_have_no_cycle() {
    for package in PACKAGES {
        assert_no_cycle(&SourceTree::read(package).arrows());
    }
}

/// Each folder contains its files and folders. Its own `mod.rs` is the folder itself.
#[test]
fn imports_between_folders_have_no_cycle() {
    for package in PACKAGES {
        assert_no_cycle(&folders(SourceTree::read(package).arrows()));
    }
}

/// Arrows between folders.
fn folders(files: Arrows) -> Arrows {
    let mut folders = Arrows::new();
    for ((from, to), names) in files {
        let (from, to) = (from.split('/'), to.split('/'));
        let pairs = from.clone().zip(to.clone()).take_while(|(a, b)| a == b);
        let shared: Vec<&str> = pairs.map(|(a, _)| a).collect();
        let [from, to] = [from, to].map(|mut path| path.nth(shared.len()).unwrap_or_default());
        if ![from, to].contains(&"mod.rs") {
            let ends = [from, to].map(|folder| [shared.as_slice(), &[folder]].concat().join("/"));
            let [from, to] = ends;
            folders.entry((from, to)).or_default().extend(names);
        }
    }
    folders
}
