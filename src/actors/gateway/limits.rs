//! Limits that several parts of the gateway keep, and those that tests name, whose files are private.
//!
//! **Invariant:** nothing of the gateway is imported here, so that every part of it can import this.

use std::time::Duration;

/// Clients at once; each costs a few kilobytes at rest and at most its outbox under load. Fewer where fewer files may
/// be open.
pub const MAX_CONNECTIONS: usize = 1024;
/// While more bytes of responses than this wait, the client is not read and none of its computations starts.
pub const MAX_RESPONSES_WAITING: usize = 32 * 1024 * 1024;
/// Subscriptions (topic and id) of one connection.
pub const MAX_SUBSCRIPTIONS: usize = 1024;
/// Different `fragment_size`s among the subscriptions to a topic, beside powers of two: a message is cut up once for
/// each of them. A further one counts as the power of two below, of which there are few.
pub const MAX_FRAGMENT_SIZES: usize = 16;
/// Topics that one connection advertises.
pub const MAX_ADVERTISED: usize = 1024;
/// Services and actions that one connection provides.
pub const MAX_PROVIDED: usize = 256;
/// Calls of one connection that wait for clients to answer.
pub const MAX_WAITING_CALLS: usize = 256;
/// Goals of one connection that other clients carry out.
pub const MAX_WAITING_GOALS: usize = 256;
/// How long a provider may take when its caller does not say.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(10);
/// Bytes of a registration, beside three times its name: its places in the tables.
pub const REGISTRATION_BYTES: usize = 1024;
/// Bytes of a call that waits for a client, beside its `id` and its name: its entries in the tables.
pub const CALL_BYTES: usize = 1024;
/// Bytes of responses that may wait for one connection before what other clients send it (calls to it as a provider,
/// answers to its own calls) is refused. The connection is not read at that point, but others would go on sending to
/// it.
pub const MAX_BACKLOG: usize = 2 * MAX_RESPONSES_WAITING;
/// How long a request may take from its first bytes to the end of its head, and how long a client may take from
/// connecting to its token: enough for a slow line, too little to hold a place with.
pub const HEAD_TIME: Duration = Duration::from_secs(5);
/// How long a client that has stopped sending may take no byte of the topic messages that are left, and how long the
/// end of the stream itself may take.
pub const LINGER: Duration = Duration::from_secs(5);
/// A client that takes no byte for so long while responses wait is disconnected.
pub const STALL_LIMIT: Duration = Duration::from_secs(20);
/// How long a frame may take from its first byte to its last. A frame that is too long is skipped, and has as much time
/// again for every length that a frame may have. The slowest line by which anybody would steer an arm needs less.
pub const FRAME_TIME: Duration = Duration::from_secs(60);
/// How long responses that are not ready yet are kept for a client that has stopped sending: longer than other clients
/// usually have for theirs. The client may be gone altogether, which shows only when something is sent to it.
pub const RESPONSES_TIME: Duration = Duration::from_secs(15);
/// Bytes offered in one write; then the other connections have a turn.
pub(super) const WRITE_BYTES: usize = 256 * 1024;
/// Frames in one write.
pub(super) const WRITE_FRAMES: usize = 64;
/// Frames of a chunk, and messages of a series that is encoded, that cost no wait in a queue: a client that waits for
/// responses has fewer under way.
pub(super) const FREE_FRAMES: usize = 32;
/// Most subscribers of a message after which its publisher waits in no queue.
pub(super) const FREE_DELIVERIES: usize = 32;
/// How long after their time pieces of messages are forgotten, and how often a client that has enough waiting is looked
/// at again.
pub(super) const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// Computations of one connection that wait behind the one that runs; while so many do, the client is not read.
pub const MAX_COMPUTATIONS_WAITING: usize = 16;
/// A frame of no more bytes is read where it comes, which takes a fraction of a millisecond whatever the bytes are; a
/// longer one on another thread.
pub const READ_HERE: usize = 64 * 1024;
