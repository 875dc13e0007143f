//! (being written: arm)
