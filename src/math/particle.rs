//! (being written: particle)
