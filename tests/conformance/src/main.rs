//! `pendularm-conformance ADDRESS [--category TEXT] [--rule ID]`: tries the specification's rules against a server.
//!
//! Exit status: 0 if every rule holds, 1 if one does not, 2 for bad usage or a server that cannot be reached.

use std::process::ExitCode;

use pendularm_conformance::{Selection, run, totals};

const USAGE: &str = "usage: pendularm-conformance ADDRESS [--category TEXT] [--rule ID]
  ADDRESS          where the server listens, for example 127.0.0.1:9095
  --category TEXT  only a category whose name contains TEXT: integrators, pid, dynamics, inverse
  --rule ID        only this rule, or all rules of a section: checkpoint-3, reset";

fn main() -> ExitCode {
    let Some((address, selection)) = options() else {
        eprintln!("{USAGE}");
        return ExitCode::from(2);
    };
    match run(&address, &selection, |row| println!("{row}")) {
        Ok(rows) if rows.is_empty() => {
            eprintln!("no rule has this --category and --rule\n{USAGE}");
            ExitCode::from(2)
        }
        Ok(rows) => {
            println!("\n{}", totals(&rows));
            ExitCode::from(u8::from(rows.iter().any(|row| !row.holds())))
        }
        Err(why) => {
            eprintln!("{why}");
            ExitCode::from(2)
        }
    }
}

/// The address and the filters. `None` if they are not valid.
fn options() -> Option<(String, Selection)> {
    let mut address = None;
    let mut selection = Selection::default();
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--category" => selection.category = Some(words.next()?),
            "--rule" => selection.rule = Some(words.next()?),
            _ if word.starts_with('-') || address.is_some() => return None,
            _ => address = Some(word),
        }
    }
    Some((address?, selection))
}
