//! (being written: outbox)
