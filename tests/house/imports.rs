//! Imports of the source, file by file: no circle between files, none between rooms, and the floors of the house. The
//! bridge to ROS 2 is a house of its own, whose floors are not looked at.
//!
//! **Rule:** an arrow runs from the file that names an item to the file that defines it; `mod` and `pub use`, which only
//! declare or hand on, are no arrows, and names that they hand on are followed. Unit tests may name what they like.
//!
//! **Invariant:** the source is read token by token, so that comments, text and the lines of a path make no difference.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// Floors that a floor may name, besides itself: each row only rows above it.
const FLOORS: [(&str, &[&str]); 14] = [
    ("math", &[]),
    ("protocol", &[]),
    ("logging", &["protocol"]),
    ("output", &[]),
    ("study", &["math"]),
    ("record", &["math", "protocol"]),
    ("web", &["protocol"]),
    ("report", &["math", "study"]),
    ("command", &["protocol", "output"]),
    (
        "options",
        &["protocol", "study", "web", "report", "command", "logging"],
    ),
    ("plan", &["math", "study", "options"]),
    (
        "actors",
        &[
            "math", "protocol", "logging", "study", "record", "web", "options",
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

/// A package whose imports are looked at.
struct Package {
    /// Its folder, from this one.
    folder: &'static str,
    /// Its name in paths.
    name: &'static str,
    /// It has more files than this.
    more_than: usize,
}

const PENDULARM: Package = Package {
    folder: "",
    name: "pendularm",
    more_than: 100,
};

const PACKAGES: [Package; 2] = [
    PENDULARM,
    Package {
        folder: "ros2",
        name: "pendularm_ros2",
        more_than: 20,
    },
];

/// A module's path from the root of the crate: empty for the root.
type Module = Vec<String>;
/// Who names whom; the names by which that happens.
type Arrows = BTreeMap<(String, String), BTreeSet<String>>;
/// A module, and what is named in it.
type Place = (Module, Option<String>);
/// Imports that have been followed already.
type Seen = BTreeSet<(Module, String)>;

struct File {
    path: String,
    /// Names that are declared by `use`: the name here, and the path behind it.
    imports: Vec<Import>,
    /// Paths in the code, `use` apart.
    paths: BTreeSet<Vec<String>>,
}

struct Import {
    name: String,
    path: Vec<String>,
    handed_on: bool,
}

fn child(module: &Module, name: &str) -> Module {
    [module.as_slice(), &[name.to_owned()]].concat()
}

fn parent(module: &Module) -> Option<Module> {
    Some(module[..module.len().checked_sub(1)?].to_vec())
}

impl Package {
    fn source(&self) -> PathBuf {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        root.join(self.folder).join("src")
    }
}

/// Every module below `source` in `folder`, with what its file holds.
fn read(source: &Path, folder: &Path, at: &Module, found: &mut BTreeMap<Module, File>) {
    let has_library = source.join("lib.rs").exists();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let below = child(at, &stem);
        if path.is_dir() {
            read(source, &path, &below, found);
            continue;
        }
        if path.extension().is_none_or(|extension| extension != "rs") {
            continue;
        }
        let module = match stem.as_str() {
            "mod" | "lib" => at.clone(),
            "main" if !has_library => at.clone(),
            _ => below,
        };
        let tokens: TokenStream = fs::read_to_string(&path).unwrap().parse().unwrap();
        let path = path.strip_prefix(source).unwrap();
        let mut file = File {
            path: path.to_str().unwrap().to_owned(),
            imports: Vec::new(),
            paths: BTreeSet::new(),
        };
        scan(tokens, &mut file);
        found.insert(module, file);
    }
}

fn ident(token: Option<&TokenTree>) -> Option<String> {
    match token {
        Some(TokenTree::Ident(ident)) => Some(ident.to_string()),
        _ => None,
    }
}

fn is_punct(token: Option<&TokenTree>, punct: char) -> bool {
    matches!(token, Some(TokenTree::Punct(one)) if one.as_char() == punct)
}

fn is_path_separator(tokens: &[TokenTree], at: usize) -> bool {
    is_punct(tokens.get(at), ':') && is_punct(tokens.get(at + 1), ':')
}

/// Collects imports and paths; of a macro's arguments too, which only the compiler could read otherwise.
fn scan(tokens: TokenStream, file: &mut File) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut at = 0;
    while at < tokens.len() {
        match &tokens[at] {
            TokenTree::Group(attribute) if attribute.to_string() == "[cfg (test)]" => {
                // `mod tests { .. }` follows.
                at += 3;
            }
            TokenTree::Group(group) => scan(group.stream(), file),
            TokenTree::Ident(word) if *word == "use" => {
                let end = (at..tokens.len()).find(|&end| is_punct(tokens.get(end), ';'));
                // In bounds of lifetimes, `use<'a>` is no import.
                if let Some(end) = end.filter(|_| !is_punct(tokens.get(at + 1), '<')) {
                    let handed_on = is_handed_on(&tokens[..at]);
                    tree(&tokens[at + 1..end], &[], handed_on, &mut file.imports);
                    at = end;
                }
            }
            TokenTree::Ident(word) => {
                let is_member = is_punct(at.checked_sub(1).map(|at| &tokens[at]), '.');
                let mut path = vec![word.to_string()];
                while is_path_separator(&tokens, at + 1)
                    && let Some(next) = ident(tokens.get(at + 3))
                {
                    path.push(next);
                    at += 3;
                }
                if !is_member {
                    file.paths.insert(path);
                }
            }
            _ => {}
        }
        at += 1;
    }
}

fn is_handed_on(before: &[TokenTree]) -> bool {
    let last = before.len().checked_sub(1);
    let before_scope = match last.map(|last| &before[last]) {
        Some(TokenTree::Group(scope)) if scope.delimiter() == Delimiter::Parenthesis => {
            last.and_then(|last| last.checked_sub(1))
        }
        _ => last,
    };
    ident(before_scope.map(|at| &before[at])).is_some_and(|word| word == "pub")
}

/// The imports of one `use`, whose braces nest.
fn tree(tokens: &[TokenTree], before: &[String], handed_on: bool, found: &mut Vec<Import>) {
    for branch in tokens.split(|token| is_punct(Some(token), ',')) {
        let mut path = before.to_vec();
        let mut name = None;
        let mut at = 0;
        while at < branch.len() {
            match &branch[at] {
                TokenTree::Group(group) => {
                    let inside: Vec<TokenTree> = group.stream().into_iter().collect();
                    tree(&inside, &path, handed_on, found);
                    path.clear();
                }
                TokenTree::Ident(word) if *word == "as" => {
                    at += 1;
                    name = ident(branch.get(at));
                }
                TokenTree::Ident(word) if *word == "self" && !path.is_empty() => {}
                TokenTree::Ident(word) => path.push(word.to_string()),
                TokenTree::Punct(star) if star.as_char() == '*' => path.push("*".to_owned()),
                _ => {}
            }
            at += 1;
        }
        if let Some(last) = path.last().cloned() {
            let name = name.unwrap_or(last);
            found.push(Import {
                name,
                path,
                handed_on,
            });
        }
    }
}

struct House {
    name: &'static str,
    modules: BTreeMap<Module, File>,
}

impl House {
    fn read(package: &Package) -> Self {
        let mut modules = BTreeMap::new();
        let source = package.source();
        read(&source, &source, &Vec::new(), &mut modules);
        assert!(modules.len() > package.more_than, "{}", modules.len());
        Self {
            name: package.name,
            modules,
        }
    }

    /// The meaning of `path` as it is spelled in the file of `from`: a module of ours, and the item in it unless the module
    /// itself is meant. None for other crates' names, and for those that the file itself defines.
    fn place(&self, from: &Module, path: &[String], seen: &mut Seen) -> Option<Place> {
        let (first, behind) = path.split_first()?;
        match first.as_str() {
            "crate" => self.walk(Vec::new(), behind, seen),
            name if name == self.name => self.walk(Vec::new(), behind, seen),
            "self" => self.walk(from.clone(), behind, seen),
            "super" => self.walk(parent(from)?, behind, seen),
            name => {
                let known = self.modules.contains_key(&child(from, name))
                    || self.modules[from]
                        .imports
                        .iter()
                        .any(|import| import.name == name);
                known.then(|| self.walk(from.clone(), path, seen))?
            }
        }
    }

    /// The same for a path that goes on in `module`.
    fn walk(&self, module: Module, path: &[String], seen: &mut Seen) -> Option<Place> {
        let Some((name, behind)) = path.split_first() else {
            return Some((module, None));
        };
        if name == "super" {
            return self.walk(parent(&module)?, behind, seen);
        }
        let below = child(&module, name);
        if self.modules.contains_key(&below) {
            return self.walk(below, behind, seen);
        }
        let mut imports = self.modules[&module].imports.iter();
        let import = imports.find(|import| import.name == *name);
        match import {
            // A name may be imported that is defined here too, as a macro's is.
            Some(import) if seen.insert((module.clone(), name.clone())) => {
                match self.place(&module, &import.path, seen)? {
                    (handed_on, None) => self.walk(handed_on, behind, seen),
                    defined => Some(defined),
                }
            }
            _ => Some((module, Some(name.clone()))),
        }
    }

    /// Arrows between files.
    fn arrows(&self) -> Arrows {
        let mut arrows = Arrows::new();
        for (module, file) in &self.modules {
            let used = |name: &str| file.paths.iter().any(|path| path[0] == name);
            let imports = file.imports.iter();
            let imported = imports
                .filter(|import| !import.handed_on || used(&import.name))
                .map(|import| &import.path);
            for path in imported.chain(&file.paths) {
                // A module that is named without anything in it is no arrow; what is taken from it is.
                if let Some((target, Some(name))) = self.place(module, path, &mut Seen::new())
                    && target != *module
                {
                    let ends = (file.path.clone(), self.modules[&target].path.clone());
                    arrows.entry(ends).or_default().insert(name);
                }
            }
        }
        arrows
    }
}

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

/// Each folder has its files and the folders in it. The folder's own `mod.rs` is none of them: it is the folder.
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
