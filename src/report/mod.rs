//! The study as a web page: `pendularm report --out report/`.
//!
//! Runs the sections in `figures` side by side, keeps each in a file of its own, and writes `index.html`,
//! `report.json`, and one `.csv` and `.svg` per figure. With `--only` the named sections are recomputed and the others
//! are read from their files. Measurements are in [`experiments`], on `math` and `study`. This module has the clock,
//! the files and the drawing.
//!
//! **Invariant:** an interrupted report loses at most the section under way, and no file is ever half written.

pub mod experiments;
mod figures;
mod html;
mod machine;
pub mod scenes;
mod section;
pub mod svg;
mod timing;

use std::fs;
use std::io::{self, Write};
use std::num::NonZero;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use clap::builder::PossibleValuesParser;
use figures::{Maker, SECTIONS};
use machine::Machine;
use section::Section;
use serde_json::value::{RawValue, to_raw_value};
use serde_json::{Value, json};

use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::services::Ask as _;
use crate::services::study::AnalyseMethod;
use crate::study::tableau::Pair;

/// Measure error against run time and stability, and write a page about it
#[derive(Debug, Clone, PartialEq, Eq, clap::Args)]
pub struct ReportOptions {
    /// Where to write it; created if missing
    #[arg(long, value_name = "DIRECTORY", default_value = "report")]
    pub out: PathBuf,
    /// Sections to recompute, separated by commas; all by default
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    #[arg(value_parser = PossibleValuesParser::new(sections()))]
    pub only: Vec<String>,
    /// A coarse report in less than a minute
    #[arg(long)]
    pub quick: bool,
    /// A JSON file with an explicit Runge-Kutta method, as in `/study/method`, for the first figure
    #[arg(long, value_name = "FILE")]
    pub method: Option<PathBuf>,
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The file of a kept section cannot be read.
    #[error("cannot read {path}: {error}; recompute it with --only NAME", path = .0.display(), error = .1)]
    Read(PathBuf, io::Error),
    /// The file of a method cannot be read, or is no method.
    #[error("cannot use the method in {path}: {error}", path = .0.display(), error = .1)]
    Method(PathBuf, String),
    /// A file or directory cannot be written.
    #[error("cannot write {path}: {error}", path = .0.display(), error = .1)]
    Write(PathBuf, io::Error),
}

/// The sections' names, in order.
pub fn sections() -> impl Iterator<Item = &'static str> {
    SECTIONS.iter().map(|section| section.name)
}

/// Makes the report and returns the page's path.
///
/// # Errors
/// A section that is kept and cannot be read, or a file that cannot be written.
pub fn run(options: &ReportOptions) -> Result<PathBuf, ReportError> {
    let machine = Machine::here();
    let own = options.method.as_deref().map(own_method).transpose()?;
    let kept = options.out.join("sections");
    fs::create_dir_all(&kept).map_err(|error| ReportError::Write(kept.clone(), error))?;
    let file = |maker: &Maker| kept.join(format!("{}.json", maker.name));
    let (makers, others): (Vec<_>, Vec<_>) = SECTIONS.iter().partition(|maker| {
        options.only.is_empty() || options.only.iter().any(|only| only == maker.name)
    });
    let mut sections = Vec::new();
    for maker in others {
        sections.extend(read(&file(maker))?);
    }
    let (of, done) = (makers.len(), AtomicUsize::new(0));
    sections.extend(side_by_side(makers, |maker| {
        let section = make(maker, options, &machine, own.clone())?;
        write(
            &file(maker),
            &serde_json::to_string(&section).unwrap_or_default(),
        )?;
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        say(&format!("report: {} ({done} of {of} sections)", maker.name));
        Ok(section)
    })?);
    sections.sort_by_key(|section| SECTIONS.iter().position(|maker| maker.name == section.name));
    let page = options.out.join("index.html");
    write(&page, &html::page(&sections, &machine))?;
    let summary = summary(&sections, &machine, options.quick);
    let summary = serde_json::to_string_pretty(&summary).unwrap_or_default();
    write(&options.out.join("report.json"), &summary)?;
    let verdicts = sections.iter().flat_map(|section| &section.verdicts);
    let short = verdicts.filter(|verdict| !verdict.holds).count();
    say(&format!(
        "report: {} ({short} verdicts do not hold)",
        page.display()
    ));
    Ok(page)
}

