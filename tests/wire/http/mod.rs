//! HTTP on the port: the page, the report, long heads; and the crates that all of that needs. `tests/actors/exchanges/http.txt` has the
//! hosts, origins and tokens that are admitted.

#![cfg(feature = "web")]
mod dependencies;
mod page;
mod report;
mod requests;
