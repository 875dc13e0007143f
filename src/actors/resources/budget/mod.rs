//! Memory that clients make the program hold: it is counted as it is allocated, client by client and in all, and
//! somebody gives way when it is too much.
//!
//! Every client has an [`Account`]. What is allocated for it is charged there, its queues' nodes and the allocator's
//! own bytes included, and given back by whoever drops it. A message that several clients wait for counts once in the
//! sum and whole in the account of each: who does not read it keeps all of it.
//!
//! Nothing that a client asks for is refused because of what others hold. When the sum exceeds [`MAX_HELD`], the client
//! that holds most gives way: first the topic messages that wait for it, then its connection; then the next one, and
//! only until the sum fits again. Answers of megabytes are the exception: they wait for room, and whoever would hold
//! most with its own is refused it.
//!
//! **Invariant:** what is taken is given back by whoever drops it last, in whichever thread, by whichever way it ends;
//! and who holds no more than [`MODEST`] never gives way.

mod account;
mod memory;
mod share;

pub use self::account::Account;
pub use self::memory::Memory;
pub use self::share::{Freed, Promise, Share, free_elsewhere};

const MIB: usize = 1024 * 1024;

/// Bytes that clients make the program hold, as they are counted: beyond it the client that holds most gives way.
pub const MAX_HELD: usize = 384 * MIB;
/// Bytes that the program has resident at most, whatever clients do: what is counted, what an allocator adds, and the
/// program itself. What the system keeps for sockets is not in it.
pub const MAX_MEMORY: usize = 640 * MIB;
/// A client that holds no more bytes never gives way: 1,024 such clients fit.
pub const MODEST: usize = 256 * 1024;
/// An answer that takes no more than one such part of [`MAX_HELD`] is modest: it may be 60,000 steps long.
pub const MODEST_PART: usize = 64;
/// Bytes of topic messages that are left to a client that gives way.
pub const MESSAGES_LEFT: usize = 64 * 1024;
/// Bytes of a connection at rest: its actor, its tasks, and its entries in the registry.
pub const CONNECTION_BYTES: usize = 24 * 1024;

/// Why an answer of megabytes is not begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoRoom {
    /// Computations of others, or memory that is being freed, have taken the room: that ends soon.
    #[error("others compute at the moment")]
    Yet,
    /// Messages that wait for clients have taken the room, and none of the clients holds as much as the answer would
    /// have.
    #[error("too many bytes wait for clients that do not read; try again later")]
    Now,
}
