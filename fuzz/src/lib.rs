//! What the fuzz targets share.
//!
//! | file | what |
//! | --- | --- |
//! | [`json`], [`cbor`] | second readings, slow and strict |
//! | [`numbers`] | numbers where they are awkward |
//! | [`session`] | scripts for clients, and what must hold of what they hear |
//! | [`client`], [`websocket`] | a client on an in-memory pipe |
//! | [`stage`] | the runtime's side of it, in virtual time |
//!
//! A target panics where something does not hold; what it was given is then kept by the fuzzer.

pub mod cbor;
pub mod client;
pub mod json;
pub mod numbers;
pub mod session;
pub mod stage;
pub mod websocket;
