//! (being written: fields)
