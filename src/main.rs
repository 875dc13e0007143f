//! The binary: reads options and returns an exit status.
//!
//! **Invariant:** nothing here panics, even if standard output or standard error is closed, full or
//! broken.

use std::ffi::OsString;
#[cfg(any(feature = "record", feature = "cli"))]
use std::fs::File;
#[cfg(feature = "record")]
use std::io::BufReader;
use std::io::ErrorKind;
#[cfg(feature = "cli")]
use std::io::Read;
#[cfg(feature = "record")]
use std::path::Path;
#[cfg(feature = "cli")]
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Arg, Args, Command};
use pendularm::actors::{panics, runtime};
#[cfg(feature = "cli")]
use pendularm::command::{self, CommandError};
use pendularm::logging::{self, LogFormat};
#[cfg(feature = "cli")]
use pendularm::options::completions;
use pendularm::options::{Options, Parsed};
use pendularm::output::{self, print_error};
use pendularm::plan;
#[cfg(feature = "record")]
use pendularm::record;
#[cfg(feature = "report")]
use pendularm::report;
#[cfg(feature = "cli")]
use pendularm::score::MOST_BYTES;
#[cfg(feature = "conformance")]
use pendularm::{referee, sabotage};

/// Exit status for every other failure.
const FAILED: u8 = 1;
/// Exit status for a bad option or a bad environment variable.
const BAD_USAGE: u8 = 2;

fn main() -> ExitCode {
    #[cfg(unix)]
    // Without the handler a file beyond the size limit would kill the process. Nothing else depends on the handler.
    let _ = pendularm::signals::survive_file_size_limit();
    match Options::parse(std::env::args_os()) {
        Ok(Parsed::Serve(options)) => serve(&options),
        #[cfg(feature = "report")]
        Ok(Parsed::Report(options)) => match report::run(&options) {
            Ok(_) => ExitCode::SUCCESS,
            Err(error) => {
                print_error(&error);
                ExitCode::FAILURE
            }
        },
        Ok(Parsed::Plan(options)) => match plan::run(&options) {
            Ok(text) => show(&text),
            Err(error) => {
                print_error(&error);
                ExitCode::FAILURE
            }
        },
        #[cfg(feature = "record")]
        Ok(Parsed::Replay { file }) => replay(&file),
        #[cfg(feature = "cli")]
        Ok(Parsed::Score { files }) => score(&files),
        #[cfg(feature = "cli")]
        Ok(Parsed::Ask(subject)) => end(command::run(&subject)),
        #[cfg(feature = "conformance")]
        Ok(Parsed::Conformance(options)) => ExitCode::from(referee::run(&options)),
        #[cfg(feature = "conformance")]
        Ok(Parsed::Sabotage(options)) => ExitCode::from(sabotage::run(&options)),
        #[cfg(feature = "cli")]
        Ok(Parsed::Completions { shell }) => show(&completions(shell)),
        Ok(Parsed::Show(text)) => show(&text),
        Err(error) => {
            print_error(&error);
            ExitCode::from(BAD_USAGE)
        }
    }
}

/// Writes to standard output.
fn show(text: &str) -> ExitCode {
    match output::print(text) {
        Ok(()) => ExitCode::SUCCESS,
        // A reader may close the pipe early: `pendularm --help | head -1`.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => ExitCode::SUCCESS,
        Err(error) => {
            print_error(&format_args!("standard output: {error}"));
            ExitCode::FAILURE
        }
    }
}

/// Runs a command for a running pendularm, and returns its exit status.
#[cfg(feature = "cli")]
fn end(outcome: Result<(), CommandError>) -> ExitCode {
    let Err(error) = outcome else {
        return ExitCode::SUCCESS;
    };
    let status = error.status();
    if status != 0 {
        print_error(&error);
    }
    ExitCode::from(status)
}

/// Prints the score and the verdict of each submission.
#[cfg(feature = "cli")]
fn score(files: &[PathBuf]) -> ExitCode {
    let mut status = ExitCode::SUCCESS;
    for path in files {
        let mut text = Vec::new();
        let read = File::open(path).and_then(|file| file.take(MOST_BYTES).read_to_end(&mut text));
        let found = read.map_err(|error| error.to_string());
        let file = output::line(&path.display());
        match found.and_then(|_| pendularm::score::score(&text)) {
            Ok(score) if show(&format!("{file}: {score}\n")) == ExitCode::SUCCESS => continue,
            Ok(_) => return ExitCode::FAILURE,
            Err(why) => print_error(&format_args!("{file}: {why}")),
        }
        status = ExitCode::FAILURE;
    }
    status
}

/// Replays a record and prints the result.
#[cfg(feature = "record")]
fn replay(path: &Path) -> ExitCode {
    let file = output::line(&path.display());
    let verdict = File::open(path)
        .map_err(|error| error.to_string())
        .and_then(|file| record::replay(BufReader::new(file)).map_err(|error| error.to_string()));
    match verdict {
        Ok(verdict) => {
            let shown = show(&format!("{file}: {verdict}\n"));
            if verdict.difference.is_some() || verdict.fault.is_some() {
                ExitCode::FAILURE
            } else {
                shown
            }
        }
        Err(error) => {
            print_error(&format_args!("{file}: {error}"));
            ExitCode::FAILURE
        }
    }
}

/// Warns of misspelled variables, such as `ARM_SIM_LINK`.
fn warn_of_unknown_variables() {
    let is_ours = |name: &OsString| name.to_string_lossy().starts_with("ARM_SIM_");
    let names = std::env::vars_os().map(|(name, _)| name);
    let mut unknown: Vec<OsString> = names.filter(is_ours).collect();
    let server = Options::augment_args(Command::new("server"));
    for known in server.get_arguments().filter_map(Arg::get_env) {
        unknown.retain(|name| name != known);
    }
    if !unknown.is_empty() {
        tracing::warn!(?unknown, "variables without effect; --help lists all");
    }
}

fn serve(options: &Options) -> ExitCode {
    let log = match logging::start(options.log, options.log_format) {
        Ok(log) => log,
        Err(error) => {
            print_error(&format_args!("cannot log to standard error: {error}"));
            return ExitCode::FAILURE;
        }
    };
    warn_of_unknown_variables();
    let lines = log.clone();
    panics::end_with(move |what| {
        lines.say(&format!("pendularm: internal error, ending: {what}"));
        lines.finish();
        std::process::exit(i32::from(FAILED));
    });
    let lines = log.clone();
    let force_exit = Box::new(move || {
        lines.say("pendularm: a thread did not stop in time; the program ends without it");
        lines.finish();
        std::process::exit(0);
    });
    let outcome = runtime::run(options, force_exit);
    if let (Err(error), LogFormat::Json) = (&outcome, options.log_format) {
        log.say(&error.to_string());
    }
    log.finish();
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            if options.log_format == LogFormat::Text {
                print_error(&error);
            }
            ExitCode::FAILURE
        }
    }
}
