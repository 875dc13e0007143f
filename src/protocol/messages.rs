//! (being written: messages)
