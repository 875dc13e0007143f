//! The command line and the environment. Each option is one field with its help, its variable and its reader.
//!
//! An option overrides its variable. An empty variable counts as unset. A command precedes its options, and reads
//! only the token's variable.
//!
//! **Invariant:** every refusal is one line with the name of the option or variable and the value.

use std::env;
use std::ffi::OsString;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4};
#[cfg(any(feature = "record", feature = "web", feature = "cli"))]
use std::path::PathBuf;

use clap::builder::Resettable;
use clap::error::ErrorKind;
use clap::{Args, Command, CommandFactory, FromArgMatches, Parser, Subcommand};
#[cfg(feature = "cli")]
use clap_complete::Shell;
use tracing::level_filters::LevelFilter;

use crate::address;
#[cfg(feature = "cli")]
use crate::command::{CommandSubject, UNQUOTED};
use crate::logging::LogFormat;
use crate::plan::PlanOptions;
pub use crate::protocol::limits::{DEFAULT_CLIENTS, MAX_CLIENTS};
use crate::protocol::op::token::Token;
#[cfg(feature = "conformance")]
use crate::referee::ConformanceOptions;
#[cfg(feature = "report")]
use crate::report::ReportOptions;
#[cfg(feature = "conformance")]
use crate::sabotage::SabotageOptions;
pub use crate::value::Links;
use crate::value::{ValueReader, needed, one_of, read_links, within};
#[cfg(feature = "web")]
use crate::web::{
    DEFAULT_REPORT,
    access::{Access, read_origin},
};

/// Default address of the runtime. With it, the runtime also listens on `[::1]`.
pub const DEFAULT_BIND: SocketAddr =
    SocketAddr::V4(SocketAddrV4::new(Ipv4Addr::new(127, 0, 0, 1), 9095));

/// The version of this build, its commit if known, and its features.
const BUILD: &str = if cfg!(feature = "web") {
    concat!(env!("PENDULARM_VERSION"), " (web)")
} else {
    concat!(env!("PENDULARM_VERSION"), " (without web)")
};

const AFTER_HELP: &str = "\
The port speaks rosbridge JSON over TCP. With the web feature, which --version shows, it also speaks WebSocket and
serves a page over HTTP.
An option overrides its environment variable. An empty variable counts as unset.
Exit status: 0 after a signal (SIGINT, SIGTERM, SIGHUP), 2 for a bad option or variable, 1 for any other failure.";

/// All options of the server.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct Options {
    /// Number of links of the arm, 2 or 3
    #[arg(long, env = "ARM_SIM_LINKS", value_name = "N", default_value = "2")]
    #[arg(value_parser = ValueReader(read_links))]
    pub links: Links,
    /// Address, port or both to listen on; an address that is not loopback needs a token; port 0 is a free port
    #[arg(long, env = "ARM_SIM_BIND", value_name = "ADDRESS")]
    #[arg(default_value = "127.0.0.1:9095")]
    #[arg(value_parser = ValueReader(read_bind))]
    pub bind: SocketAddr,
    /// Clients served at once, at most 4096; a few places are kept for commands and, with web, for HTTP
    #[arg(long, env = "ARM_SIM_CLIENTS", value_name = "N")]
    #[arg(default_value_t = DEFAULT_CLIENTS)]
    #[arg(value_parser = ValueReader(|text| within(&(1..=MAX_CLIENTS), "a whole number", text)))]
    pub clients: usize,
    /// Control period in seconds; 0 for every step
    #[arg(long, env = "ARM_SIM_CONTROL_PERIOD", value_name = "SECONDS")]
    #[arg(default_value = "0", value_parser = ValueReader(read_period))]
    pub control_period: f64,
    /// Seed for repeatable targets of timed trials; by default it is new at every start
    #[arg(long, env = "ARM_SIM_SEED", value_name = "N")]
    #[arg(value_parser = ValueReader(|text| within(&(0..=u64::MAX), "a whole number", text)))]
    pub seed: Option<u64>,
    /// Level of the log on standard error: off, error, warn, info, debug or trace
    #[arg(long, env = "ARM_SIM_LOG", value_name = "LEVEL")]
    #[arg(default_value = "info", value_parser = ValueReader(read_level))]
    pub log: LevelFilter,
    /// Format of the log: text, or json for one object per line
    #[arg(long, env = "ARM_SIM_LOG_FORMAT", value_name = "FORMAT")]
    #[arg(default_value = "text")]
    #[arg(value_parser = ValueReader(|text| one_of(&[("text", LogFormat::Text), ("json", LogFormat::Json)], text)))]
    pub log_format: LogFormat,
    /// Secret token of 16 to 256 characters; prefer the variable, because other users can see options
    #[arg(long, env = "ARM_SIM_TOKEN", value_name = "TOKEN", value_parser = ValueReader(Token::read))]
    pub token: Option<Token>,
    /// New file for a record of the run, as MCAP
    #[cfg(feature = "record")]
    #[arg(long, env = "ARM_SIM_RECORD", value_name = "FILE")]
    pub record: Option<PathBuf>,
    /// Existing folder for the records of /recorder/start
    #[cfg(feature = "record")]
    #[arg(long, env = "ARM_SIM_RECORD_DIR", value_name = "FOLDER")]
    pub record_dir: Option<PathBuf>,
    /// The rules of admission.
    #[cfg(feature = "web")]
    #[command(flatten)]
    pub access: Access,
    /// Origins of pages that may show the page and the report in a frame, separated by commas
    #[cfg(feature = "web")]
    #[arg(long, env = "ARM_SIM_ALLOW_FRAME", value_name = "ORIGINS")]
    #[arg(value_delimiter = ',', value_parser = ValueReader(read_frame), conflicts_with = "token")]
    pub allow_frame: Vec<Box<str>>,
    /// Folder of the report at /report/
    #[cfg(feature = "web")]
    #[arg(long, env = "ARM_SIM_REPORT", value_name = "FOLDER", default_value = DEFAULT_REPORT)]
    pub report: PathBuf,
}

