//! Reads subscriptions and levels of statuses.
//!
//! **Invariant:** every number is within its limit, and a binary encoding has no fragment size.

use std::time::Duration;

use super::types::{Compression, Encoding, MAX_QUEUE_LENGTH, MAX_THROTTLE, Subscribe, Verbosity};
use super::{Members, Problem, duration};
use crate::protocol::messages::{ErrorForm, Level};
use crate::protocol::wire::json;

impl Members<'_> {
    pub(super) fn subscription(&self) -> Result<Subscribe, Problem> {
        if let Some(id) = self.get("id") {
            self.short("id", id.get())?;
        }
        Ok(Subscribe {
            topic: self.name("topic")?,
            type_name: self.optional_text("type")?,
            throttle: self.throttle()?,
            queue_length: self.queue_length()?,
            // Merging with the default removes the fragment size of a binary encoding, which is never split.
            encoding: Encoding::default().merged(Encoding {
                compression: self.compression()?,
                fragment_size: self.fragment_size()?,
                ros1_stamps: false,
            }),
        })
    }

    fn compression(&self) -> Result<Compression, Problem> {
        let expected = "none, png, cbor or cbor-raw";
        let compression = self.optional("compression", expected, |raw| {
            match json::text(raw)?.as_ref() {
                "none" | "png" => Some(Compression::None),
                "cbor" => Some(Compression::Cbor),
                "cbor-raw" => Some(Compression::CborRaw),
                _ => None,
            }
        })?;
        Ok(compression.unwrap_or_default())
    }

    fn fragment_size(&self) -> Result<Option<usize>, Problem> {
        let size = self.optional("fragment_size", "an integer, at least 1", |raw| {
            match raw.get() {
                "null" => Some(None),
                _ => json::integer(raw).filter(|size| *size > 0).map(Some),
            }
        })?;
        // With only powers of two, a message is split in few ways, for any number of subscribers.
        let size = size.flatten().map(|size| 1 << size.ilog2());
        Ok(size.and_then(|size: u64| usize::try_from(size).ok()))
    }

    fn throttle(&self) -> Result<Duration, Problem> {
        let expected = "a number of ms, at least 0";
        let rate = self.optional("throttle_rate", expected, |raw| {
            json::number(raw).filter(|rate| rate.is_finite() && *rate >= 0.0)
        })?;
        Ok(duration(rate.unwrap_or_default() / 1000.0, MAX_THROTTLE))
    }

    fn queue_length(&self) -> Result<usize, Problem> {
        let length = self.optional("queue_length", "an integer, at least 0", json::integer)?;
        let length = usize::try_from(length.unwrap_or_default());
        Ok(length.unwrap_or(MAX_QUEUE_LENGTH).min(MAX_QUEUE_LENGTH))
    }

    pub(super) fn verbosity(&self) -> Result<Verbosity, Problem> {
        let expected = "info, warning, error or none";
        self.typed("level", expected, |raw| {
            let name = json::text(raw)?;
            let mut levels = Level::ALL.into_iter();
            let level = levels.find(|level| level.name() == name);
            (level.is_some() || name == "none").then_some(Verbosity(level))
        })
    }

    pub(super) fn error_form(&self) -> Result<Option<ErrorForm>, Problem> {
        self.optional("errors", "object or text", |raw| {
            let name = json::text(raw)?;
            let mut forms = ErrorForm::ALL.into_iter();
            forms.find(|form| form.name() == name)
        })
    }
}
