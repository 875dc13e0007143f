//! Bytes to frames and back: lines, messages, nesting, fragments, text and JSON.
//!
//! **Invariant:** bytes are split and checked here. `op` interprets them.

mod fault;
pub mod fragments;
pub mod frame;
pub mod json;
pub mod lines;
pub(crate) mod literals;
pub mod opening;
pub mod series;
pub(crate) mod text;
pub mod websocket;

pub use self::frame::Frame;
