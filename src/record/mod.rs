//! Records of runs: an MCAP file with every topic in the format of ROS 2, with calls and answers, and with the
//! inputs for a replay.
//!
//! It is pure: it converts entries to bytes and back. The [recorder](crate::actors::recorder) creates the entries and
//! writes the bytes.
//!
//! **Invariant:** a truncated file is readable up to its last whole chunk.

mod comparison;
mod journal;
mod reader;
mod schema;
mod writer;

use bytes::Bytes;

pub use self::comparison::{
    AT_ONCE, Difference, MAX_STEPS_BETWEEN_MESSAGES, ReplayError, ReplayVerdict, replay,
};
pub use self::journal::{NoteError, read_note, write_note};
pub use self::reader::{ReadError, RecordEnding, RecordedMessage, Recording};
pub use self::schema::{CALLS, INPUTS, STATES};
pub use self::writer::{CHUNK_BYTES, McapWriter, RecordError, RunSettings};
use crate::protocol::catalog::{Service, Topic};

/// An entry of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordEntry {
    /// Its time, in nanoseconds since 1970.
    pub log_time: u64,
    /// Its content.
    pub content: Content,
}

/// The kinds of entries.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// A message on a topic of the runtime.
    Published {
        /// The topic.
        topic: Topic,
        /// The whole `publish` frame, as a client gets it.
        frame: Bytes,
    },
    /// A client's call of one of the runtime's services.
    Called {
        /// The client's number.
        client: u64,
        /// The service.
        service: Service,
        /// The caller's `id`, in JSON; empty if there is none.
        id: Box<str>,
        /// The arguments, in JSON.
        args: Box<str>,
    },
    /// The answer to such a call.
    Answered {
        /// The client's number.
        client: u64,
        /// The service.
        service: Service,
        /// The whole `service_response` frame.
        frame: Bytes,
    },
    /// An input of the arm's steps: a [note](write_note).
    Input {
        /// The number of steps before it took effect. A reset does not restart the count.
        step: u64,
        /// The note.
        note: String,
    },
    /// The arm's state.
    State {
        /// Steps taken, counted as for inputs.
        step: u64,
        /// Joint positions \[rad\].
        position: Vec<f64>,
        /// Joint velocities \[rad/s\].
        velocity: Vec<f64>,
        /// Effort of the latest step \[N m\].
        effort: Vec<f64>,
    },
}

impl Content {
    /// Its memory in bytes while it waits to be written.
    #[must_use]
    pub fn allocated(&self) -> usize {
        let text = match self {
            Self::Published { frame, .. } | Self::Answered { frame, .. } => frame.len(),
            Self::Called { id, args, .. } => id.len() + args.len(),
            Self::Input { note, .. } => note.len(),
            Self::State { position, .. } => 3 * size_of_val(position.as_slice()),
        };
        size_of::<RecordEntry>() + text
    }
}
