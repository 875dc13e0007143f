//! JSON and YAML: arguments in either are read as JSON, and what the runtime says in JSON is written as either.
//!
//! YAML is written here: the library's writer keeps an escape character in a text as it is, and a terminal obeys it.
//!
//! **Invariant:** members keep their order, numbers their value, and nothing in a text acts on a terminal.

use std::fmt;

use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};
use serde_json::value::RawValue;
use serde_json::{Map, Value};
use yaml_rust2::parser::{Event, Parser};
use yaml_rust2::{Yaml, YamlLoader};

use crate::protocol::limits::MAX_NESTING;
use crate::protocol::wire::text::{acts, push_quoted};

/// Texts that a reader of YAML would take for something else, in lower case.
const WORDS: [&str; 10] = [
    "true", "false", "null", "yes", "no", "on", "off", "y", "n", "~",
];

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

/// JSON on one line, as it came but for what acts on a terminal.
pub(super) fn json_line(raw: &RawValue) -> String {
    let mut line = String::with_capacity(raw.get().len() + 1);
    for character in raw.get().chars() {
        match character {
            // Between tokens; within a text JSON has none of them.
            '\t' | '\r' | '\n' => line.push(' '),
            _ if acts(character) => push_quoted(&mut line, character),
            _ => line.push(character),
        }
    }
    line.push('\n');
    line
}

/// The value as lines of YAML.
///
/// # Errors
/// If it is nested deeper than the runtime takes.
pub(super) fn lines(raw: &RawValue) -> Result<String, serde_json::Error> {
    let mut out = String::new();
    let writer = YamlWriter {
        out: &mut out,
        indent: 0,
        place: Slot::Top,
    };
    writer.deserialize(&mut serde_json::Deserializer::from_str(raw.get()))?;
    Ok(out)
}

/// Where a value stands.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Slot {
    Top,
    /// Behind a member's name.
    Member,
    /// Behind the dash of an item.
    Item,
}

/// Writes a value of JSON as YAML while it is read.
struct YamlWriter<'a> {
    out: &'a mut String,
    /// Spaces before the name or the dash that it stands behind.
    indent: usize,
    place: Slot,
}

impl YamlWriter<'_> {
    /// Goes to where the next member or item begins.
    fn begin(&mut self, indent: usize, is_first: bool) {
        match self.place {
            Slot::Item if is_first => self.out.push(' '),
            Slot::Member if is_first => self.out.push('\n'),
            _ => {}
        }
        if !(is_first && self.place == Slot::Item) {
            self.out.extend(std::iter::repeat_n(' ', indent));
        }
    }

    fn scalar(self, text: &str) {
        if self.place != Slot::Top {
            self.out.push(' ');
        }
        self.out.push_str(text);
        self.out.push('\n');
    }
}

