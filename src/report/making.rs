//! The tools at hand while a section is made.
//!
//! **Invariant:** a section writes nothing by itself: the report writes its files.

use std::path::Path;

use super::csv::Csv;

/// The tools at hand while a section is made.
#[derive(Debug)]
pub(crate) struct Making<'a> {
    pub(super) quick: bool,
    /// Folder in which the report is written, and counts from outside are looked for.
    pub(super) out: &'a Path,
    /// Stems and contents of `.csv` files.
    pub(super) tables: Vec<(String, Csv)>,
}

impl Making<'_> {
    /// One of two values: for the report, and for a quick look.
    pub(super) fn choose<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    pub(super) fn keep(&mut self, stem: &str, csv: Csv) {
        self.tables.push((stem.to_owned(), csv));
    }
}
