//! The parts that the fuzz targets share.
//!
//! | file | what |
//! | --- | --- |
//! | [`json`] | JSON as serde_json reads it, with every member and every number as it is written |
//! | [`cbor`] | a second reading, slow and strict |
//! | [`limits`] | bounds of an execution's time and memory |
//! | [`book`] | everything that clients have sent, to compare received frames with it |
//! | [`session`] | scripts for clients, and checks of everything that they receive |
//! | [`client`] | a client on an in-memory pipe, which speaks as `pendularm-client` does |
//! | [`stage`] | the runtime's side of it, in virtual time |
//!
//! A target panics if a check fails. The fuzzer then keeps its input.

pub mod book;
pub mod cbor;
pub mod client;
pub mod json;
pub mod limits;
pub mod session;
pub mod stage;
