//! The layers: which folder may import which.

use std::collections::{BTreeMap, BTreeSet};

use super::arrows::{PENDULARM, SourceTree};

/// Layers that a layer may import, besides itself. A row names only rows above it.
const LAYERS: [(&str, &[&str]); 22] = [
    ("math", &[]),
    ("protocol", &[]),
    ("logging", &["protocol"]),
    ("output", &["protocol"]),
    ("address", &[]),
    ("value", &[]),
    ("signals", &[]),
    ("study", &["math"]),
    ("services", &["math", "protocol", "study"]),
    ("live", &["math", "protocol", "services", "study"]),
    ("record", &["math", "protocol"]),
    ("web", &["protocol", "address", "value"]),
    ("report", &["math", "protocol", "services", "study"]),
    (
        "command",
        &["protocol", "output", "address", "value", "signals"],
    ),
    ("plan", &["math", "study", "value"]),
    ("score", &["math"]),
    ("referee", &["output", "value", "signals"]),
    ("sabotage", &["output", "signals"]),
    (
        "options",
        &[
            "protocol", "web", "report", "command", "logging", "address", "value", "plan",
            "referee", "sabotage",
        ],
    ),
    (
        "actors",
        &[
            "math", "protocol", "logging", "study", "services", "live", "record", "web", "options",
            "address", "value", "signals",
        ],
    ),
    ("lib", &[]),
    (
        "main",
        &[
            "command", "logging", "output", "record", "report", "options", "plan", "score",
            "actors", "signals", "referee", "sabotage",
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
    ("outbox", &["catalog", "limits", "wire"]),
    ("ros", &["names", "catalog", "messages", "wire"]),
];

/// Compares the arrows between the subfolders of `folder` with its table of layers.
fn every_folder_imports_only_allowed_folders(folder: &str, layers: &[(&str, &[&str])]) {
    for (row, (layer, may)) in layers.iter().enumerate() {
        let is_above = |name: &&str| layers[..row].iter().any(|(above, _)| above == name);
        let told = format!("{layer} may import only layers with a row above its own");
        assert!(may.iter().all(is_above), "{told}");
    }
    let folder = |path: &str| {
        let path = path.strip_prefix(folder)?;
        let folder = path.split(['/', '.']).next()?;
        (folder != "mod").then(|| folder.to_owned())
    };
    let tree = SourceTree::read(PENDULARM);
    let folders = tree.modules.values().filter_map(|file| folder(&file.path));
    let mut found: BTreeMap<String, BTreeSet<String>> =
        folders.map(|folder| (folder, BTreeSet::new())).collect();
    for (from, to) in tree.arrows().keys() {
        if let (Some(from), Some(to)) = (folder(from), folder(to))
            && from != to
        {
            found.entry(from).or_default().insert(to);
        }
    }
    let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
    let allowed = layers
        .iter()
        .map(|(layer, may)| ((*layer).to_owned(), owned(may)));
    let allowed: BTreeMap<String, BTreeSet<String>> = allowed.collect();
    assert_eq!(found, allowed, "left: the source; right: the table");
}

#[test]
fn every_layer_imports_only_allowed_layers() {
    every_folder_imports_only_allowed_folders("", &LAYERS);
    every_folder_imports_only_allowed_folders("protocol/", &PROTOCOL);
}
