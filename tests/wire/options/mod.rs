//! The command line and the environment: what is taken, what is refused, and in which words.
//!
//! **Invariant:** arguments and variables are passed in; only the tests in `program.rs` start the program itself.

mod arguments;
mod commands;
mod help;
mod program;
#[cfg(feature = "record")]
mod record;
mod values;

use std::ffi::OsString;

use pendularm::options::{Options, Parsed, UsageError};

fn parse(arguments: &[&str], variables: &[(&str, &str)]) -> Result<Parsed, UsageError> {
    let arguments = ["pendularm"].iter().chain(arguments);
    Options::parse(arguments, |name| {
        let found = variables.iter().find(|(variable, _)| *variable == name)?;
        Some(OsString::from(found.1))
    })
}

#[track_caller]
fn options(arguments: &[&str], variables: &[(&str, &str)]) -> Options {
    match parse(arguments, variables) {
        Ok(Parsed::Serve(options)) => options,
        other => panic!("not to be served: {other:?}"),
    }
}

#[track_caller]
fn refusal(arguments: &[&str], variables: &[(&str, &str)]) -> String {
    parse(arguments, variables).unwrap_err().to_string()
}
