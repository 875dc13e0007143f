//! Makes a test of each exchange, so that `cargo test -- --list` has their statements.

use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

/// The files whose exchanges are over HTTP.
const OVER_HTTP: [&str; 4] = ["heads", "http", "sockets", "web"];

/// The statement as the name of a function.
fn function_name(statement: &str) -> String {
    let letters = |text: &str| text.chars().filter(char::is_ascii_alphanumeric).collect();
    let words: Vec<String> = statement
        .split(|one: char| !one.is_ascii_alphanumeric() && one != '\'')
        .map(letters)
        .filter(|word: &String| !word.is_empty())
        .collect();
    words.join("_").to_ascii_lowercase()
}

fn main() {
    println!("cargo:rerun-if-changed=exchanges");
    let files = fs::read_dir("exchanges").expect("the folder of the exchanges");
    let mut files: Vec<_> = files.map(|file| file.expect("an entry").path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "txt"));
    files.sort();
    let mut tests = String::new();
    for path in &files {
        let file = path.file_stem().and_then(|stem| stem.to_str());
        let file = file.expect("a name");
        if OVER_HTTP.contains(&file) {
            tests.push_str("#[cfg(feature = \"web\")]\n");
        }
        let _ = writeln!(tests, "mod {file} {{");
        let text = fs::read_to_string(path).expect("a text");
        for title in text.lines().filter_map(|line| line.strip_prefix("# ")) {
            let name = function_name(title);
            let play = format!("super::play({file:?}, {title:?})");
            let _ = writeln!(tests, "#[test] fn {name}() {{ {play} }}");
        }
        tests.push_str("}\n");
    }
    let folder = env::var_os("OUT_DIR").expect("a folder for what is made");
    fs::write(Path::new(&folder).join("exchanges.rs"), tests).expect("the tests are written");
}
