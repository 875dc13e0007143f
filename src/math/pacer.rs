//! (being written: pacer)
