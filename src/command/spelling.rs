//! Values that the runtime says in JSON, spelled as YAML or as a line of JSON.
//!
//! YAML is written here: the library's writer keeps an escape character in a text as it is, and a terminal obeys it.
//!
//! **Invariant:** members keep their order, numbers their value, and nothing in a text acts on a terminal.

use std::fmt;

use serde::Deserializer;
use serde::de::{DeserializeSeed, Error, MapAccess, SeqAccess, Visitor};
use serde_json::value::RawValue;

use super::error::CommandError;
use crate::protocol::wire::text::{acts, push_quoted};

/// Texts that a reader of YAML would take for something else, in lower case.
const WORDS: [&str; 10] = [
    "true", "false", "null", "yes", "no", "on", "off", "y", "n", "~",
];

/// Bytes of YAML after which they are printed: what is nested deep has a hundred times the bytes that it has in JSON.
const PIECE: usize = 64 * 1024;

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

/// Prints the value as lines of YAML, piece by piece, and `end` behind them.
///
/// # Errors
/// If it is nested deeper than the runtime takes, or that of `print`.
pub(super) fn print_yaml(
    raw: &RawValue,
    end: &str,
    print: &mut dyn FnMut(&str) -> Result<(), CommandError>,
) -> Result<(), CommandError> {
    let mut pieces = PrintedText {
        text: String::new(),
        print,
        failed: None,
    };
    let writer = YamlWriter {
        pieces: &mut pieces,
        indent: 0,
        place: Slot::Top,
    };
    let written = writer.deserialize(&mut serde_json::Deserializer::from_str(raw.get()));
    if let Some(failed) = pieces.failed {
        return Err(failed);
    }
    written.map_err(|error| CommandError::Lost(format!("no frame came: {error}")))?;
    pieces.text.push_str(end);
    (pieces.print)(&pieces.text)
}

/// Text that is printed whenever it has become long.
struct PrintedText<'a> {
    text: String,
    print: &'a mut dyn FnMut(&str) -> Result<(), CommandError>,
    /// Why nothing more is printed.
    failed: Option<CommandError>,
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
struct YamlWriter<'a, 'b> {
    pieces: &'a mut PrintedText<'b>,
    /// Spaces before the name or the dash that it stands behind.
    indent: usize,
    place: Slot,
}

impl YamlWriter<'_, '_> {
    /// Goes to where the next member or item begins.
    fn begin(&mut self, indent: usize, is_first: bool) {
        match self.place {
            Slot::Item if is_first => self.pieces.text.push(' '),
            Slot::Member if is_first => self.pieces.text.push('\n'),
            _ => {}
        }
        if !(is_first && self.place == Slot::Item) {
            self.pieces.text.extend(std::iter::repeat_n(' ', indent));
        }
    }

    /// Writes a value that has no parts: the end of a line, and of a piece that is long enough.
    fn scalar<E: Error>(self, text: &str) -> Result<(), E> {
        let pieces = self.pieces;
        if self.place != Slot::Top {
            pieces.text.push(' ');
        }
        pieces.text.push_str(text);
        pieces.text.push('\n');
        if pieces.text.len() >= PIECE {
            if let Err(why) = (pieces.print)(&pieces.text) {
                pieces.failed = Some(why);
                return Err(E::custom("not printed"));
            }
            pieces.text.clear();
        }
        Ok(())
    }
}

impl<'de> DeserializeSeed<'de> for YamlWriter<'_, '_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for YamlWriter<'_, '_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value of JSON")
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        self.scalar("null")
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<(), E> {
        self.scalar(if value { "true" } else { "false" })
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<(), E> {
        self.scalar(&value.to_string())
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<(), E> {
        self.scalar(&value.to_string())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<(), E> {
        self.scalar(&number(value))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<(), E> {
        self.scalar(&text(value))
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut items: A) -> Result<(), A::Error> {
        // The dashes of a member stand under its name.
        let indent = self.indent + if self.place == Slot::Item { 2 } else { 0 };
        let mut is_first = true;
        loop {
            let before = self.pieces.text.len();
            self.begin(indent, is_first);
            self.pieces.text.push('-');
            let item = YamlWriter {
                pieces: self.pieces,
                indent,
                place: Slot::Item,
            };
            if items.next_element_seed(item)?.is_none() {
                self.pieces.text.truncate(before);
                break;
            }
            is_first = false;
        }
        if is_first {
            return self.scalar("[]");
        }
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut members: A) -> Result<(), A::Error> {
        let indent = self.indent + if self.place == Slot::Top { 0 } else { 2 };
        let mut is_first = true;
        while let Some(name) = members.next_key::<String>()? {
            self.begin(indent, is_first);
            self.pieces.text.push_str(&text(&name));
            self.pieces.text.push(':');
            members.next_value_seed(YamlWriter {
                pieces: self.pieces,
                indent,
                place: Slot::Member,
            })?;
            is_first = false;
        }
        if is_first {
            return self.scalar("{}");
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
    use serde_json::Value;
    use serde_json::value::to_raw_value;

    use super::super::yaml::read;
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
            let mut text = String::new();
            let mut print = |piece: &str| {
                text += piece;
                Ok(())
            };
            print_yaml(&raw, "", &mut print).unwrap();
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
    fn a_line_of_json_is_one_line_and_keeps_what_it_says() {
        let text = "{\"a\":\t\"\u{9b}31m\u{202e}\u{7f}\",\r\n\"b\": 1.50}";
        let line = json_line(&RawValue::from_string(text.to_owned()).unwrap());
        assert_eq!(
            line,
            "{\"a\": \"\\u009b31m\\u202e\\u007f\",  \"b\": 1.50}\n"
        );
    }

    #[test]
    fn a_long_value_is_printed_in_pieces_until_nobody_reads() {
        let raw = to_raw_value(&vec![vec!["text"; 1000]; 100]).unwrap();
        let mut lengths = Vec::new();
        let mut whole = |piece: &str| {
            lengths.push(piece.len());
            Ok(())
        };
        print_yaml(&raw, "---\n", &mut whole).unwrap();
        assert_eq!(
            lengths.iter().sum::<usize>(),
            100_000 * "  - text\n".len() + 4
        );
        assert!(
            lengths.iter().all(|length| *length < PIECE + 100),
            "{lengths:?}"
        );
        let mut count = 0;
        let mut closed = |_: &str| {
            count += 1;
            Err(CommandError::Closed)
        };
        let printed = print_yaml(&raw, "", &mut closed);
        assert!(matches!(printed, Err(CommandError::Closed)), "{printed:?}");
        assert_eq!(count, 1);
    }
}
