//! (being written: trial)
