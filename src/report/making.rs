//! The tools at hand while a section is made.
//!
//! **Invariant:** a section writes nothing by itself: what it keeps is written by the report.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use super::csv::Csv;
use super::progress::ProgressBar;
use crate::math::count::length_in_f64;

/// The tools at hand while a section is made.
#[derive(Debug)]
pub(crate) struct Making<'a> {
    pub(super) quick: bool,
    /// Folder in which the report is written, and counts from outside are looked for.
    pub(super) out: &'a Path,
    /// The section's name, and where it says how far it is.
    pub(super) section: &'static str,
    pub(super) progress: &'a Mutex<ProgressBar>,
    /// Stems and contents of `.csv` files.
    pub(super) tables: Vec<(String, Csv)>,
}

impl Making<'_> {
    /// One of two values: for the report, and for a quick look.
    pub(super) fn choose<T>(&self, full: T, quick: T) -> T {
        if self.quick { quick } else { full }
    }

    pub(super) fn at(&mut self, done: usize, of: usize) {
        let part = length_in_f64(done) / length_in_f64(of);
        let mut progress = self.progress.lock().unwrap_or_else(PoisonError::into_inner);
        progress.at(self.section, part);
    }

    pub(super) fn keep(&mut self, stem: &str, csv: Csv) {
        self.tables.push((stem.to_owned(), csv));
    }
}