/// The program's command line.
#[derive(Parser)]
#[command(version = BUILD, about, after_help = AFTER_HELP, args_conflicts_with_subcommands = true)]
struct CommandLine {
    #[command(flatten)]
    options: Options,
    #[command(subcommand)]
    command: Option<Parsed>,
}

/// The parsed command line: one of the commands, or to serve.
#[derive(Debug, Clone, PartialEq, Subcommand)]
pub enum Parsed {
    /// Serves clients, with these options.
    #[command(skip)]
    Serve(Box<Options>),
    /// Prints this text on standard output.
    #[command(skip)]
    Show(String),
    /// Find the cheapest method and timestep for an allowed error, and measure the error against a reference
    Plan(PlanOptions),
    /// Measure error against run time and stability, and write a report
    #[cfg(feature = "report")]
    Report(ReportOptions),
    /// Repeat the steps of a recorded run, and compare every state
    #[cfg(feature = "record")]
    #[command(
        after_help = "Exit status: 0 if every state is bit-identical, 1 if not, or if the file was damaged."
    )]
    Replay {
        /// The record, from --record or /recorder/start
        file: PathBuf,
    },
    /// Recompute episodes of the Python environments from their submissions, and print scores and verdicts
    #[cfg(feature = "cli")]
    #[command(after_help = "Exit status: 0 if every submission is confirmed, 1 if not.")]
    Score {
        /// The submissions, from pendularm.submission
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// Test any server of the protocol against the rules of the specification
    #[cfg(feature = "conformance")]
    Conformance(Box<ConformanceOptions>),
    /// Serve the arm with one planted fault, as an exercise
    #[cfg(feature = "conformance")]
    Sabotage(SabotageOptions),
    /// A command for a running pendularm.
    #[cfg(feature = "cli")]
    #[command(flatten)]
    Ask(CommandSubject),
    /// Print the completions of a shell
    #[cfg(feature = "cli")]
    #[command(after_help = "\
Examples:
  source <(pendularm completions bash)
  pendularm completions fish > ~/.config/fish/completions/pendularm.fish")]
    Completions {
        /// The shell
        shell: Shell,
    },
}

/// The first paragraph of the error, in one line. Usage and hints follow it.
fn refusal(error: &clap::Error) -> String {
    let report = error.to_string();
    let first = report.split("\n\n").next().unwrap_or_default();
    let first = first.strip_prefix("error: ").unwrap_or(first);
    let words: Vec<&str> = first.split_whitespace().collect();
    let hint = match error.kind() {
        ErrorKind::ValueValidation | ErrorKind::InvalidValue => "",
        _ => "; --help lists all commands and options",
    };
    words.join(" ") + hint
}

