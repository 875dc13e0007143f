//! (being written: simulation)
