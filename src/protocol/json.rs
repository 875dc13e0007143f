//! (being written: json)
