//! From bytes to frames and back: lines, nesting, pieces, text and JSON.
//!
//! **Invariant:** bytes are cut and checked here; `op` has their meaning.

pub mod fragments;
pub mod frame;
pub mod json;
pub mod opening;
pub mod series;
pub(crate) mod text;
