//! HTTP on the port: the page, the report, long heads, and the crates for them. `tests/actors/exchanges/http.txt` has
//! the hosts, origins and tokens that are admitted.

#![cfg(feature = "web")]
mod dependencies;
mod page;
mod report;
mod requests;