impl<'de> DeserializeSeed<'de> for YamlWriter<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for YamlWriter<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value of JSON")
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        self.scalar("null");
        Ok(())
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<(), E> {
        self.scalar(if value { "true" } else { "false" });
        Ok(())
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<(), E> {
        self.scalar(&value.to_string());
        Ok(())
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<(), E> {
        self.scalar(&value.to_string());
        Ok(())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<(), E> {
        self.scalar(&number(value));
        Ok(())
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<(), E> {
        self.scalar(&text(value));
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut items: A) -> Result<(), A::Error> {
        // The dashes of a member stand under its name.
        let indent = self.indent + if self.place == Slot::Item { 2 } else { 0 };
        let mut is_first = true;
        loop {
            let before = self.out.len();
            self.begin(indent, is_first);
            self.out.push('-');
            let item = YamlWriter {
                out: self.out,
                indent,
                place: Slot::Item,
            };
            if items.next_element_seed(item)?.is_none() {
                self.out.truncate(before);
                break;
            }
            is_first = false;
        }
        if is_first {
            self.scalar("[]");
        }
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut members: A) -> Result<(), A::Error> {
        let indent = self.indent + if self.place == Slot::Top { 0 } else { 2 };
        let mut is_first = true;
        while let Some(name) = members.next_key::<String>()? {
            self.begin(indent, is_first);
            self.out.push_str(&text(&name));
            self.out.push(':');
            members.next_value_seed(YamlWriter {
                out: self.out,
                indent,
                place: Slot::Member,
            })?;
            is_first = false;
        }
        if is_first {
            self.scalar("{}");
        }
        Ok(())
    }
}

/// A number as YAML 1.1 knows it too, which Python reads: with a point, and a sign in the exponent.
fn number(value: f64) -> String {
    let text = format!("{value:?}");
    let Some((digits, exponent)) = text.split_once('e') else {
        return text;
    };
    let point = if digits.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{digits}{point}e{sign}{exponent}")
}

/// A text, quoted unless every reader takes it for one as it is.
fn text(value: &str) -> String {
    let is_plain = value
        .starts_with(|one: char| one.is_ascii_alphabetic() || one == '/' || one == '_')
        && value
            .chars()
            .all(|one| one.is_ascii_alphanumeric() || "/_.-+() ".contains(one))
        && !value.ends_with(' ')
        && !WORDS.contains(&value.to_ascii_lowercase().as_str());
    if is_plain {
        return value.to_owned();
    }
    let mut quoted = String::from('"');
    for character in value.chars() {
        push_quoted(&mut quoted, character);
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use proptest::collection::{btree_map, vec};
    use proptest::prelude::*;
    use proptest::sample::select;
    use serde_json::json;
    use serde_json::value::to_raw_value;

    use super::*;

    fn values() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<i64>().prop_map(Value::from),
            any::<f64>()
                .prop_filter("JSON has no others", |one| one.is_finite())
                .prop_map(Value::from),
            "\\PC{0,12}|[ -~\\s\\x00-\\x1f\u{80}-\u{9f}]{0,12}".prop_map(Value::from),
            select(&WORDS[..]).prop_map(Value::from),
            select(
                &[
                    "1",
                    "1e3",
                    ".5",
                    "0x1",
                    "2014-12-31",
                    "- a",
                    "a: b",
                    "a #",
                    "---"
                ][..]
            )
            .prop_map(Value::from),
        ];
        leaf.prop_recursive(4, 32, 4, |inner| {
            prop_oneof![
                vec(inner.clone(), 0..4).prop_map(Value::from),
                btree_map(".{0,8}", inner, 0..4)
                    .prop_map(|members| Value::Object(members.into_iter().collect())),
            ]
        })
    }

    proptest! {
        #[test]
        fn what_is_written_as_yaml_is_read_as_the_same_value(value in values()) {
            let raw = to_raw_value(&value).unwrap();
            let text = lines(&raw).unwrap();
            prop_assert!(!text.contains(|one| one != '\n' && acts(one)), "{text:?}");
            // With a comment it is no JSON.
            prop_assert_eq!(read(&format!("# YAML\n{text}")), Ok(value), "{}", text);
        }
    }

    #[test]
    fn numbers_are_such_as_python_reads_too() {
        for (value, text) in [
            (1.0, "1.0"),
            (1e-7, "1.0e-7"),
            (2.5e300, "2.5e+300"),
            (1e16, "1.0e+16"),
        ] {
            assert_eq!(number(value), text);
        }
    }

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

    #[test]
    fn a_line_of_json_is_one_line_and_keeps_what_it_says() {
        let text = "{\"a\":\t\"\u{9b}31m\u{202e}\u{7f}\",\r\n\"b\": 1.50}";
        let line = json_line(&RawValue::from_string(text.to_owned()).unwrap());
        assert_eq!(
            line,
            "{\"a\": \"\\u009b31m\\u202e\\u007f\",  \"b\": 1.50}\n"
        );
    }
}
