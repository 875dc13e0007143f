//! Limits that several parts of the gateway keep, and those that tests name, whose files are private; and their sum.
//!
//! **Invariant:** nothing of the gateway is imported here, so that every part of it can import this; and all clients
//! together take no more memory than [`MAX_MEMORY`].

use std::time::Duration;

use crate::actors::resources::memory::{LONG_ANSWERS, LONG_FRAMES, SHORT};
use crate::protocol::limits::{DEFAULT_CLIENTS, MAX_FRAME, MEDIUM};
use crate::protocol::outbox::MAX_TOPIC_BYTES;

const KIB: usize = 1024;

/// Bytes that the program has resident at most with the default number of places. The system's
/// buffers for sockets are not in it.
pub const MAX_MEMORY: usize = 640 * KIB * KIB;
/// Bytes of one client at most, without long frames and answers. They are its input, as it comes and as a frame,
/// pieces of a message, and topic messages that wait or are being written. Responses and computations count with
/// one more than may wait. The entries of the registry, a WebSocket's buffers and the idle connection are in it
/// too.
pub const CLIENT_BYTES: usize = 2 * MEDIUM
    + SHORT
    + MAX_TOPIC_BYTES
    + MEDIUM
    + MAX_BACKLOG
    + SHORT
    + 2 * SHORT
    + MAX_KEPT
    + 96 * KIB;
/// Bytes that a long frame takes at most: as it comes, as a message, as text, as a value, as the frame that is sent
/// on, and that in another form.
pub const LONG_FRAME_BYTES: usize = 6 * MAX_FRAME;
/// Bytes of the program itself, and of the trees of messages that are being encoded.
const PROGRAM_BYTES: usize = 40 * KIB * KIB;
const _: () = assert!(
    DEFAULT_CLIENTS * CLIENT_BYTES + LONG_FRAMES * LONG_FRAME_BYTES + LONG_ANSWERS + PROGRAM_BYTES
        <= MAX_MEMORY
);

/// The most places that are kept for HTTP, WebSocket and the program's own commands. Few clients have fewer.
pub const KEPT_PLACES: usize = 16;
/// How long a client has to show that it may use a kept place, where no other place is free. A kept place that is taken
/// may become free in this time too.
pub const OPENING_TIME: Duration = Duration::from_secs(1);
/// While more bytes of responses than this wait, the client is not read and none of its computations starts.
pub const MAX_RESPONSES_WAITING: usize = SHORT;
/// How long a provider may take where its caller sets no timeout.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(10);
/// Bytes of responses that may wait for one connection before what other clients send it (calls to it as a provider,
/// answers to its own calls) is refused. The connection is not read at that point, but others would go on sending to
/// it.
pub const MAX_BACKLOG: usize = 2 * MAX_RESPONSES_WAITING;
/// Bytes that the registry keeps of one connection: subscriptions, advertisements, services, and calls and goals that
/// wait for other clients.
pub const MAX_KEPT: usize = 128 * 1024;
/// Bytes that each of these takes beside three times its names: its places in the tables.
pub const ENTRY_BYTES: usize = 640;
/// How long a request may take from its first bytes to the end of its head, and a client from connecting to its
/// token. It is enough for a slow line, and too little to hold a place with.
pub const HEAD_TIME: Duration = Duration::from_secs(5);
/// How long a client that has stopped sending may take no byte of the topic messages that are left, and how long the
/// end of the stream itself may take.
pub const LINGER: Duration = Duration::from_secs(5);
/// A client that takes no byte in this time is disconnected, while responses wait or a topic message that takes shared
/// room.
pub const STALL_LIMIT: Duration = Duration::from_secs(20);
/// How long a frame may take from its first byte to its last, while the rest of it is waited for. A skipped frame has
/// no limit. The slowest line by which anybody would steer an arm needs less.
pub const FRAME_TIME: Duration = Duration::from_secs(60);
/// How long responses that are not ready yet are kept for a client that has stopped sending: longer than other clients
/// usually have for theirs. The client may be gone altogether, which shows only when something is sent to it.
pub const RESPONSES_TIME: Duration = Duration::from_secs(15);
/// Bytes offered in one write; then the other connections have a turn.
pub(super) const WRITE_BYTES: usize = 64 * 1024;
/// Frames in one write.
pub(super) const WRITE_FRAMES: usize = 64;
/// Frames of a chunk after which the reader yields.
pub(super) const FRAMES_IN_A_ROW: usize = 32;
/// How long after their time pieces of a message are forgotten, and how often a client without a place asks again.
pub(super) const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// Computations of one connection that wait at most behind the one that runs. The client is not read meanwhile.
pub const MAX_COMPUTATIONS_WAITING: usize = 16;
