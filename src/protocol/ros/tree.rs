//! A JSON message for conversion to another encoding.
//!
//! A value takes [`VALUE_BYTES`], and the name of a member takes as much. There is at most one value for every two
//! bytes of text, and each array is one allocation. So the longest message takes at most 64 MiB. Its worst case is
//! deeply nested arrays. Texts are borrowed from the input, unless they have escapes.
//!
//! **Invariant:** the members of an object are sorted by name, and each name is there once. Of repeated names the last
//! member counts.

use std::borrow::Cow;
use std::fmt;

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Number, Value};

/// Bytes of memory for each value, and for each member's name.
pub const VALUE_BYTES: usize = size_of::<MessageTree<'_>>();
const _: () = assert!(VALUE_BYTES <= 24, "the longest message takes more");

/// A parsed JSON value with its contents.
#[derive(Debug, Clone, PartialEq)]
pub enum MessageTree<'a> {
    /// `null`.
    Null,
    /// `true` or `false`.
    Bool(bool),
    /// A number.
    Number(Number),
    /// A text, without its escapes.
    Text(Cow<'a, str>),
    /// An array's entries.
    Array(Box<[Self]>),
    /// An object's members.
    Object(Box<[(TreeText<'a>, Self)]>),
}

/// The name of a member.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, serde::Deserialize)]
pub struct TreeText<'a>(#[serde(borrow)] pub Cow<'a, str>);

impl<'a> MessageTree<'a> {
    /// Reads a JSON text.
    ///
    /// # Errors
    /// If it is not JSON, is nested deeper than 127 levels, or has a number beyond the range of doubles.
    pub fn read(text: &'a [u8]) -> Result<Self, serde_json::Error> {
        serde_json::from_slice(text)
    }

    /// The object's member of that name.
    #[must_use]
    pub fn get(&self, name: &str) -> Option<&Self> {
        let mut members = self.members()?.iter();
        let member = members.find(|(TreeText(one), _)| one == name);
        member.map(|(_, value)| value)
    }

    /// The value at that path. Each part is a slash with the name of a member, or `0` for an array's first entry.
    #[must_use]
    pub fn pointer(&self, way: &str) -> Option<&Self> {
        way.split('/').skip(1).try_fold(self, |at, part| match at {
            Self::Array(entries) => entries.first().filter(|_| part == "0"),
            _ => at.get(part),
        })
    }

    /// The entries, if it is an array.
    #[must_use]
    pub fn entries(&self) -> Option<&[Self]> {
        match self {
            Self::Array(entries) => Some(entries),
            _ => None,
        }
    }

    /// The members, if it is an object.
    #[must_use]
    pub fn members(&self) -> Option<&[(TreeText<'a>, Self)]> {
        match self {
            Self::Object(members) => Some(members),
            _ => None,
        }
    }

    /// The number, if it is one.
    #[must_use]
    pub fn number(&self) -> Option<&Number> {
        match self {
            Self::Number(number) => Some(number),
            _ => None,
        }
    }
}

impl<'a> From<&'a Value> for MessageTree<'a> {
    fn from(value: &'a Value) -> Self {
        Self::deserialize(value).unwrap_or_else(|_| {
            debug_assert!(false, "every value can be read");
            Self::Null
        })
    }
}

impl<'de: 'a, 'a> Deserialize<'de> for MessageTree<'a> {
    fn deserialize<D: Deserializer<'de>>(reader: D) -> Result<Self, D::Error> {
        reader.deserialize_any(TreeVisitor)
    }
}

struct TreeVisitor;

impl<'de> Visitor<'de> for TreeVisitor {
    type Value = MessageTree<'de>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Self::Value, E> {
        Ok(MessageTree::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Self::Value, E> {
        Ok(MessageTree::Bool(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Self::Value, E> {
        Ok(MessageTree::Number(value.into()))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Self::Value, E> {
        Ok(MessageTree::Number(value.into()))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Self::Value, E> {
        Ok(Number::from_f64(value).map_or(MessageTree::Null, MessageTree::Number))
    }

    fn visit_borrowed_str<E>(self, value: &'de str) -> Result<Self::Value, E> {
        Ok(MessageTree::Text(Cow::Borrowed(value)))
    }

    fn visit_str<E>(self, value: &str) -> Result<Self::Value, E> {
        Ok(MessageTree::Text(Cow::Owned(value.to_owned())))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Self::Value, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = seq.next_element()? {
            entries.push(entry);
        }
        Ok(MessageTree::Array(entries.into()))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut members: Vec<(TreeText<'de>, MessageTree<'de>)> = Vec::new();
        while let Some(member) = map.next_entry()? {
            members.push(member);
        }
        if !members.is_sorted_by(|(one, _), (next, _)| one < next) {
            // The sort is stable. After it, the last member of a name is the first of them.
            members.reverse();
            members.sort_by(|(one, _), (other, _)| one.cmp(other));
            members.dedup_by(|(name, _), (before, _)| name == before);
        }
        Ok(MessageTree::Object(members.into()))
    }
}
