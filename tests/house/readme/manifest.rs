//! The manifests: dependencies and their reasons, licences, and the oldest compiler.

use std::collections::BTreeSet;
use std::process::Command;

use super::{codes, printed};
use crate::papers::{table, text};

#[test]
fn the_papers_have_a_reason_for_every_dependency() {
    let manifest = text("Cargo.toml");
    let is_named = |section: &&str| section.lines().next().unwrap().ends_with("dependencies]");
    let dependencies: BTreeSet<String> = manifest
        .split("\n[")
        .filter(is_named)
        .flat_map(str::lines)
        .filter_map(|line| Some(line.split_once(" =")?.0.to_owned()))
        .collect();
    let mut named = BTreeSet::new();
    for row in table(&text("docs/development.md"), "crate") {
        assert!(row[1].len() > 10, "no reason: {row:?}");
        named.insert(codes(&row[0])[0].to_owned());
    }
    assert_eq!(named, dependencies);
}

#[test]
fn the_licence_files_are_those_that_the_manifest_names() {
    assert!(text("Cargo.toml").contains("license = \"MIT OR Apache-2.0\""));
    assert!(text("LICENSE-MIT").contains("Permission is hereby granted, free of charge"));
    assert!(text("LICENSE-APACHE").contains("Apache License"));
}

/// `homepage` in `Cargo.toml` is the one place of the address of the public pages.
#[test]
fn every_link_to_the_public_pages_has_the_address_of_the_manifest() {
    let manifest = text("Cargo.toml");
    let (_, address) = manifest.split_once("\nhomepage = \"").unwrap();
    let (address, _) = address.split_once('"').unwrap();
    assert!(text("python/pyproject.toml").contains(&format!("\nHomepage = \"{address}\"\n")));
    let readme = text("README.md");
    assert_eq!(readme.matches(&format!("{address}/#step=1")).count(), 2);
    assert_eq!(readme.matches("/#step=1").count(), 2);
}

/// Another platform has other crates.
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
#[test]
fn the_papers_count_the_crates_of_each_build() {
    let root = env!("CARGO_MANIFEST_DIR");
    let mut count = Command::new("python3");
    count.args(["scripts/features.py", "--crates"]);
    count.current_dir(root).env("CARGO", env!("CARGO"));
    // After a build only the packages for this platform are sure to be present.
    count.env("CARGO_NET_OFFLINE", "true");
    let Ok(count) = count.output() else {
        assert!(std::env::var_os("CI").is_none(), "python3 is missing");
        return;
    };
    let said = String::from_utf8_lossy(&count.stderr);
    assert!(count.status.success(), "{said}");
    let paper = text("docs/development.md");
    let (_, kept) = paper.split_once("<!-- scripts/features.py -->\n").unwrap();
    let (kept, _) = kept.split_once("<!-- end -->").unwrap();
    assert_eq!(String::from_utf8_lossy(&count.stdout), kept);
}

/// `rust-version` is a promise to users with an older compiler, so no package may need a newer one.
#[test]
fn no_dependency_asks_for_a_newer_compiler_than_we_do() {
    // After a build only the packages for this platform are sure to be present.
    let compiler = printed(Command::new("rustc").arg("-vV"));
    let mut lines = compiler.lines();
    let host = lines.find_map(|line| line.strip_prefix("host: ")).unwrap();
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["metadata", "--locked", "--offline", "--format-version", "1"]);
    let metadata = printed(cargo.args(["--filter-platform", host]));
    let metadata: serde_json::Value = serde_json::from_str(&metadata).unwrap();
    let version = |text: &str| -> Vec<u32> {
        let parts = text.split('.').map(|part| part.parse().unwrap());
        parts.chain([0]).take(3).collect()
    };
    let ours = version(env!("CARGO_PKG_RUST_VERSION"));
    let packages = metadata["packages"].as_array().unwrap();
    assert!(packages.len() > 10, "{} packages", packages.len());
    for package in packages {
        let theirs = package["rust_version"].as_str().unwrap_or_default();
        let is_old = theirs.is_empty() || version(theirs) <= ours;
        assert!(is_old, "{} asks for Rust {theirs}", package["name"]);
    }
}
