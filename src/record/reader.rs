//! Reads a record, message by message, up to the end of the file.
//!
//! **Invariant:** nothing is read from a damaged chunk. A message is read by this version's definition of its type.
//! A message with another definition is skipped.

use std::collections::HashMap;
use std::io::{self, Read};

use mcap::McapError;
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use serde_json::Value;

use super::schema::{CALL, INPUT, STATE};
use crate::protocol::catalog::types::{self, Type};
use crate::protocol::ros::cdr_reader::{self, CdrError};
use crate::protocol::wire::text::{excerpt, shortened};

/// Longest chunk that is read. Longer ones are never written.
pub(super) const MAX_CHUNK: usize = 16 * 1024 * 1024;

/// A message of the record.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedMessage {
    /// Its time, in nanoseconds since 1970.
    pub log_time: u64,
    /// The channel's topic.
    pub topic: String,
    /// Its number on that channel, from 1.
    pub sequence: u32,
    /// The message; `None` if its type has another definition.
    pub msg: Option<Value>,
}

/// How a file ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordEnding {
    /// The file is complete.
    Whole,
    /// The file was truncated, or the program that wrote it was killed.
    Truncated,
}

/// Why a file cannot be read further.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The system cannot read it.
    #[error(transparent)]
    File(io::Error),
    /// Its chunks are compressed, as some tools write them.
    #[error(
        "its messages are compressed ({}), and only records without compression are read; convert it with \
         `mcap compress --compression none`",
        shortened(.0, 20)
    )]
    Compressed(String),
    /// It is not an MCAP file, or is damaged.
    #[error("not a record, or damaged: {}", shortened(&.0.to_string(), 200))]
    Mcap(McapError),
    /// A message that does not match its definition.
    #[error("{}: {why}", excerpt(topic))]
    Message {
        /// The channel's topic.
        topic: String,
        /// The fault.
        why: CdrError,
    },
}

impl From<McapError> for ReadError {
    fn from(error: McapError) -> Self {
        match error {
            McapError::Io(error) => Self::File(error),
            McapError::UnsupportedCompression(name) => Self::Compressed(name),
            error => Self::Mcap(error),
        }
    }
}

/// A reader of a record.
pub struct Recording<R> {
    reader: MessageReader<R>,
    /// The type of each schema id, if its definition is known.
    known: HashMap<u16, Option<Type>>,
    ending: Option<RecordEnding>,
}

impl<R: Read> Recording<R> {
    /// A reader of this file.
    pub fn new(file: R) -> Self {
        let options = LinearReaderOptions::default()
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(MAX_CHUNK);
        Self {
            reader: MessageReader::new_with_options(file, options),
            known: HashMap::new(),
            ending: None,
        }
    }

    /// The next message; `None` at the end.
    ///
    /// # Errors
    /// If the file is damaged before its end.
    pub fn next_passage(&mut self) -> Result<Option<RecordedMessage>, ReadError> {
        let message = match self.reader.next() {
            Some(Ok(message)) => message,
            Some(Err(McapError::UnexpectedEof)) => {
                self.ending = Some(RecordEnding::Truncated);
                return Ok(None);
            }
            Some(Err(error)) => return Err(error.into()),
            None => {
                self.ending.get_or_insert(RecordEnding::Whole);
                return Ok(None);
            }
        };
        let topic = message.channel.topic.clone();
        let schema = message.channel.schema.as_ref();
        let one = schema.and_then(|schema| {
            let known = self.known.entry(schema.id);
            *known.or_insert_with(|| known_type(&schema.name, &schema.data))
        });
        let read = |one| {
            cdr_reader::decode(one, &message.data).map_err(|why| ReadError::Message {
                topic: topic.clone(),
                why,
            })
        };
        let msg = one.map(read).transpose()?;
        Ok(Some(RecordedMessage {
            log_time: message.log_time,
            topic,
            sequence: message.sequence,
            msg,
        }))
    }

    /// How the file ended; `None` before its end.
    #[must_use]
    pub fn ending(&self) -> Option<RecordEnding> {
        self.ending
    }
}

/// The type of that name, if its definition is the same as here.
pub(super) fn known_type(name: &str, definition: &[u8]) -> Option<Type> {
    let own = [INPUT, STATE, CALL];
    let own = own.into_iter().find(|one| one.name == name);
    let one = own.or_else(|| types::find(name))?;
    (types::definition(one).as_bytes() == definition).then_some(one)
}