/// Makes sections on all cores. Sections that measure times run one after the other.
fn side_by_side(
    makers: Vec<&'static Maker>,
    make: impl Fn(&'static Maker) -> Result<Section, ReportError> + Sync,
) -> Result<Vec<Section>, ReportError> {
    // A worker takes from the end.
    let (timed, others): (Vec<_>, Vec<_>) = makers.into_iter().rev().partition(|it| it.timed);
    let (timed, others) = (Mutex::new(timed), Mutex::new(others));
    let made = Mutex::new(Vec::new());
    let cores = std::thread::available_parallelism().map_or(1, NonZero::get);
    std::thread::scope(|scope| {
        for worker in 0..cores {
            let (timed, others, made, make) = (&timed, &others, &made, &make);
            scope.spawn(move || {
                loop {
                    let first = (worker == 0).then(|| lock(timed).pop()).flatten();
                    let Some(maker) = first.or_else(|| lock(others).pop()) else {
                        return;
                    };
                    let section = make(maker);
                    lock(made).push(section);
                }
            });
        }
    });
    let made = made.into_inner().unwrap_or_else(PoisonError::into_inner);
    made.into_iter().collect()
}

/// Takes the lock, also after a panic in a section: the shared data is still valid.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes a line to standard error. Errors are ignored, so that a closed stream does not stop the report.
fn say(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Name and tableaus of the method in a file, which is the `tableau` of a request to `/study/method`.
fn own_method(path: &Path) -> Result<(String, Pair), ReportError> {
    let refused = |why: String| ReportError::Method(path.to_owned(), why);
    let text = fs::read_to_string(path).map_err(|error| refused(error.to_string()))?;
    let tableau: &RawValue =
        serde_json::from_str(&text).map_err(|error| refused(error.to_string()))?;
    let request = to_raw_value(&json!({ "tableau": tableau }));
    let request = request.map_err(|error| refused(error.to_string()))?;
    let asked = AnalyseMethod::<2>::read(Service::Method, &Arguments::from(request));
    let given = asked.map_err(|why| refused(why.to_string()))?.method;
    let pair = given.ok_or_else(|| refused("there is no method".to_owned()))?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    Ok((name.into_owned(), pair.pair().clone()))
}

fn make(
    maker: &Maker,
    options: &ReportOptions,
    machine: &Machine,
    own: Option<(String, Pair)>,
) -> Result<Section, ReportError> {
    let started = Instant::now();
    let mut section = Section {
        name: maker.name.to_owned(),
        title: maker.title.to_owned(),
        version: machine.version.clone(),
        quick: options.quick,
        out: options.out.clone(),
        processor: machine.processor.clone(),
        own,
        ..Section::default()
    };
    (maker.make)(&mut section);
    for (name, text) in std::mem::take(&mut section.files) {
        write(&options.out.join(name), &text)?;
    }
    section.seconds = started.elapsed().as_secs_f64();
    Ok(section)
}

/// Everything but the drawings.
fn summary(sections: &[Section], machine: &Machine, quick: bool) -> Value {
    let mut summary = json!({ "machine": machine, "quick": quick, "sections": sections });
    let sections = summary.get_mut("sections").and_then(Value::as_array_mut);
    let sections = sections.into_iter().flatten();
    for section in sections.filter_map(Value::as_object_mut) {
        section.remove("html");
    }
    summary
}

/// The section in that file; `None` if there is no such file yet.
fn read(path: &Path) -> Result<Option<Section>, ReportError> {
    match fs::read_to_string(path).and_then(|text| Ok(serde_json::from_str(&text)?)) {
        Ok(section) => Ok(Some(section)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(ReportError::Read(path.to_owned(), error)),
    }
}

/// Writes to a temporary file first and renames it, so that the file is always complete.
fn write(path: &Path, text: &str) -> Result<(), ReportError> {
    let beside = path.with_extension("part");
    fs::write(&beside, text)
        .and_then(|()| fs::rename(&beside, path))
        .map_err(|error| ReportError::Write(path.to_owned(), error))
}
