//! ARCHITECTURE.md and the glossary: the modules, paths, functions and types that they name exist.

use super::codes;
use crate::papers::{table, text};
use crate::tree::{module_file, root};

/// The file of a module, or of the module that an item is in, and the item's name.
fn place_of(path: &str) -> Option<(String, Option<&str>)> {
    let whole = module_file(path).map(|file| (file, None));
    whole.or_else(|| {
        let (module, item) = path.rsplit_once("::")?;
        Some((module_file(module)?, Some(item)))
    })
}

#[test]
fn every_word_of_the_glossary_is_the_name_of_its_item() {
    let rows = table(&text("docs/glossary.md"), "word | means");
    assert!(rows.len() > 25, "{} words", rows.len());
    for row in rows {
        let paths = codes(&row[2]).into_iter();
        for path in paths.filter(|path| path.contains("::")) {
            let place = place_of(path);
            let (file, item) = place.unwrap_or_else(|| panic!("{path}: no such module"));
            let Some(item) = item else { continue };
            let source = text(&file);
            let is_public = |kind: &str| {
                let name = format!(" {kind} {item}");
                let mut lines = source.lines().map(str::trim_start);
                lines.any(|line| line.starts_with("pub") && line.contains(&name))
            };
            let kinds = ["struct", "enum", "const", "fn", "trait"];
            assert!(kinds.into_iter().any(is_public), "{file} has no {item}");
        }
    }
}

#[test]
fn every_path_that_the_architecture_names_exists() {
    let paper = text("ARCHITECTURE.md");
    let folders = [
        "src/", "tests/", "docs/", "benches/", "scripts/", "page/", "fuzz/", "client/",
    ];
    let is_path = |code: &str| folders.iter().any(|folder| code.starts_with(folder));
    let mut named = codes(&paper);
    named.retain(|code| is_path(code) && !code.contains('*'));
    assert!(named.len() > 20, "{} paths", named.len());
    for path in named {
        assert!(root().join(path).exists(), "ARCHITECTURE.md names {path}");
    }
}
