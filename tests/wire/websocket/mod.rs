//! WebSocket on the port: the same rosbridge as over TCP, message by message; admission; bytes that mean harm.
//!
//! **Invariant:** nothing comes over a WebSocket that was not asked for.

#![cfg(feature = "web")]
mod closing;
mod handshake;
mod messages;
