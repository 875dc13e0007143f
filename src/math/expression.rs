//! (being written: expression)
