//! The files of a package: their imports, and the paths in their code.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// A module's path from the root of the crate: empty for the root.
pub(super) type Module = Vec<String>;

pub(super) struct File {
    pub(super) path: String,
    /// Names that are declared by `use`: the name here, and the path behind it.
    pub(super) imports: Vec<Import>,
    /// Paths in the code outside of `use`.
    pub(super) paths: BTreeSet<Vec<String>>,
}

pub(super) struct Import {
    pub(super) name: String,
    pub(super) path: Vec<String>,
    pub(super) handed_on: bool,
}

pub(super) fn child(module: &Module, name: &str) -> Module {
    [module.as_slice(), &[name.to_owned()]].concat()
}

/// Every module below `source` in `folder`, with the content of its file.
pub(super) fn read(source: &Path, folder: &Path, at: &Module, found: &mut BTreeMap<Module, File>) {
    let has_library = source.join("lib.rs").exists();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let stem = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let below = child(at, &stem);
        if path.is_dir() {
            read(source, &path, &below, found);
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

/// Collects imports and paths, including those in the arguments of macros.
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
                // `use<'a>` in a bound is no import.
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

/// Whether `pub` or `pub(scope)` is before a `use`.
fn is_handed_on(before: &[TokenTree]) -> bool {
    let before = match before {
        [before @ .., TokenTree::Group(scope)] if scope.delimiter() == Delimiter::Parenthesis => {
            before
        }
        _ => before,
    };
    ident(before.last()).is_some_and(|word| word == "pub")
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
