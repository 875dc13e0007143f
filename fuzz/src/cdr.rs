//! A second reading of CDR (little-endian, as ROS 2 writes it), by the text of a message's definition, into JSON.
//!
//! The text is what any client is told of a type; the runtime's own table is not looked at. A number that is not finite reads
//! as `null`.

use std::collections::HashMap;

use crate::json::Json;

/// The fields of every type that a definition's text has, by the type's short name.
#[derive(Debug)]
pub struct Definition {
    first: Vec<Field>,
    parts: HashMap<String, Vec<Field>>,
}

/// A field.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Its type, without brackets.
    pub kind: String,
    /// Whether it is an array.
    pub is_many: bool,
    /// The length of an array that has always the same.
    pub length: Option<usize>,
    /// Its name.
    pub name: String,
}

impl Definition {
    /// Reads the text of a `.msg` file, with those of the types inside behind it.
    #[must_use]
    pub fn read(text: &str) -> Self {
        let line = "=".repeat(80);
        let mut sections = text.split(&line).map(|section| {
            let section = section.trim_start();
            match section
                .strip_prefix("MSG: ")
                .and_then(|rest| rest.split_once('\n'))
            {
                Some((name, fields)) => (name.to_owned(), fields_of(fields)),
                None => (String::new(), fields_of(section)),
            }
        });
        let (_, first) = sections.next().unwrap_or_default();
        let parts = sections.collect();
        Self { first, parts }
    }

    /// The fields of the type that is defined.
    #[must_use]
    pub fn fields(&self) -> &[Field] {
        &self.first
    }

    /// The fields of a type inside it; `None` for a primitive.
    #[must_use]
    pub fn part(&self, kind: &str) -> Option<&[Field]> {
        self.parts.get(kind).map(Vec::as_slice)
    }

    /// Reads a whole message; `None` unless it is one, to the last byte, with nothing but zeros between its values.
    #[must_use]
    pub fn decode(&self, bytes: &[u8]) -> Option<Json> {
        let body = bytes.strip_prefix(&[0, 1, 0, 0])?;
        let mut reading = Reading { body, at: 0 };
        let message = reading.message(self, &self.first)?;
        (reading.at == body.len()).then_some(message)
    }
}

fn fields_of(text: &str) -> Vec<Field> {
    let lines = text
        .lines()
        .map(|line| line.split('#').next().unwrap_or_default());
    let words = lines.filter_map(|line| line.trim().split_once(' '));
    // A constant has its value behind its name.
    let fields = words.filter(|(_, name)| !name.contains('='));
    let field = |(kind, name): (&str, &str)| {
        let (single, length) = kind.split_once('[').unwrap_or((kind, ""));
        Field {
            kind: single.to_owned(),
            is_many: kind.ends_with(']'),
            // Where it is bounded, or not at all, this is no number.
            length: length.trim_end_matches(']').parse().ok(),
            name: name.trim().to_owned(),
        }
    };
    fields.map(field).collect()
}

struct Reading<'a> {
    body: &'a [u8],
    at: usize,
}

impl Reading<'_> {
    fn message(&mut self, all: &Definition, fields: &[Field]) -> Option<Json> {
        let mut members = Vec::new();
        for field in fields {
            let value = if field.is_many {
                let count = match field.length {
                    Some(length) => length,
                    None => usize::try_from(u32::from_le_bytes(self.primitive()?)).ok()?,
                };
                let entries: Option<_> =
                    (0..count).map(|_| self.single(all, &field.kind)).collect();
                Json::Array(entries?)
            } else {
                self.single(all, &field.kind)?
            };
            members.push((Some(field.name.clone()), value));
        }
        Some(Json::Object(members))
    }

    fn single(&mut self, all: &Definition, kind: &str) -> Option<Json> {
        let float = |number: f64, text: String| {
            if number.is_finite() {
                Json::Number(text)
            } else {
                Json::Null
            }
        };
        Some(match kind {
            "bool" => match self.primitive()? {
                [0] => Json::Boolean(false),
                [1] => Json::Boolean(true),
                _ => return None,
            },
            "byte" | "uint8" | "char" => {
                Json::Number(u8::from_le_bytes(self.primitive()?).to_string())
            }
            "int8" => Json::Number(i8::from_le_bytes(self.primitive()?).to_string()),
            "uint16" => Json::Number(u16::from_le_bytes(self.primitive()?).to_string()),
            "int32" => Json::Number(i32::from_le_bytes(self.primitive()?).to_string()),
            "uint32" => Json::Number(u32::from_le_bytes(self.primitive()?).to_string()),
            "int64" => Json::Number(i64::from_le_bytes(self.primitive()?).to_string()),
            "uint64" => Json::Number(u64::from_le_bytes(self.primitive()?).to_string()),
            "float32" => {
                let number = f32::from_le_bytes(self.primitive()?);
                float(number.into(), format!("{:e}", f64::from(number)))
            }
            "float64" => {
                let number = f64::from_le_bytes(self.primitive()?);
                float(number, format!("{number:e}"))
            }
            "string" => {
                let length = usize::try_from(u32::from_le_bytes(self.primitive()?)).ok()?;
                let bytes = self.body.get(self.at..self.at + length)?;
                self.at += length;
                let (nul, text) = bytes.split_last()?;
                if *nul != 0 {
                    return None;
                }
                Json::Text(Some(String::from_utf8(text.to_vec()).ok()?))
            }
            part => self.message(all, all.part(part)?)?,
        })
    }

    /// The bytes of a primitive, which stands at the next multiple of its size.
    fn primitive<const SIZE: usize>(&mut self) -> Option<[u8; SIZE]> {
        let start = self.at.div_ceil(SIZE) * SIZE;
        let gap = self.body.get(self.at..start)?;
        let bytes = self.body.get(start..start + SIZE)?;
        if gap.iter().any(|byte| *byte != 0) {
            return None;
        }
        self.at = start + SIZE;
        bytes.try_into().ok()
    }
}
