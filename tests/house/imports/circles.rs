//! Circles of arrows: between files, and between the rooms of a folder.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use super::arrows::{Arrows, House, PACKAGES};

/// All that stand in a circle, and how: the arrows whose end leads back to their beginning.
fn circles(arrows: &Arrows) -> (BTreeSet<String>, String) {
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
    let (mut standing, mut shown) = (BTreeSet::new(), String::new());
    for ((from, to), names) in arrows {
        if reaches(to, from) {
            standing.extend([from.clone(), to.clone()]);
            let _ = writeln!(shown, "  {from} -> {to}: {names:?}");
        }
    }
    (standing, shown)
}

fn assert_none((standing, shown): (BTreeSet<String>, String)) {
    assert!(standing.is_empty(), "in a circle: {standing:#?}\n{shown}");
}

#[test]
fn no_import_runs_in_a_circle_between_files() {
    for package in &PACKAGES {
        assert_none(circles(&House::read(package).arrows()));
    }
}

/// Each folder contains its files and folders. Its own `mod.rs` stands for the folder itself.
#[test]
fn no_import_runs_in_a_circle_between_the_rooms_of_a_folder() {
    for package in &PACKAGES {
        assert_none(circles(&rooms(House::read(package).arrows())));
    }
}

/// Arrows between rooms.
fn rooms(files: Arrows) -> Arrows {
    let mut rooms = Arrows::new();
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
            let ends = [from, to].map(|room| [shared.as_slice(), &[room]].concat().join("/"));
            let [from, to] = ends;
            rooms.entry((from, to)).or_default().extend(names);
        }
    }
    rooms
}
