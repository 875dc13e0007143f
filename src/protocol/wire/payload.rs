//! A client's JSON that is passed on or echoed: ids, messages, arguments, answers.
//!
//! **Invariant:** it is read once, when it comes. Its text is one line of valid JSON, ready to be copied.

use std::borrow::Cow;
use std::sync::Arc;

use serde::{Serialize, Serializer};
use serde_json::value::RawValue;

use super::json;

/// A JSON value as a client sent it. Cheap to clone.
#[derive(Debug, Clone)]
pub struct Payload(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    raw: Box<RawValue>,
    /// The text as it is written, if it differs from what came.
    line: Option<Box<RawValue>>,
}

impl Payload {
    /// The value as it came: numbers that overflow are still there, so that a reader can refuse them by name.
    #[must_use]
    pub fn raw(&self) -> &RawValue {
        &self.0.raw
    }

    /// The text as it came.
    #[must_use]
    pub fn get(&self) -> &str {
        self.0.raw.get()
    }

    /// Bytes that it takes, shared or not: its text, the line if that is another text, and what keeps them.
    #[must_use]
    pub fn allocated(&self) -> usize {
        let counts = 2 * size_of::<usize>();
        let line = self.0.line.as_ref().map_or(0, |line| line.get().len());
        counts + size_of::<Inner>() + self.get().len() + line
    }

    /// The text as it is written: [strict](json::strict), on one line.
    #[must_use]
    pub fn line(&self) -> &str {
        self.written().get()
    }

    fn written(&self) -> &RawValue {
        self.0.line.as_ref().unwrap_or(&self.0.raw)
    }
}

impl From<Box<RawValue>> for Payload {
    fn from(raw: Box<RawValue>) -> Self {
        let strict = json::strict(raw.get());
        // Valid JSON has line ends between tokens only. Some readers take a carriage return for one: then what another
        // client has put between two of them would be a frame to them.
        let line = match strict {
            text if text.contains('\r') || text.contains('\n') => {
                Some(text.replace(['\r', '\n'], " "))
            }
            Cow::Owned(text) => Some(text),
            Cow::Borrowed(_) => None,
        };
        let line = line.and_then(|line| RawValue::from_string(line).ok());
        Self(Arc::new(Inner { raw, line }))
    }
}

impl From<&RawValue> for Payload {
    fn from(raw: &RawValue) -> Self {
        raw.to_owned().into()
    }
}

/// As it is written.
impl Serialize for Payload {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.written().serialize(serializer)
    }
}

impl PartialEq for Payload {
    fn eq(&self, other: &Self) -> bool {
        self.get() == other.get()
    }
}

impl Eq for Payload {}
