//! The limits of the wire that several rooms keep.
//!
//! **Invariant:** nothing is imported here, so that every room can import this one.

/// Longest frame, in bytes without the newline: a 3-link trajectory has under 1 KiB, an expression of 1 MB has to pass.
pub const MAX_FRAME: usize = 4 * 1024 * 1024;
/// The longest answer, or frame of a call, that takes no permit of the pools that all clients share.
pub const SHORT: usize = 64 * 1024;
/// The longest published message that takes no such permit: 256 KiB, and 16 KiB for its topic and type.
pub const MEDIUM: usize = 272 * 1024;
/// Deepest nesting of objects and arrays, the frame itself included: ROS messages need fewer than ten levels.
pub const MAX_NESTING: usize = 128;
/// Longest topic or service name, and id of a subscription or a goal, in bytes: they are kept, and the id of a goal
/// comes back 60 times a second.
pub const MAX_NAME: usize = 1024;
/// Clients that are served at once, unless an option gives another number. Fewer where fewer files may be open.
pub const DEFAULT_CLIENTS: usize = 256;
/// The largest number of clients that the option takes.
pub const MAX_CLIENTS: usize = 4096;
