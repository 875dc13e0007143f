//! (being written: goal)
