//! The parts that the fuzz targets share.
//!
//! | file | what |
//! | --- | --- |
//! | [`json`] | JSON as serde_json reads it, with every member and every number as it is written |
//! | [`cbor`] | a second reading, slow and strict |
//! | [`limits`] | what an execution may cost in time and memory |
//! | [`book`] | what clients have said, to compare what others hear with |
//! | [`session`] | scripts for clients, and what must hold of what they hear |
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
