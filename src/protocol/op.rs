//! (being written: op)
