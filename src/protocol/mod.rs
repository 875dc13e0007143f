//! The rosbridge side: bytes and JSON in and out.
//!
//! **Invariant:** no sockets, no clock, no physics in here; whatever depends on time is told the time.

pub mod catalog;
pub mod cbor;
pub mod cdr;
pub mod fields;
pub mod fragments;
pub mod frame;
pub mod goal_messages;
pub mod json;
pub mod messages;
pub mod names;
mod nesting;
pub mod op;
pub mod opening;
pub mod outbox;
pub mod parameters;
pub mod rosapi;
pub mod scene_messages;
pub mod series;
pub mod streamed;
pub(crate) mod text;
mod throttle;
pub mod token;
pub mod trajectory;
pub mod urdf;
