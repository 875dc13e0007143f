//! HTTP on the port: the page, the report, who may ask, bytes that mean harm; and the crates that all of that needs.
//!
//! **Invariant:** whatever is sent over HTTP, the arm's parameters stay as they were.

#![cfg(feature = "web")]
mod dependencies;
mod hosts;
mod page;
mod report;
mod requests;
