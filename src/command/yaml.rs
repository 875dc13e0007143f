//! Arguments in JSON or YAML, read as JSON.
//!
//! **Invariant:** what is read is no deeper than the runtime takes.

use serde_json::{Map, Value};
use yaml_rust2::parser::{Event, Parser};
use yaml_rust2::{Yaml, YamlLoader};

use crate::protocol::limits::MAX_NESTING;

/// Reads a value in JSON or YAML.
///
/// # Errors
/// The reader's complaint.
pub(super) fn read(text: &str) -> Result<Value, String> {
    // JSON as JSON has it: to YAML, pairs of `\u` escapes are no characters.
    if let Ok(value) = serde_json::from_str(text) {
        return Ok(value);
    }
    refuse_depth(text)?;
    let mut documents = YamlLoader::load_from_str(text).map_err(|error| error.to_string())?;
    match (documents.pop(), documents.is_empty()) {
        (None, _) => Ok(Value::Null),
        (Some(document), true) => value(document),
        _ => Err("it is more than one document".to_owned()),
    }
}

/// Refuses what would be deep: nested as such, or by names that stand for other parts.
fn refuse_depth(text: &str) -> Result<(), String> {
    let mut parser = Parser::new_from_str(text);
    let mut depth = 0_usize;
    loop {
        match parser.next_token().map_err(|error| error.to_string())?.0 {
            Event::SequenceStart(..) | Event::MappingStart(..) => depth += 1,
            Event::SequenceEnd | Event::MappingEnd => depth = depth.saturating_sub(1),
            Event::Alias(_) => return Err("an alias (*name) is not taken".to_owned()),
            Event::StreamEnd => return Ok(()),
            _ => {}
        }
        if depth > MAX_NESTING {
            return Err(format!("it is nested more than {MAX_NESTING} deep"));
        }
    }
}

fn value(yaml: Yaml) -> Result<Value, String> {
    Ok(match yaml {
        Yaml::Null => Value::Null,
        Yaml::Boolean(value) => value.into(),
        Yaml::Integer(value) => value.into(),
        Yaml::String(text) => text.into(),
        Yaml::Real(ref text) => {
            let number = yaml.as_f64().filter(|number| number.is_finite());
            number
                .ok_or_else(|| format!("{text} is no number of JSON"))?
                .into()
        }
        Yaml::Array(items) => {
            let items: Result<Vec<Value>, String> = items.into_iter().map(value).collect();
            items?.into()
        }
        Yaml::Hash(members) => {
            let mut object = Map::new();
            for (name, member) in members {
                let name = match name {
                    Yaml::String(name) | Yaml::Real(name) => name,
                    Yaml::Integer(name) => name.to_string(),
                    _ => return Err("the name of a member is no text".to_owned()),
                };
                object.insert(name, value(member)?);
            }
            object.into()
        }
        Yaml::Alias(_) | Yaml::BadValue => return Err("it has a value without meaning".to_owned()),
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn arguments_are_read_as_json_has_them_and_else_as_yaml_has() {
        for (text, value) in [
            ("", json!(null)),
            (
                "{x: 1, y: 0.5, on: off}",
                json!({"x": 1, "y": 0.5, "on": "off"}),
            ),
            (
                "{\"a\": \"\\ud83d\\ude00\", \"b\": 18446744073709551615}",
                json!({"a": "\u{1f600}", "b": u64::MAX}),
            ),
            (
                "a: [0x10, 1e3, ~]\nb: !t &x [16, .5]",
                json!({"a": [16, 1000.0, null], "b": [16, 0.5]}),
            ),
            ("1: one", json!({"1": "one"})),
        ] {
            assert_eq!(read(text), Ok(value), "{text}");
        }
        for text in [
            "{",
            "a: 1\n---\na: 2",
            "[.inf]",
            "{[1]: 2}",
            "*x",
            "!!float abc",
        ] {
            assert!(read(text).is_err(), "{text}");
        }
    }
}