impl Options {
    /// Reads the arguments, with the program's name first. An option that is not among them is read from its variable.
    ///
    /// # Errors
    /// The refusal of the first invalid argument, option or variable, in one line.
    pub fn parse(
        arguments: impl IntoIterator<Item = impl Into<OsString>>,
    ) -> Result<Parsed, String> {
        let words: Vec<OsString> = arguments.into_iter().map(Into::into).collect();
        let begins = |word: &OsString, with: &[char]| word.to_string_lossy().starts_with(with);
        let is_command = |word: &&OsString| !begins(word, &['-']) && *word != "help";
        let serves = words.get(1).filter(is_command).is_none();
        let matches = prepared(CommandLine::command(), serves).try_get_matches_from(&words);
        match matches.and_then(|matches| CommandLine::from_arg_matches(&matches)) {
            Ok(CommandLine { options, command }) => match command {
                None => options.checked().map(Box::new).map(Parsed::Serve),
                Some(Parsed::Plan(plan)) => plan.checked().map(Parsed::Plan),
                Some(command) => Ok(command),
            },
            #[cfg(feature = "cli")]
            Err(error)
                if error.kind() == ErrorKind::UnknownArgument
                    && words.iter().any(|word| begins(word, &['{', '['])) =>
            {
                Err(UNQUOTED.to_owned())
            }
            Err(error) if error.use_stderr() => Err(refusal(&error)),
            Err(shown) => Ok(Parsed::Show(shown.to_string())),
        }
    }

    fn checked(self) -> Result<Self, String> {
        let bind = self.bind;
        if bind.ip().is_loopback() || self.token.is_some() {
            return Ok(self);
        }
        Err(format!(
            "--bind (ARM_SIM_BIND) must be a loopback address, such as {DEFAULT_BIND}, unless --token is set, \
             got \"{bind}\""
        ))
    }
}

/// The completions of all commands and options.
#[cfg(feature = "cli")]
#[must_use]
pub fn completions(shell: Shell) -> String {
    let mut script = Vec::new();
    let name = env!("CARGO_PKG_NAME");
    clap_complete::generate(shell, &mut CommandLine::command(), name, &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

/// The command line with the rules for all options: numbers may be negative, and an empty variable counts as
/// unset. The variables of the server's options are read only if it `serves`.
fn prepared(command: Command, serves: bool) -> Command {
    let command = command.mut_args(|arg| {
        let is_empty = |variable| env::var_os(variable).is_some_and(|value| value.is_empty());
        let ignores_variable = !serves || arg.get_env().is_some_and(is_empty);
        let is_option = arg.get_long().is_some() && arg.get_action().takes_values();
        let may_be_negative = is_option || arg.is_allow_negative_numbers_set();
        let arg = arg
            .hide_env_values(true)
            .allow_negative_numbers(may_be_negative);
        match ignores_variable {
            true => arg.env(Resettable::Reset),
            false => arg,
        }
    });
    // A subject without a verb is refused in one line, like every error.
    let command = command.arg_required_else_help(false);
    command.mut_subcommands(|subcommand| prepared(subcommand, true))
}

fn read_bind(text: &str) -> Result<SocketAddr, String> {
    let address = address::read(text).and_then(|text| match text.strip_prefix("localhost:") {
        Some(port) => Some(SocketAddr::from((Ipv4Addr::LOCALHOST, port.parse().ok()?))),
        None => text.parse().ok(),
    });
    let needs = "localhost or an IP address, a port, or both, such as 127.0.0.1:9095 or [::1]:9095";
    needed(address, needs, text)
}

fn read_period(text: &str) -> Result<f64, String> {
    let period = text.parse().ok();
    let period = period.filter(|period: &f64| period.is_finite() && *period >= 0.0);
    needed(period, "a time in seconds, at least 0", text)
}

fn read_level(text: &str) -> Result<LevelFilter, String> {
    let level = text.parse().ok();
    // `tracing` also accepts numbers and capitals.
    let level = level.filter(|level: &LevelFilter| level.to_string() == text);
    needed(level, "off, error, warn, info, debug or trace", text)
}

/// The origin of a page that may show this one in a frame. A browser compares scheme, host and port, so it needs a
/// host.
#[cfg(feature = "web")]
fn read_frame(text: &str) -> Result<Box<str>, String> {
    let origin = read_origin(text).ok();
    let page = origin.filter(|one| one.starts_with("http://") || one.starts_with("https://"));
    let needs = "origins of web pages, such as https://example.org, separated by commas";
    needed(page, needs, text)
}
