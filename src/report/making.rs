//! The tools at hand while a section is made.
//!
//! **Invariant:** a section writes nothing by itself: what it keeps is written by the report.

use std::path::Path;

use super::csv::Csv;
use super::progress::ProgressBar;

/// The tools at hand while a section is made.
#[derive(Debug)]
pub(crate) struct Making<'a> {
    pub(super) quick: bool,
    /// Where the report is written, and counts from outside are looked for.
    pub(super) out: &'a Path,
    pub(super) progress: &'a mut ProgressBar,
    /// Stems and contents of `.csv` files.
    pub(super) tables: Vec<(String, Csv)>,
}

impl Making<'_> {
    /// One of two values: for the report, and for a quick look.
    pub(super) fn choose<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    pub(super) fn at(&mut self, done: usize, of: usize) {
        #[allow(
            clippy::cast_precision_loss,
            reason = "counts of runs are far below 2^53"
        )]
        self.progress.at(done as f64 / of as f64);
    }

    pub(super) fn keep(&mut self, stem: &str, csv: Csv) {
        self.tables.push((stem.to_owned(), csv));
    }
}
