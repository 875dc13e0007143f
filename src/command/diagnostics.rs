//! `pendularm diagnostics`: how a running one is, at a glance.
//!
//! **Invariant:** the exit status is 0 only if every part says that it is well.

use clap::Command;
use serde_json::Value;

use super::asked::Asked;
use super::error::{CommandError, plain};
use super::output::print;
use super::verbs::verb;
use crate::protocol::catalog::Topic;

/// The topic that tells.
const TOPIC: &str = Topic::Diagnostics.name();
/// The levels of `diagnostic_msgs/msg/DiagnosticStatus`, by their numbers.
const LEVELS: [&str; 4] = ["OK", "WARN", "ERROR", "STALE"];
/// Widest column of keys, in bytes: the runtime's own have room, and one that is longer pads no other line.
const KEY_WIDTH: usize = 40;

pub(super) fn command() -> Command {
    verb(
        "diagnostics",
        "Say how a running pendularm is: state, warnings, energy, timestep and its limits",
        "Example:\n  pendularm diagnostics || echo 'all is not well'\n\n\
         It waits for one message of /diagnostics, a second at most while the arm runs. Status 1 also means that some \
         part is not OK;\nwith --json the message is one line.",
    )
}

pub(super) fn show(asked: &Asked) -> Result<(), CommandError> {
    let mut session = asked.open()?;
    session.subscribe(TOPIC, None)?;
    let msg = session.message(TOPIC)?;
    let array: Value = serde_json::from_str(msg.get()).unwrap_or_default();
    let parts = list(&array, "status");
    if asked.has("json") {
        asked.show(&msg)?;
    } else {
        print(&parts.iter().map(page).collect::<String>())?;
    }
    match parts
        .iter()
        .find(|part| part.get("level") != Some(&Value::from(0)))
    {
        None => Ok(()),
        Some(part) => Err(CommandError::refused(&title(part))),
    }
}

fn list<'a>(of: &'a Value, name: &str) -> &'a [Value] {
    let list = of.get(name).and_then(Value::as_array);
    list.map_or(&[], Vec::as_slice)
}

fn text<'a>(of: &'a Value, name: &str) -> &'a str {
    of.get(name).and_then(Value::as_str).unwrap_or_default()
}

fn title(part: &Value) -> String {
    format!("{}: {}", text(part, "name"), text(part, "message"))
}

fn page(part: &Value) -> String {
    let level = part.get("level").and_then(Value::as_u64);
    let level = level.and_then(|level| usize::try_from(level).ok());
    let level = level
        .and_then(|level| LEVELS.get(level))
        .unwrap_or(&"STALE");
    let details = list(part, "values");
    let widths = details.iter().map(|one| text(one, "key").len());
    let width = widths.max().unwrap_or(0).min(KEY_WIDTH);
    let mut page = plain(&format!("{level} {}", title(part))) + "\n";
    for one in details {
        let (key, value) = (text(one, "key"), text(one, "value"));
        page += plain(&format!("  {key:width$}  {value}")).trim_end();
        page.push('\n');
    }
    page
}
