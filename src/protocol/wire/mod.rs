//! From bytes to frames and back: lines, nesting, pieces, text and JSON.
//!
//! **Invariant:** what is read here is cut and checked, and its meaning is left to `op`.

pub mod fragments;
pub mod frame;
pub mod json;
pub mod opening;
pub mod payload;
pub mod series;
pub mod streamed;
pub(crate) mod text;
