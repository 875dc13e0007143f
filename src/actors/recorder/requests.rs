//! The requests to the recorder, as messages and in JSON, and the responses.
//!
//! **Invariant:** a client names a file, never a folder. An answer is sent after the action: the named file exists, and
//! an ended file is complete.

use std::path::PathBuf;

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;
use serde_json::json;

use super::limits::MAX_FILE_NAME;
use crate::actors::node::{Address, Ask};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, Rejections};

/// Starts a record in the operator's folder.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StartRecording {
    /// The file's name, without a folder. Without one, a name is generated.
    pub name: Option<String>,
}

/// Ends the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StopRecording;

/// A finished record.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Recorded {
    /// The file's name.
    pub file: String,
    /// Messages in it.
    pub messages: u64,
    /// Length of the file in bytes.
    pub bytes: u64,
    /// Messages that were dropped, because the file was slow.
    pub dropped: u64,
}

/// Starts a record in this file, or ends the record if there is no file. From the runtime, when it starts and when it
/// ends.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
#[rtype(result = "Result<(), NotRecorded>")]
pub struct RecordTo(pub Option<PathBuf>);

/// Why a record was not started or not ended.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotRecorded {
    /// The operator has set no folder.
    #[error("recording by service needs a folder: start pendularm with --record-dir")]
    NoFolder,
    /// There is a record already.
    #[error("already recording to {0}")]
    Already(
        /// The file's name.
        String,
    ),
    /// A client cannot end the operator's record.
    #[error("{0} was started by the operator with --record, and ends with the program")]
    Operators(
        /// The file's name.
        String,
    ),
    /// There is no record.
    #[error("nothing is being recorded")]
    Nothing,
    /// The folder is full.
    #[error("the folder has {0} records already: remove some")]
    Full(
        /// The number of records.
        usize,
    ),
    /// The file cannot be written.
    #[error("{file}: {why}")]
    File {
        /// The file's name, or the operator's path.
        file: String,
        /// The system's reason.
        why: String,
    },
}

// ---- in JSON ---------------------------------------------------------------------------------------------------------

impl Ask for StartRecording {
    type Answer = Result<String, NotRecorded>;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let name = fields.text("name").map(std::borrow::Cow::into_owned);
        if name.as_ref().is_some_and(|name| !is_file_name(name)) {
            let rule = format!(
                "must be 1 to {MAX_FILE_NAME} letters, digits, `.`, `-` and `_`, the first one not `.`"
            );
            fields.refuse("name", &rule);
        }
        fields.accept(Self { name })
    }

    fn write(answer: Result<String, NotRecorded>, to: &Address) -> Bytes {
        to.outcome(answer.map(|file| json!({"file": file})))
    }
}

impl Ask for StopRecording {
    type Answer = Result<Recorded, NotRecorded>;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        Fields::read(arguments, service)?;
        Ok(Self)
    }

    fn write(answer: Result<Recorded, NotRecorded>, to: &Address) -> Bytes {
        to.outcome(answer)
    }
}

/// Whether this is a plain file name on every system.
fn is_file_name(name: &str) -> bool {
    let plain = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'.' | b'-' | b'_');
    (1..=MAX_FILE_NAME).contains(&name.len()) && !name.starts_with('.') && name.bytes().all(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_that_of_a_file_beside_the_others() {
        let longest = "a".repeat(MAX_FILE_NAME);
        for name in ["run", "Run-2_b.mcap", "7", &longest] {
            assert!(is_file_name(name), "{name}");
        }
        let too_long = "a".repeat(MAX_FILE_NAME + 1);
        for name in [
            "", ".hidden", "../a", "a/b", "a\\b", "a b", "a:b", "\u{e4}", &too_long,
        ] {
            assert!(!is_file_name(name), "{name}");
        }
    }
}
