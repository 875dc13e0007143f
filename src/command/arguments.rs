//! Values in JSON or YAML on the command line, read as JSON and checked against their type.
//!
//! **Invariant:** a value is nested at most as deep as the runtime accepts. A type that the runtime does not know
//! may have any field.

use std::str::Chars;

use clap::Args;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use yaml_rust2::Yaml;
use yaml_rust2::parser::{Event, Parser};
use yaml_rust2::scanner::TScalarStyle;

use super::output::{CommandError, plain};
use super::session::Session;
use crate::protocol::limits::MAX_NESTING;

/// The refusal of a value in several arguments.
pub(crate) const UNQUOTED: &str = "\
    an argument in YAML or JSON came as several words: put quotes around all of it, such as '{data: true}'";

/// Fields of ROS 1 that the runtime also reads, after their types.
const ROS_1: [(&str, &str); 5] = [
    ("builtin_interfaces/Duration", "nsecs"),
    ("builtin_interfaces/Duration", "secs"),
    ("builtin_interfaces/Time", "nsecs"),
    ("builtin_interfaces/Time", "secs"),
    ("std_msgs/Header", "seq"),
];

/// A type and a value of that type, both optional.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct TypedValue {
    /// Its type, as pkg/Name; optional, and checked if given
    #[arg(value_name = "TYPE")]
    type_name: Option<String>,
    /// The value, in JSON or YAML; {} by default
    value: Option<String>,
}

impl TypedValue {
    pub(super) fn read(&self) -> Result<(Option<&str>, Value), CommandError> {
        let in_type = |one: char| one.is_alphanumeric() || "_/".contains(one);
        let is_type = |text: &&str| text.contains('/') && text.chars().all(in_type);
        let first = self.type_name.as_deref();
        let type_name = first.filter(is_type);
        let text = match (&self.value, type_name) {
            (Some(_), None) => return Err(CommandError::Usage(UNQUOTED.to_owned())),
            (Some(value), Some(_)) => value,
            (None, None) => first.unwrap_or("{}"),
            (None, Some(_)) => "{}",
        };
        Ok((type_name, read(text)?))
    }
}

/// Reads a value in JSON or YAML.
///
/// # Errors
/// [`CommandError::Usage`] with the reader's message.
pub fn read(text: &str) -> Result<Value, CommandError> {
    // JSON has its own reader, because in YAML a pair of `\u` escapes is not one character.
    serde_json::from_str(text).or_else(|_| {
        read_yaml(&mut Parser::new_from_str(text)).map_err(|why| {
            let why = plain(&why);
            CommandError::Usage(format!("VALUE cannot be read as JSON or YAML: {why}"))
        })
    })
}

type Events<'a> = Parser<Chars<'a>>;

fn next(events: &mut Events<'_>) -> Result<Event, String> {
    let next = events.next_token().map_err(|error| error.to_string())?;
    Ok(next.0)
}

fn read_yaml(events: &mut Events<'_>) -> Result<Value, String> {
    next(events)?;
    if next(events)? == Event::StreamEnd {
        return Ok(Value::Null);
    }
    let first = next(events)?;
    let value = read_node(events, first, 0)?;
    next(events)?;
    match next(events)? {
        Event::StreamEnd => Ok(value),
        _ => Err("it must be one document, not several".to_owned()),
    }
}

/// Reads the value that begins with the event `first`.
fn read_node(events: &mut Events<'_>, first: Event, depth: usize) -> Result<Value, String> {
    if depth > MAX_NESTING {
        return Err(format!("it is nested more than {MAX_NESTING} deep"));
    }
    match first {
        Event::Scalar(text, TScalarStyle::Plain, _, None) => read_plain(text),
        Event::Scalar(text, _, _, None) => Ok(text.into()),
        Event::SequenceStart(_, None) => {
            let mut items = Vec::new();
            loop {
                match next(events)? {
                    Event::SequenceEnd => return Ok(items.into()),
                    item => items.push(read_node(events, item, depth + 1)?),
                }
            }
        }
        Event::MappingStart(_, None) => {
            let mut members = Map::new();
            loop {
                let name = match next(events)? {
                    Event::MappingEnd => return Ok(members.into()),
                    Event::Scalar(name, ..) => name,
                    _ => return Err("the name of a member must be a text".to_owned()),
                };
                let member = next(events)?;
                members.insert(name, read_node(events, member, depth + 1)?);
            }
        }
        _ => Err("aliases (*name) and tags (!name) are not supported".to_owned()),
    }
}

