//! JSON read by `serde_json`, with more detail than its own values: numbers keep their text, and an object keeps every
//! member in order. A string with half of a surrogate pair is a string without a text.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, Visitor};
use serde_json::value::RawValue;

/// A value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Json {
    /// `null`.
    Null,
    /// `true` or `false`.
    Boolean(bool),
    /// A number, as it is written.
    Number(String),
    /// A string, unless it holds half a surrogate pair.
    Text(Option<String>),
    /// An array.
    Array(Vec<Json>),
    /// An object's members in their order; a key may be no text, and may come twice.
    Object(Vec<(Option<String>, Json)>),
}

impl Json {
    /// Reads a text that is one value.
    #[must_use]
    pub fn read(text: &str) -> Option<Self> {
        let raw: &RawValue = serde_json::from_str(text).ok()?;
        Self::of(raw)
    }

    fn of(raw: &RawValue) -> Option<Self> {
        let text = raw.get();
        Some(match text.as_bytes().first()? {
            b'n' => Self::Null,
            b't' => Self::Boolean(true),
            b'f' => Self::Boolean(false),
            b'"' => Self::Text(serde_json::from_str(text).ok()),
            b'[' => {
                let entries: Vec<&RawValue> = serde_json::from_str(text).ok()?;
                Self::Array(entries.into_iter().map(Self::of).collect::<Option<_>>()?)
            }
            b'{' => Self::Object(serde_json::from_str::<Members>(text).ok()?.0),
            _ => Self::Number(text.to_owned()),
        })
    }

    /// The member of that name, the last one where there are several.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Self> {
        let Self::Object(members) = self else {
            return None;
        };
        let mut named = members.iter().rev();
        let found = named.find(|(key, _)| key.as_deref() == Some(name));
        found.map(|(_, value)| value)
    }

    /// The text of a string.
    #[must_use]
    pub fn text(&self) -> Option<&str> {
        match self {
            Self::Text(text) => text.as_deref(),
            _ => None,
        }
    }

    /// The value of a number, infinite where it overflows.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Number(text) => text.parse().ok(),
            _ => None,
        }
    }

    /// Whether a number in it overflows an `f64`.
    #[must_use]
    pub fn overflows(&self) -> bool {
        match self {
            Self::Number(_) => self.number().is_some_and(f64::is_infinite),
            Self::Array(entries) => entries.iter().any(Self::overflows),
            Self::Object(members) => members.iter().any(|(_, value)| value.overflows()),
            _ => false,
        }
    }

    /// Whether this is the forwarded form of `sent`: a number that overflows is `null`, and any other number satisfies
    /// `same_number`.
    #[must_use]
    pub fn becomes(&self, received: &Self, same_number: fn(&Self, &Self) -> bool) -> bool {
        match (self, received) {
            (Self::Number(_), Self::Null) => self.overflows(),
            (Self::Number(_), Self::Number(_)) => same_number(self, received),
            (Self::Array(sent), Self::Array(received)) => {
                let mut pairs = sent.iter().zip(received);
                sent.len() == received.len()
                    && pairs.all(|(sent, received)| sent.becomes(received, same_number))
            }
            (Self::Object(sent), Self::Object(received)) => {
                let mut pairs = sent.iter().zip(received);
                sent.len() == received.len()
                    && pairs.all(|((key, sent), (same_key, received))| {
                        key == same_key && sent.becomes(received, same_number)
                    })
            }
            _ => self == received,
        }
    }
}

/// The members of an object, all of them, in their order.
struct Members(Vec<(Option<String>, Json)>);

impl<'de> Deserialize<'de> for Members {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Members(Vec::new()))
    }
}

impl<'de> Visitor<'de> for Members {
    type Value = Self;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut map: A) -> Result<Self, A::Error> {
        while let Some((key, value)) = map.next_entry::<&RawValue, &RawValue>()? {
            let value = Json::of(value).ok_or_else(|| A::Error::custom("no JSON"))?;
            self.0.push((serde_json::from_str(key.get()).ok(), value));
        }
        Ok(self)
    }
}
