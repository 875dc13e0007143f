//! Commands and their outcome, a row each: `rows.txt`.
//!
//! A paragraph begins with `# ` and its statement, and uses its own runtime. A row is an exit status, the arguments as
//! a shell reads them, ` = ` and a part of the output. With ` == ` it is the whole output. Both may have the escapes of
//! JSON. A successful command writes nothing to standard error. A failed one writes one line there and nothing else.
//! `%3*x%` is `xxx`. A row that begins with `!` has no address of the runtime other than `$ADDRESS`, whose port is
//! `$PORT`.

use super::{command, words};
use crate::common::{self, Runtime};

/// A word with its line ends and its repetition written out.
fn expand(word: &str) -> String {
    let word = word.replace("\\n", "\n");
    let parts: Vec<&str> = word.split('%').collect();
    let [before, repeated, after] = parts[..] else {
        return word.clone();
    };
    let (count, part) = repeated.split_once('*').unwrap();
    format!("{before}{}{after}", part.repeat(count.parse().unwrap()))
}

/// The fault of a row, if it has one.
fn fault(runtime: &Runtime, row: &str) -> Option<String> {
    let row = &row.replace("$ADDRESS", &runtime.address.to_string());
    let row = &row.replace("$PORT", &runtime.address.port().to_string());
    let (status, rest) = row.split_once(' ').unwrap();
    let (arguments, part) = rest.split_once(" =").expect(row);
    let is_whole = part.starts_with('=');
    let part = part.trim_start_matches('=').trim_start_matches(' ');
    let arguments: Vec<String> = words(arguments).iter().map(|word| expand(word)).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let part: String = serde_json::from_str(&format!("\"{part}\"")).expect(row);
    let output = match status.strip_prefix('!') {
        Some(_) => common::run(&arguments),
        None => command(runtime, &arguments).output().unwrap(),
    };
    let status = status.trim_start_matches('!');
    let [said, complaint] =
        [output.stdout, output.stderr].map(|one| String::from_utf8(one).unwrap());
    let (text, other) = if status == "0" {
        (&said, &complaint)
    } else {
        (&complaint, &said)
    };
    let is_right = output.status.code().map(|code| code.to_string()).as_deref() == Some(status)
        && other.is_empty()
        && (status == "0" || text.lines().count() == 1 && text.starts_with("pendularm: "))
        && if is_whole {
            *text == part
        } else {
            text.contains(&part)
        };
    (!is_right).then(|| format!("{row}: {}: {said:?}, {complaint:?}", output.status))
}

#[test]
fn every_command_has_the_outcome_of_its_row() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/wire/command/rows.txt");
    let text = std::fs::read_to_string(path).unwrap();
    let mut faults = Vec::new();
    for paragraph in text.trim_end().split("\n\n") {
        let (title, rows) = paragraph.split_once('\n').unwrap();
        assert!(title.starts_with("# "), "{title}");
        let runtime = Runtime::start();
        faults.extend(rows.lines().filter_map(|row| fault(&runtime, row)));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