fn read_plain(text: String) -> Result<Value, String> {
    Ok(match Yaml::from_str(&text) {
        Yaml::Null => Value::Null,
        Yaml::Boolean(value) => value.into(),
        Yaml::Integer(value) => value.into(),
        number @ Yaml::Real(_) => {
            let number = number.as_f64().filter(|number| number.is_finite());
            let refusal = || format!("{text} is not a JSON number");
            number.ok_or_else(refusal)?.into()
        }
        _ => text.into(),
    })
}

/// The fields of a type, from the runtime.
#[derive(Deserialize)]
struct Layout {
    #[serde(rename = "type")]
    name: String,
    fieldnames: Vec<String>,
    fieldtypes: Vec<String>,
}

impl Session {
    /// Refuses a `value` for `name` with fields that its type does not have. `question` is rosapi's service for the
    /// type.
    pub(super) async fn check_fields(
        &mut self,
        name: &str,
        question: &str,
        type_name: &str,
        value: &Value,
    ) -> Result<(), CommandError> {
        let details = json!({"type": type_name});
        let layouts: Vec<Layout> = match self.ask(question, &details, "typedefs").await {
            Err(CommandError::Refused(_)) => return Ok(()),
            asked => asked?,
        };
        let Some(layout) = layouts.first() else {
            return Ok(());
        };
        let checked = match value {
            // A list has the values of all fields in order.
            Value::Array(items) => {
                let named = layout.fieldnames.iter().cloned().zip(items.iter().cloned());
                check(&layouts, &layout.name, &Value::Object(named.collect()), "")
            }
            _ => check(&layouts, &layout.name, value, ""),
        };
        checked.map_err(|why| CommandError::Usage(plain(&format!("{name} has {why}"))))
    }
}

/// Refuses the first field in `value`, at `path`, that its type does not have.
fn check(layouts: &[Layout], kind: &str, value: &Value, path: &str) -> Result<(), String> {
    let Some(layout) = layouts.iter().find(|one| one.name == kind) else {
        return Ok(());
    };
    match value {
        Value::Array(items) => (0..)
            .zip(items)
            .try_for_each(|(at, item)| check(layouts, kind, item, &format!("{path}[{at}]"))),
        Value::Object(members) => members.iter().try_for_each(|(name, member)| {
            let path = format!("{path}.{name}");
            let mut fields = layout.fieldnames.iter().zip(&layout.fieldtypes);
            match fields.find(|(field, _)| *field == name) {
                Some((_, kind)) => check(layouts, kind, member, &path),
                None if ROS_1.contains(&(kind, name)) => Ok(()),
                None => Err(layout.lacks(name, &path)),
            }
        }),
        Value::String(text) if text.contains(':') => Err(layout.lacks(text, text)),
        _ => Ok(()),
    }
}

impl Layout {
    /// The refusal of a field. In YAML, a name and a value without a space after the colon are one name.
    fn lacks(&self, name: &str, path: &str) -> String {
        let fields = match self.fieldnames.is_empty() {
            true => "none".to_owned(),
            false => self.fieldnames.join(", "),
        };
        let path = path.trim_start_matches('.');
        let refusal = format!("unknown field {path:?}; known fields: {fields}");
        match name.split_once(':') {
            Some((name, value)) => {
                let value = value.trim();
                format!("{refusal}. Put a space after the colon: {{{name}: {value}}}")
            }
            None => refusal,
        }
    }
}
