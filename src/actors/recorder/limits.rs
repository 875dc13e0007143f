//! How much a record may take: of memory while it is written, and of the disk if a client has started it.
//!
//! **Invariant:** each limit stands here once, and in the table of docs/protocol.md.

use std::time::Duration;

/// Entries that may wait for the file. Topics may take half of that, the rest is for inputs.
pub const MAX_WAITING_ENTRIES: usize = 8192;
/// Bytes that may wait for the file, in the same way.
pub const MAX_WAITING_BYTES: usize = 16 * 1024 * 1024;
/// Longest frame that is recorded: the gateway's thread copies it in a fraction of a millisecond.
pub const MAX_RECORDED_FRAME: usize = 1024 * 1024;
/// Between two times at which all that was recorded is in the file: a killed program costs a record no more.
pub const FLUSH_PERIOD: Duration = Duration::from_secs(1);
/// Length of a record that a client has started; it ends there. Some nine hours of an arm that is left alone.
pub const MAX_RECORD_BYTES: u64 = 1024 * 1024 * 1024;
/// Records in the folder beyond which no client starts another.
pub const MAX_RECORDS: usize = 100;
/// Longest name of a record.
pub const MAX_FILE_NAME: usize = 64;
