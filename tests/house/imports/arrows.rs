//! Arrows between the files of a package: an import is followed to the file that defines its name.

use std::collections::{BTreeMap, BTreeSet};

use super::files::{File, Module, child, read};
use crate::tree::root;

/// A package whose imports are looked at: its folder, its name in paths, and it has more files than this.
pub(super) type Package = (&'static str, &'static str, usize);

pub(super) const PENDULARM: Package = ("", "pendularm", 100);
const ROS2: Package = ("ros2", "pendularm_ros2", 20);
const PYTHON: Package = ("python", "_native", 10);
pub(super) const PACKAGES: [Package; 3] = [PENDULARM, ROS2, PYTHON];

/// Arrows between files, with the names that make them.
pub(super) type Arrows = BTreeMap<(String, String), BTreeSet<String>>;
/// A module, and what is named in it.
type Place = (Module, Option<String>);
/// Imports that have been followed already.
type Seen = BTreeSet<(Module, String)>;

fn parent(module: &Module) -> Option<Module> {
    Some(module[..module.len().checked_sub(1)?].to_vec())
}

pub(super) struct SourceTree {
    name: &'static str,
    pub(super) modules: BTreeMap<Module, File>,
}

impl SourceTree {
    pub(super) fn read((folder, name, more_than): Package) -> Self {
        let mut modules = BTreeMap::new();
        let source = root().join(folder).join("src");
        read(&source, &source, &Vec::new(), &mut modules);
        assert!(modules.len() > more_than, "{}", modules.len());
        Self { name, modules }
    }

    /// The meaning of `path` in the file of `from`: a module of the crate, and the item in it if the path names one.
    /// None for names of other crates, and for names that the file itself defines.
    fn place(&self, from: &Module, path: &[String], seen: &mut Seen) -> Option<Place> {
        let (first, behind) = path.split_first()?;
        match first.as_str() {
            "crate" => self.walk(Vec::new(), behind, seen),
            name if name == self.name => self.walk(Vec::new(), behind, seen),
            "self" => self.walk(from.clone(), behind, seen),
            "super" => self.walk(parent(from)?, behind, seen),
            name => {
                let mut imports = self.modules[from].imports.iter();
                let is_imported = imports.any(|import| import.name == name);
                let is_known = is_imported || self.modules.contains_key(&child(from, name));
                is_known.then(|| self.walk(from.clone(), path, seen))?
            }
        }
    }

    /// The same for a path that continues in `module`.
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
            // An imported name may also be defined here, for example a macro's.
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
    pub(super) fn arrows(&self) -> Arrows {
        let mut arrows = Arrows::new();
        for (module, file) in &self.modules {
            let used = |name: &str| file.paths.iter().any(|path| path[0] == name);
            let imports = file.imports.iter();
            let imported = imports.filter(|import| !import.handed_on || used(&import.name));
            for path in imported.map(|import| &import.path).chain(&file.paths) {
                // A module alone is no arrow. An item of it is one.
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
