//! Bytes and JSON in and out, without a socket and without a clock.

mod catalog;
mod cbor;
mod fields;
mod frame;
mod json;
mod messages;
mod names;
mod op;
mod outbox;
mod rosapi;
mod scene;
mod series;
mod trajectory;
#[cfg(feature = "web")]
mod websocket;
