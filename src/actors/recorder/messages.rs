//! The requests to the recorder.
//!
//! **Invariant:** an answer is sent after the action: the named file exists, and an ended file is complete.

use std::path::PathBuf;

use actix::prelude::*;
use serde::Serialize;

use crate::actors::node::Ask;

/// Starts a record in the operator's folder.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StartRecording {
    /// The file's name, without a folder. Without one, a name is generated.
    pub name: Option<String>,
}

impl Ask for StartRecording {
    type Answer = Result<String, NotRecorded>;
}

/// Ends the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StopRecording;

impl Ask for StopRecording {
    type Answer = Result<Recorded, NotRecorded>;
}

/// A finished record.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Recorded {
    /// The file's name.
    pub file: String,
    /// Messages in it.
    pub messages: u64,
    /// Bytes of these messages.
    pub bytes: u64,
    /// Messages that were dropped, because the file was slow.
    pub dropped: u64,
}

/// Starts a record in this file. From the runtime, when it starts.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
#[rtype(result = "Result<(), NotRecorded>")]
pub struct RecordTo(pub PathBuf);

/// Ends the record, if there is one. From the runtime, when it ends.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct EndRecord;

/// Why a record was not started or not ended.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotRecorded {
    /// The operator has set no folder.
    #[error("recording by service needs a folder: start the program with --record-dir")]
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
