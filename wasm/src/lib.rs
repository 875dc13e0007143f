//! The arm in a page, without a server: rosbridge frames in, rosbridge frames out.
//!
//! A [`Kernel`] is what the runtime's actors are to one client, in one thread and without a socket. Requests are read,
//! done and written by the runtime's own functions: `pendularm::services` and `pendularm::live`. `module.rs` makes a
//! WebAssembly module of it.
//!
//! **Invariant:** a frame has the same answer here as from the runtime.

mod kernel;
#[cfg(target_arch = "wasm32")]
pub mod module;
pub mod runs;

pub use self::kernel::{Clock, Kernel, LINKS};
