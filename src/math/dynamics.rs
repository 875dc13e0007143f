//! (being written: dynamics)
