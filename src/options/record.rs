//! The options of runs on record, and the subcommand that replays one.
//!
//! **Invariant:** without any of them nothing is written anywhere.

use std::ffi::OsString;
use std::path::PathBuf;

use clap::builder::OsStringValueParser;
use clap::{Arg, ArgAction, ArgMatches, Command};

use super::setting::{Given, LaunchOption};

pub(super) const RECORD: LaunchOption = LaunchOption {
    option: "record",
    variable: "ARM_SIM_RECORD",
    value: "FILE",
    about: "Records the run as MCAP into this file, which must not be there",
    default: "none",
    is_switch: false,
};

pub(super) const RECORD_DIR: LaunchOption = LaunchOption {
    option: "record-dir",
    variable: "ARM_SIM_RECORD_DIR",
    value: "FOLDER",
    about: "Folder in which clients may have runs recorded, by /recorder/start; it has to be there",
    default: "none",
    is_switch: false,
};

/// Records, as chosen at launch.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct RecordOptions {
    /// The file into which this run is recorded, if it is.
    pub file: Option<PathBuf>,
    /// Folder in which clients may have runs recorded, if any.
    pub folder: Option<PathBuf>,
    /// The record that is played to clients in the arm's place, if one is.
    pub replay: Option<PathBuf>,
}

impl RecordOptions {
    pub(super) fn read(given: impl Fn(&LaunchOption) -> Option<Given>) -> Self {
        Self {
            file: given(&RECORD).map(|given| given.value.into()),
            folder: given(&RECORD_DIR).map(|given| given.value.into()),
            replay: None,
        }
    }
}

/// The record that is to be replayed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReplayOptions {
    /// The file.
    pub file: PathBuf,
}

/// The option that plays the record to clients.
pub(super) const SERVE: &str = "serve";
/// The options of serving that mean something to a replay.
pub(super) fn is_of_replay(option: &LaunchOption) -> bool {
    !["links", "seed", RECORD.option, RECORD_DIR.option].contains(&option.option)
}

/// The name of the subcommand.
pub(super) const REPLAY: &str = "replay";

/// The subcommand as `clap` is to read it.
pub(super) fn command(settings: impl Iterator<Item = Arg>) -> Command {
    let serve = Arg::new(SERVE)
        .long(SERVE)
        .action(ArgAction::SetTrue)
        .help("Play it to clients instead, in the arm's place; the options below are for that");
    let file = Arg::new("file")
        .value_name("FILE")
        .value_parser(OsStringValueParser::new())
        .required(true)
        .help("A record that --record or /recorder/start has made");
    Command::new(REPLAY)
        .about("Take a recorded run's steps again and say where they differ from the record, or play it to clients")
        .after_help("Exit status: 0 if every state is the same bit for bit, 1 if not.")
        .arg(file)
        .arg(serve)
        .args(settings)
}

/// Reads its arguments.
pub(super) fn read(matches: &ArgMatches) -> ReplayOptions {
    let file = matches.get_one::<OsString>("file");
    ReplayOptions {
        file: file.map(PathBuf::from).unwrap_or_default(),
    }
}
