//! (being written: catalog)
