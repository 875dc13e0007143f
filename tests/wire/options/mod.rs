//! The command line and the environment: accepted and refused values, with their messages.
//!
//! **Invariant:** arguments are passed in; with a variable of the environment the program itself is started.

mod arguments;
mod program;
mod values;
mod variables;

use pendularm::options::{Options, Parsed};

fn parse(arguments: &[&str]) -> Result<Parsed, String> {
    Options::parse(["pendularm"].iter().chain(arguments))
}

#[track_caller]
fn options(arguments: &[&str]) -> Options {
    match parse(arguments) {
        Ok(Parsed::Serve(options)) => *options,
        other => panic!("not to be served: {other:?}"),
    }
}

#[track_caller]
fn refusal(arguments: &[&str]) -> String {
    parse(arguments).unwrap_err().to_string()
}
