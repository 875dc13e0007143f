//! Values of the runtime, written as YAML or as a line of JSON.
//!
//! YAML is written here, because the library's writer does not escape control characters, which act on a terminal.
//!
//! **Invariant:** members keep their order and numbers their value. Control characters in texts are
//! escaped.

use std::fmt;
use std::io::{self, BufWriter, Write};

use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, Visitor};
use serde_json::value::RawValue;

use super::output::CommandError;
use crate::protocol::limits::MAX_NESTING;
use crate::protocol::wire::text::{acts, push_quoted};

/// Texts that YAML readers would not read as text, in lower case.
pub const WORDS: [&str; 10] = [
    "true", "false", "null", "yes", "no", "on", "off", "y", "n", "~",
];

/// JSON on one line, unchanged except for escaped control characters.
#[must_use]
pub fn json_line(raw: &RawValue) -> String {
    let mut line = String::with_capacity(raw.get().len() + 1);
    for character in raw.get().chars() {
        match character {
            // These are between tokens. Inside a text JSON does not allow them.
            '\t' | '\r' | '\n' => line.push(' '),
            _ if acts(character) => push_quoted(&mut line, character),
            _ => line.push(character),
        }
    }
    line.push('\n');
    line
}

/// Writes the value as lines of YAML, and `end` after them. It writes while it reads, because a deeply nested value is
/// a hundred times longer in YAML than in JSON.
///
/// # Errors
/// [`CommandError::Lost`] if it is nested deeper than the runtime accepts, or the error of `out`.
pub fn write_yaml(raw: &RawValue, end: &str, out: impl Write) -> Result<(), CommandError> {
    let mut out = BufWriter::new(out);
    let written = write_value(raw, 0, &Place::Top, &mut out)
        .and_then(|()| out.write_all(end.as_bytes()))
        .and_then(|()| out.flush());
    written.map_err(|why| match why.kind() {
        io::ErrorKind::InvalidData => CommandError::Lost(format!("cannot read a frame: {why}")),
        _ => CommandError::output(why),
    })
}

/// The place of a value: the text before it on its line.
#[derive(PartialEq)]
enum Place {
    Top,
    /// The name of a member.
    Member,
    /// The dash of an item.
    Item,
}

/// The members of an object, in their order.
struct OrderedMembers<'a>(Vec<(String, &'a RawValue)>);

impl<'de: 'a, 'a> Deserialize<'de> for OrderedMembers<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct InOrder;
        impl<'de> Visitor<'de> for InOrder {
            type Value = OrderedMembers<'de>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                }
                Ok(OrderedMembers(members))
            }
        }
        deserializer.deserialize_map(InOrder)
    }
}

/// Writes a value whose name or dash follows `indent` spaces.
fn write_value(
    raw: &RawValue,
    indent: usize,
    place: &Place,
    out: &mut dyn Write,
) -> io::Result<()> {
    if indent > 2 * MAX_NESTING {
        let why = format!("it is nested more than {MAX_NESTING} deep");
        return Err(io::Error::new(io::ErrorKind::InvalidData, why));
    }
    let json = raw.get();
    let (items, members) = match json.get(..1) {
        Some("[") => (serde_json::from_str(json)?, OrderedMembers(Vec::new())),
        Some("{") => (Vec::new(), serde_json::from_str(json)?),
        _ => (Vec::new(), OrderedMembers(Vec::new())),
    };
    let OrderedMembers(members) = members;
    let is_list = !items.is_empty();
    if !is_list && members.is_empty() {
        let space = if *place == Place::Top { "" } else { " " };
        return writeln!(out, "{space}{}", scalar(json)?);
    }
    // The dashes of a member are below its name.
    let indent = match place {
        Place::Top => indent,
        Place::Member if is_list => indent,
        _ => indent + 2,
    };
    let leads = members
        .iter()
        .map(|(name, value)| (text(name) + ":", *value));
    let leads = leads.chain(
        items
            .into_iter()
            .map(|item: &RawValue| ("-".to_owned(), item)),
    );
    for (at, (lead, value)) in leads.enumerate() {
        match place {
            Place::Item if at == 0 => write!(out, " {lead}")?,
            Place::Member if at == 0 => write!(out, "\n{:indent$}{lead}", "")?,
            _ => write!(out, "{:indent$}{lead}", "")?,
        }
        let place = if is_list { Place::Item } else { Place::Member };
        write_value(value, indent, &place, out)?;
    }
    Ok(())
}

/// A scalar value. Python reads numbers of YAML 1.1: with a point, and a sign in the exponent.
fn scalar(json: &str) -> io::Result<String> {
    if json.starts_with('"') {
        return Ok(text(&serde_json::from_str::<String>(json)?));
    }
    let has_exponent = json.starts_with(|one: char| one == '-' || one.is_ascii_digit());
    Ok(match json.split_once(['e', 'E']).filter(|_| has_exponent) {
        Some((digits, exponent)) => {
            let point = if digits.contains('.') { "" } else { ".0" };
            let sign = if exponent.starts_with(['-', '+']) {
                ""
            } else {
                "+"
            };
            format!("{digits}{point}e{sign}{exponent}")
        }
        None => match json.chars().next() {
            Some('[') => "[]".to_owned(),
            Some('{') => "{}".to_owned(),
            _ => json.to_owned(),
        },
    })
}

/// A text, with quotes unless every reader reads it as a text without them.
fn text(value: &str) -> String {
    let begins = |one: char| one.is_ascii_alphabetic() || one == '/' || one == '_';
    let goes_on = |one: char| one.is_ascii_alphanumeric() || "/_.-+() ".contains(one);
    if value.starts_with(begins)
        && value.chars().all(goes_on)
        && !value.ends_with(' ')
        && !WORDS.contains(&value.to_ascii_lowercase().as_str())
    {
        return value.to_owned();
    }
    let mut quoted = String::from('"');
    for character in value.chars() {
        push_quoted(&mut quoted, character);
    }
    quoted.push('"');
    quoted
}
