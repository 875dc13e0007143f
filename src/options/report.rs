//! The subcommand that makes the study's report.
//!
//! **Invariant:** it knows none of the options of serving.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::builder::{OsStringValueParser, PossibleValuesParser};
use clap::{Arg, ArgAction, ArgMatches, Command};

use crate::report::{self, ReportOptions};

/// Its name, and the directory that it writes to unless told otherwise.
pub(super) const NAME: &str = "report";

/// The subcommand as `clap` is to read it.
pub(super) fn command() -> Command {
    let option = |name: &'static str, value: &'static str, about: String| {
        Arg::new(name).long(name).value_name(value).help(about)
    };
    Command::new(NAME)
        .about("Measure error against run time and stability, and write a page about it")
        .arg(
            option(
                "out",
                "DIRECTORY",
                "Where to write it [default: report]".to_owned(),
            )
            .value_parser(OsStringValueParser::new()),
        )
        .arg(
            option(
                "only",
                "NAMES",
                format!(
                    "Make these sections anew, keep the others: {}",
                    report::names()
                ),
            )
            .value_delimiter(',')
            .value_parser(PossibleValuesParser::new(report::sections()))
            .hide_possible_values(true),
        )
        .arg(
            Arg::new("quick")
                .long("quick")
                .action(ArgAction::SetTrue)
                .help("Coarser and shorter: a look in seconds"),
        )
}

/// Reads its arguments.
pub(super) fn read(matches: &ArgMatches) -> ReportOptions {
    ReportOptions {
        out: matches
            .get_one::<OsString>("out")
            .map_or_else(|| PathBuf::from(NAME), PathBuf::from),
        only: matches
            .get_many::<String>("only")
            .map(|names| names.cloned().collect())
            .unwrap_or_default(),
        quick: matches.get_flag("quick"),
    }
}
