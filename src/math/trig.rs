//! (being written: trig)
