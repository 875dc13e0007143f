//! The page's modules as one file, and its style sheets as another, so that a browser asks twice instead of seventy
//! times.
//!
//! Each module becomes a function that runs once and returns what the module exports. The file exports them all as
//! `modules`, by their names.
//!
//! **Invariant:** a module stands after all that it imports. The modules keep to the few forms that are known here:
//! imports in braces from a file beside, exports of one declaration each, and no cycle.

use std::collections::BTreeSet;
use std::fmt::Write as _;

/// A module: its file's name, and its text.
pub type Module<'a> = (&'a str, &'a str);

/// One file that does what `main` and all that it imports do.
#[must_use]
pub fn bundle(main: &str, modules: &[Module<'_>]) -> String {
    let mut text = String::new();
    let mut added = BTreeSet::new();
    add(main, modules, &mut added, &mut text);
    text.push_str("export const modules = {");
    for name in &added {
        let _ = write!(text, " \"{name}\": {},", variable(name));
    }
    text.push_str(" };\n");
    text
}

/// Adds a module behind those that it imports.
fn add(name: &str, modules: &[Module<'_>], added: &mut BTreeSet<String>, text: &mut String) {
    let Some((_, source)) = modules.iter().find(|(one, _)| *one == name) else {
        return;
    };
    if !added.insert(name.into()) {
        return;
    }
    let (mut body, mut exports, mut import) = (String::new(), Vec::new(), String::new());
    for line in source.lines() {
        if !import.is_empty() || line.starts_with("import {") {
            import.push_str(line);
            if let Some((names, from)) = imported(&import) {
                add(from, modules, added, text);
                let names = names.replace(" as ", ": ");
                let _ = writeln!(body, "const {{{names}}} = {};", variable(from));
                import.clear();
            }
            continue;
        }
        let declaration = line.strip_prefix("export ").unwrap_or(line);
        if declaration.len() < line.len() {
            exports.extend(declared(declaration));
        }
        let _ = writeln!(body, "{declaration}");
    }
    let (own, exports) = (variable(name), exports.join(", "));
    let _ = writeln!(
        text,
        "const {own} = (() => {{\n{body}return {{ {exports} }};\n}})();"
    );
}

/// The names in `import { names } from "./file";`, and the file; `None` while it goes on in the next line.
fn imported(import: &str) -> Option<(&str, &str)> {
    let (names, from) = import.strip_prefix("import {")?.split_once("} from \"./")?;
    Some((names, from.split_once('"')?.0))
}

/// The name in `function name(`, `async function name(`, `class Name {` or `const name =`.
fn declared(declaration: &str) -> Option<&str> {
    let declaration = declaration.strip_prefix("async ").unwrap_or(declaration);
    let (_, rest) = declaration.split_once(' ')?;
    rest.split(|c: char| !c.is_alphanumeric() && c != '_')
        .next()
}

fn variable(name: &str) -> String {
    format!("${}", name.trim_end_matches(".js"))
}

/// The style sheet `main` with those in place of its `@import "file";` lines.
#[must_use]
pub fn styles(main: &str, sheets: &[Module<'_>]) -> String {
    let text_of = |name: &str| sheets.iter().find(|(one, _)| *one == name).map(|one| one.1);
    let mut text = String::new();
    for line in text_of(main).unwrap_or_default().lines() {
        let imported = line
            .strip_prefix("@import \"")
            .and_then(|rest| rest.strip_suffix("\";"))
            .and_then(text_of);
        let _ = writeln!(text, "{}", imported.unwrap_or(line));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_style_sheet_has_those_that_it_imports_in_their_places() {
        let sheets = [
            ("low.css", "p { margin: 0; }\n"),
            (
                "style.css",
                "/* all */\n@import \"low.css\";\na { color: red; }\n",
            ),
        ];
        let text = styles("style.css", &sheets);
        assert_eq!(text, "/* all */\np { margin: 0; }\n\na { color: red; }\n");
    }

    const MAIN: &str = "import {\n  a as first,\n  B,\n} from \"./low.js\";\nimport { c } from \"./mid.js\";\nfirst(B, \
                        c);\n";
    const MID: &str = "import { a } from \"./low.js\";\nexport const c = a();\n";
    const LOW: &str = "export async function a() {}\nconst hidden = 1;\nexport class B {}\n";

    #[test]
    fn each_module_stands_once_and_behind_what_it_imports() {
        let modules = [
            ("main.js", MAIN),
            ("mid.js", MID),
            ("low.js", LOW),
            ("other.js", ""),
        ];
        let text = bundle("main.js", &modules);
        let expected = "const $low = (() => {\nasync function a() {}\nconst hidden = 1;\nclass B {}\nreturn { a, B \
                        };\n})();\nconst $mid = (() => {\nconst { a } = $low;\nconst c = a();\nreturn { c };\n})();\n\
             const $main = (() => {\nconst {  a: first,  B,} = $low;\nconst { c } = $mid;\nfirst(B, c);\nreturn {  \
             };\n})();\nexport const modules = { \"low.js\": $low, \"main.js\": $main, \"mid.js\": $mid, };\n";
        assert_eq!(text, expected);
    }
}
