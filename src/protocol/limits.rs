//! The limits of the protocol that several modules enforce.
//!
//! **Invariant:** this file imports nothing, so every module can import it.

/// Longest frame, in bytes without the newline. A 3-link trajectory has less than 1 KiB; an expression of 1 MB must
/// fit.
pub const MAX_FRAME: usize = 4 * 1024 * 1024;
/// The longest answer, or frame of a call, that needs no permit of the shared pools.
pub const SHORT: usize = 64 * 1024;
/// The longest published message that needs no such permit: 256 KiB, and 16 KiB for its topic and type.
pub const MEDIUM: usize = 272 * 1024;
/// Deepest nesting of objects and arrays, including the frame itself. ROS messages need fewer than ten levels.
pub const MAX_NESTING: usize = 128;
/// Longest topic or service name, and longest id of a subscription or a goal, in bytes. They are stored, and the id
/// of a goal is sent 60 times a second.
pub const MAX_NAME: usize = 1024;
/// Clients served at once, unless an option sets another number. There are fewer if fewer files may be open.
pub const DEFAULT_CLIENTS: usize = 256;
/// The largest number of clients that the option accepts.
pub const MAX_CLIENTS: usize = 4096;
