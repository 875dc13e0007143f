//! The study as a web page: `pendularm report --out report/`.
//!
//! Makes the sections in `figures`, and writes `index.html`, `report.json`, and one `.csv` and `.svg` per figure.
//! Measurements are in [`experiments`], on `math` and `study`. This module has the clock, the files and the drawing.
//!
//! **Invariant:** no file is ever half written.

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
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::builder::PossibleValuesParser;
use figures::{Maker, SECTIONS};
use machine::Machine;
use section::Section;
use serde_json::json;
use serde_json::value::{RawValue, to_raw_value};

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
    /// Sections to make, separated by commas; all by default
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
/// A file that is no method, or a file that cannot be written.
pub fn run(options: &ReportOptions) -> Result<PathBuf, ReportError> {
    let machine = Machine::here();
    let own = options.method.as_deref().map(own_method).transpose()?;
    fs::create_dir_all(&options.out)
        .map_err(|error| ReportError::Write(options.out.clone(), error))?;
    let is_wanted = |maker: &&Maker| {
        options.only.is_empty() || options.only.iter().any(|only| only == maker.name)
    };
    let all = |is_timed: bool| -> Result<Vec<Section>, ReportError> {
        let makers = SECTIONS.iter().filter(is_wanted);
        let makers = makers.filter(|maker| maker.timed == is_timed);
        let made = makers.map(|maker| make(maker, options, &machine, own.clone()));
        made.collect()
    };
    // Two sections that measure times never run in parallel.
    let (timed, others) = std::thread::scope(|scope| {
        let others = scope.spawn(|| all(false));
        (all(true), others.join())
    });
    let mut sections = timed?;
    sections.extend(others.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?);
    sections.sort_by_key(|section| SECTIONS.iter().position(|maker| maker.name == section.name));
    let page = options.out.join("index.html");
    write(&page, &html::page(&sections, &machine))?;
    let summary = json!({ "machine": &machine, "quick": options.quick, "sections": &sections });
    let summary = serde_json::to_string_pretty(&summary).unwrap_or_default();
    write(&options.out.join("report.json"), &summary)?;
    let verdicts = sections.iter().flat_map(|section| &section.verdicts);
    let short = verdicts.filter(|verdict| !verdict.holds).count();
    say(&format!(
        "report: {} (verdicts that do not hold: {short})",
        page.display()
    ));
    Ok(page)
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
    say(&format!("report: {}", maker.name));
    Ok(section)
}

/// Writes to a temporary file first and renames it, so that the file is always complete.
fn write(path: &Path, text: &str) -> Result<(), ReportError> {
    let beside = path.with_extension("part");
    fs::write(&beside, text)
        .and_then(|()| fs::rename(&beside, path))
        .map_err(|error| ReportError::Write(path.to_owned(), error))
}
