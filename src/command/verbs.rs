//! The shape that all commands have: options, arguments, the page that `--help` shows.
//!
//! **Invariant:** an option has one name and one meaning in all of them.

use clap::builder::OsStringValueParser;
use clap::{Arg, ArgAction, Command};

use super::asked::{TOKEN, read_address, read_positive};

/// Ends the help of each.
const STATUS: &str = "\
Exit status: 0 if it was done, 1 if the runtime refused (it says why) or did not succeed, 2 for bad usage, 3 without an
answer: no connection, one that ended, or nothing within --timeout.";

/// A subject, which is nothing without one of its commands.
pub(super) fn subject(name: &'static str, about: &'static str) -> Command {
    Command::new(name)
        .about(about)
        .after_help("Each of them has a --help of its own.")
        .subcommand_required(true)
        .disable_help_subcommand(true)
}

/// A command, with the options that all of them have. Its page ends with `notes`: examples, and how it behaves.
pub(super) fn verb(name: &'static str, about: &'static str, notes: &str) -> Command {
    let option = |name: &'static str, value: &'static str, help: &'static str| {
        number(name, value).help(help).help_heading("The runtime")
    };
    let connect = option("connect", "HOST:PORT", "Where the runtime listens")
        .default_value("127.0.0.1:9095")
        .value_parser(read_address);
    let token = option(
        TOKEN,
        "TOKEN",
        "The token that it asks for; other users may see it, but not the variable [env: ARM_SIM_TOKEN]",
    )
    .value_parser(OsStringValueParser::new());
    let timeout = option(
        "timeout",
        "SECONDS",
        "How long an answer or the next message may take [default: for ever; 5 s for the connection]",
    )
    .value_parser(read_positive);
    let json = flag(
        "json",
        "Print JSON, one object or value a line, instead of YAML",
    );
    Command::new(name)
        .about(about)
        .after_help(format!("{notes}\n\n{STATUS}"))
        .args([json, connect, token, timeout])
}

/// An option whose value may begin with a hyphen if it is a number: its own refusal then says what is wrong with that.
pub(super) fn number(name: &'static str, value: &'static str) -> Arg {
    let arg = Arg::new(name).long(name).value_name(value);
    arg.allow_negative_numbers(true)
}

/// A switch.
pub(super) fn flag(name: &'static str, help: &'static str) -> Arg {
    let arg = Arg::new(name).long(name).help(help);
    arg.action(ArgAction::SetTrue)
}

/// An argument that has to be there.
pub(super) fn required(name: &'static str, value: &'static str, help: &'static str) -> Arg {
    Arg::new(name).value_name(value).help(help).required(true)
}

/// A type, and what has that type; `Asked::typed_value` tells the two apart.
pub(super) fn typed_value(value: &'static str, help: &'static str) -> [Arg; 2] {
    [
        Arg::new("type")
            .value_name("TYPE")
            .help("Its type, as pkg/Name; it need not be given, and is checked if it is"),
        Arg::new("value").value_name(value).help(help),
    ]
}

/// Whether a list shows types.
pub(super) fn show_types() -> Arg {
    flag("show-types", "Show the type of each").short('t')
}
