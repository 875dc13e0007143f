//! The arm of the page in one file: rosbridge frames in, rosbridge frames out.
//!
//! A [`Kernel`] replaces the runtime's actors for one client, in one thread and without a socket. The runtime's own
//! functions read, execute and answer requests: `pendularm::services` and `pendularm::live`. `module.rs` exports it as
//! a WebAssembly module.
//!
//! **Invariant:** a frame has the same answer here as from the runtime.

mod kernel;
#[cfg(target_arch = "wasm32")]
pub mod module;
pub mod runs;

pub use self::kernel::{Clock, Kernel, LINKS};
