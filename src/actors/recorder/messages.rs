//! The questions to the recorder.
//!
//! **Invariant:** an answer comes when what was asked for is done: a file that is named exists, one that has ended is
//! whole.

use std::path::PathBuf;

use actix::prelude::*;

use crate::actors::node::Ask;
use crate::protocol::op::fields::Rejections;

/// Begin a record in the folder that the operator has chosen.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct StartRecording {
    /// The file's name, without a folder; one is made up if there is none.
    pub name: Option<String>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

impl Ask for StartRecording {
    type Answer = Result<String, NotRecorded>;
}

/// End the record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StopRecording;

impl Ask for StopRecording {
    type Answer = Result<Recorded, NotRecorded>;
}

/// A record that has ended.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Recorded {
    /// The file's name.
    pub file: String,
    /// Messages in it.
    pub messages: u64,
    /// Bytes of these messages.
    pub bytes: u64,
    /// Messages that were not taken, because the file was slow.
    pub dropped: u64,
}

/// Begin a record in this file. From the runtime, when it starts.
#[derive(Message, Debug, Clone, PartialEq, Eq)]
#[rtype(result = "Result<(), NotRecorded>")]
pub struct RecordTo(pub PathBuf);

/// End the record, if there is one. From the runtime, when it ends.
#[derive(Message, Debug, Clone, Copy)]
#[rtype(result = "()")]
pub struct EndRecord;

/// Why nothing is recorded, or no more.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotRecorded {
    /// Fields that are not as they should be.
    #[error("{0}")]
    Rejected(Rejections),
    /// The operator has chosen no folder.
    #[error("recording by service needs a folder: start the program with --record-dir")]
    NoFolder,
    /// There is a record already.
    #[error("already recording to {0}")]
    Already(
        /// The file's name.
        String,
    ),
    /// It is not a client's to end.
    #[error("{0} was begun by the operator with --record, and ends with the program")]
    Operators(
        /// The file's name.
        String,
    ),
    /// There is no record.
    #[error("nothing is being recorded")]
    Nothing,
    /// The folder has this many files already.
    #[error("the folder holds {0} records already")]
    Full(
        /// As many as it may.
        usize,
    ),
    /// The file can't be written.
    #[error("{file}: {why}")]
    File {
        /// The file's name, or the operator's path.
        file: String,
        /// The system's reason.
        why: String,
    },
}
