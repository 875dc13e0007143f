//! The limits of a record: memory while it is written, and disk space if a client has started it.
//!
//! **Invariant:** each limit is here once, and in the table of docs/protocol.md.

use std::time::Duration;

/// Most entries that wait for the file. Topics may use half of them; the rest is for inputs.
pub const MAX_WAITING_ENTRIES: usize = 8192;
/// Most bytes that wait for the file, divided in the same way.
pub const MAX_WAITING_BYTES: usize = 16 * 1024 * 1024;
/// Longest recorded frame. The gateway's thread copies it in a fraction of a millisecond.
pub const MAX_RECORDED_FRAME: usize = 1024 * 1024;
/// Time between two flushes to the file. A killed program loses at most this much of a record.
pub const FLUSH_PERIOD: Duration = Duration::from_secs(1);
/// Longest record that a client has started: about six hours of an idle arm.
pub const MAX_RECORD_BYTES: u64 = 1024 * 1024 * 1024;
/// Most records in the folder before a client starts another.
pub const MAX_RECORDS: usize = 100;
/// Longest name of a record.
pub const MAX_FILE_NAME: usize = 64;
