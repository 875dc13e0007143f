//! HTTP on the port: the page, the report, who may ask, and bytes that mean harm.
//!
//! **Invariant:** whatever is sent over HTTP, the arm's parameters stay as they were.

#![cfg(feature = "web")]
mod dependencies;
mod hosts;
mod page;
mod report;
mod requests;
