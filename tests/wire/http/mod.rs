//! HTTP on the port: the page, the report, and long heads. `tests/actors/exchanges/http.txt` has
//! the hosts, origins and tokens that are admitted.

#![cfg(feature = "web")]
mod page;
mod report;
mod requests;
