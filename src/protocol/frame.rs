//! (being written: frame)
