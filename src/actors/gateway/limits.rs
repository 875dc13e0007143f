//! Limits that several parts of the gateway share, limits that tests read, and the sum of all of them.
//!
//! **Invariant:** this module imports nothing from the gateway, so every part of it can import this module. All clients
//! together take at most [`MAX_MEMORY`] bytes.

use std::time::Duration;

use crate::actors::graph::registrations::MAX_REGISTERED;
use crate::actors::resources::memory::{
    LONG_ANSWERS, LONG_FRAMES, LONGEST_ANSWER, MAX_BACKLOG, PERMIT_TIME, SHORT,
};
use crate::protocol::limits::{DEFAULT_CLIENTS, MAX_FRAME, MEDIUM};
use crate::protocol::outbox::MAX_TOPIC_BYTES;

const KIB: usize = 1024;

/// Largest resident size of the program with the default number of places \[bytes\]. It excludes the system's socket
/// buffers.
pub const MAX_MEMORY: usize = 664 * KIB * KIB;
/// Most bytes of one client, without long frames and answers. The sum has its input (received bytes and a frame),
/// the pieces of a message, and topic messages that wait or are being written. Responses and computations count with
/// one more than may wait. The entries of the registry, a WebSocket's buffers and the idle connection are included.
pub const CLIENT_BYTES: usize = 2 * MEDIUM
    + SHORT
    + MAX_TOPIC_BYTES
    + MEDIUM
    + MAX_BACKLOG
    + SHORT
    + 2 * SHORT
    + MAX_REGISTERED
    + 96 * KIB;
/// Most forms of a published message that is longer than [`MEDIUM`]: plain, or as subscribers have requested it.
/// Subscribers who requested a further form do not get it.
pub const MAX_LONG_FORMS: usize = 4;
/// Most bytes of a long frame. It exists as received bytes, as a message, as text, as a value, and in the forms in
/// which it is sent.
pub const LONG_FRAME_BYTES: usize = (4 + MAX_LONG_FORMS) * MAX_FRAME;
/// Bytes of the program itself.
const PROGRAM_BYTES: usize = 24 * KIB * KIB;
const _: () = assert!(
    DEFAULT_CLIENTS * CLIENT_BYTES
        + LONG_FRAMES * LONG_FRAME_BYTES
        + LONG_ANSWERS
        + LONGEST_ANSWER
        + PROGRAM_BYTES
        <= MAX_MEMORY
);

/// Time for a client to show that it may use a kept place, if no other place is free. A client also waits this long for
/// a kept place to become free.
pub const OPENING_TIME: Duration = Duration::from_secs(1);
/// While more response bytes than this wait, the client is not read and none of its computations starts.
pub const MAX_RESPONSES_WAITING: usize = SHORT;
/// Timeout of a forwarded call if its caller sets none.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(10);
/// Timeout of a request's head from its first bytes, and of a client's token from the connection. It is enough for a
/// slow line, and too short to occupy a place.
pub const HEAD_TIME: Duration = Duration::from_secs(5);
/// Timeout of a client that has stopped sending and takes no byte of the remaining topic messages. Also the timeout of
/// the end of the stream.
pub const LINGER: Duration = Duration::from_secs(5);
/// A client that takes no byte in this time is disconnected, if responses wait. Bytes that hold a permit have this time
/// and their length at 1 MiB/s, even if the client takes some of them.
pub const STALL_LIMIT: Duration = PERMIT_TIME;
/// Timeout of a frame from its first byte to its last, while the reader waits for the rest. A skipped frame has no
/// timeout. The slowest line that can control an arm needs less.
pub const FRAME_TIME: Duration = Duration::from_secs(60);
/// Timeout of pending responses to a client that has stopped sending. It is longer than [`DEFAULT_TIMEOUT`]. The client
/// may have disconnected, which is detected by sending to it, or by `CLOSED_CHECK` (`resources/unread.rs`) on the
/// same machine.
pub const RESPONSES_TIME: Duration = Duration::from_secs(15);
/// Most bytes of one read. It is enough for a burst of short frames.
pub(super) const READ_BYTES: usize = 32 * KIB;
/// Bytes offered in one write. After half of them, other connections have a turn.
pub(super) const WRITE_BYTES: usize = 64 * 1024;
// When a client may be read again, its writer has written this much in a turn, or waits for the socket. Either wakes the
// reader.
const _: () = assert!(MAX_RESPONSES_WAITING >= WRITE_BYTES / 2);
/// Frames in one write.
pub(super) const WRITE_FRAMES: usize = 64;
/// Frames after which the reader yields. Also messages of a WebSocket that are read ahead of the next op.
pub(super) const FRAMES_IN_A_ROW: usize = 32;
/// Time and bytes for which a refused client's input is discarded, so that it can read the reason. Closing a socket
/// with unread input resets it.
pub(super) const DISCARD_TIME: Duration = Duration::from_secs(1);
pub(super) const DISCARD_BYTES: usize = 16 * KIB * KIB;
/// Delay after which expired pieces of a message are dropped. Also the interval of retries of a client without a place.
pub(super) const LOOK_AGAIN: Duration = Duration::from_millis(20);
