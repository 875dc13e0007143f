//! (being written: pid)
