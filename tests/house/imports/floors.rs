//! The floors of the house: which room may name which.

use std::collections::{BTreeMap, BTreeSet};

use super::arrows::{House, PENDULARM};

/// Layers that a layer may import, besides itself: each row only rows above it.
const FLOORS: [(&str, &[&str]); 18] = [
    ("math", &[]),
    ("protocol", &[]),
    ("logging", &["protocol"]),
    ("output", &["protocol"]),
    ("address", &[]),
    ("value", &[]),
    ("study", &["math"]),
    ("services", &["math", "protocol", "study"]),
    ("live", &["math", "protocol", "services", "study"]),
    ("record", &["math", "protocol"]),
    ("web", &["protocol"]),
    ("report", &["math", "study"]),
    ("command", &["protocol", "output", "address", "value"]),
    ("plan", &["math", "study", "value"]),
    (
        "options",
        &[
            "protocol", "web", "report", "command", "logging", "address", "value", "plan",
        ],
    ),
    (
        "actors",
        &[
            "math", "protocol", "logging", "study", "services", "live", "record", "web", "options",
            "value",
        ],
    ),
    ("lib", &[]),
    (
        "main",
        &[
            "command", "logging", "output", "record", "report", "options", "plan", "actors",
        ],
    ),
];

/// The same within the protocol.
const PROTOCOL: [(&str, &[&str]); 8] = [
    ("limits", &[]),
    ("names", &[]),
    ("catalog", &["names"]),
    ("wire", &["limits", "catalog"]),
    ("messages", &["wire"]),
    ("op", &["limits", "catalog", "wire", "messages"]),
    ("outbox", &["limits", "wire"]),
    ("ros", &["names", "catalog", "messages"]),
];

/// Holds the arrows between the rooms of `folder` against its table of floors.
fn every_room_names_just_the_rooms_that_it_may(folder: &str, floors: &[(&str, &[&str])]) {
    for (row, (floor, may)) in floors.iter().enumerate() {
        let stands = |name: &&&str| floors[..row].iter().any(|(above, _)| *above == **name);
        assert_eq!(
            may.iter().filter(stands).count(),
            may.len(),
            "{floor} may name what has a row below its own"
        );
    }
    let room = |path: &str| {
        let path = path.strip_prefix(folder)?;
        let room = path.split(['/', '.']).next()?;
        (room != "mod").then(|| room.to_owned())
    };
    let house = House::read(&PENDULARM);
    let files = house.modules.values();
    let mut found: BTreeMap<String, BTreeSet<String>> = files
        .filter_map(|file| Some((room(&file.path)?, BTreeSet::new())))
        .collect();
    for (from, to) in house.arrows().keys() {
        if let (Some(from), Some(to)) = (room(from), room(to))
            && from != to
        {
            found.entry(from).or_default().insert(to);
        }
    }
    let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
    let allowed: BTreeMap<String, BTreeSet<String>> = floors
        .iter()
        .map(|(floor, may)| ((*floor).to_owned(), owned(may)))
        .collect();
    assert_eq!(found, allowed, "left: as it is; right: the table");
}

#[test]
fn every_floor_names_just_the_floors_that_it_may() {
    every_room_names_just_the_rooms_that_it_may("", &FLOORS);
    every_room_names_just_the_rooms_that_it_may("protocol/", &PROTOCOL);
}
