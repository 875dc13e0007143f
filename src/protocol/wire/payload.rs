//! A client's JSON that is forwarded or echoed: ids, messages, arguments, answers.
//!
//! **Invariant:** it is parsed once, on arrival. Its text is one line of valid JSON, ready to be copied.

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
    /// The output text, if it differs from the input.
    line: Option<Box<RawValue>>,
}

impl Payload {
    /// The input value. Numbers that overflow are unchanged, so a reader can reject them by name.
    #[must_use]
    pub fn raw(&self) -> &RawValue {
        &self.0.raw
    }

    /// The input text.
    #[must_use]
    pub fn get(&self) -> &str {
        self.0.raw.get()
    }

    /// Bytes of memory, shared or not: its text, the output text if it differs, and their overhead.
    #[must_use]
    pub fn allocated(&self) -> usize {
        let counts = 2 * size_of::<usize>();
        let line = self.0.line.as_ref().map_or(0, |line| line.get().len());
        counts + size_of::<Inner>() + self.get().len() + line
    }

    /// The output text: [strict](json::strict), on one line.
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
        // Valid JSON has line ends only between tokens. Some readers treat a carriage return as a line end, and would
        // read the text between two of them as a frame.
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

/// The output text.
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
