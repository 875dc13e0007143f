//! The thin binary: options in, exit status out.
//!
//! **Invariant:** nothing here panics, also with standard output or standard error closed, full or broken.

use std::fmt::Display;
use std::io::{self, Write};
use std::process::ExitCode;

use pendularm::actors::{panics, runtime};
use pendularm::logging;
use pendularm::options::{Options, Parsed};
use pendularm::report;

/// Exit status for whatever else fails.
const FAILED: u8 = 1;
/// Exit status for a bad option or a bad environment variable.
const BAD_USAGE: u8 = 2;

fn main() -> ExitCode {
    match Options::parse(std::env::args_os(), |variable| std::env::var_os(variable)) {
        Ok(Parsed::Serve(options)) => serve(&options),
        Ok(Parsed::Report(options)) => match report::run(&options) {
            Ok(_) => ExitCode::SUCCESS,
            Err(error) => {
                complain(&error);
                ExitCode::FAILURE
            }
        },
        Ok(Parsed::Show(text)) => {
            // A reader that is gone has seen what it wanted: `pendularm --help | head -1`.
            let _ = io::stdout().write_all(text.as_bytes());
            ExitCode::SUCCESS
        }
        Err(error) => {
            complain(&error);
            ExitCode::from(BAD_USAGE)
        }
    }
}

fn serve(options: &Options) -> ExitCode {
    let log = match logging::start(options.log) {
        Ok(log) => log,
        Err(error) => {
            complain(&format_args!("cannot log to standard error: {error}"));
            return ExitCode::FAILURE;
        }
    };
    let lines = log.clone();
    panics::end_with(move |what| {
        lines.say(&format!("pendularm: internal error, ending: {what}"));
        lines.finish();
        std::process::exit(i32::from(FAILED));
    });
    let outcome = runtime::run(options);
    log.finish();
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain(&error);
            ExitCode::FAILURE
        }
    }
}

/// One line on standard error. If that is broken there is nobody left to tell.
fn complain(error: &dyn Display) {
    let _ = writeln!(io::stderr(), "pendularm: {error}");
}
