//! The command line and the environment, each option once.
//!
//! Pure: arguments and variables are handed in, and what the program is to do comes back as a value. `clap` reads the
//! arguments and lays out the help; the values are read here, so that an option and its variable follow one rule.
//!
//! An option wins over its variable, which is then not looked at; an empty variable counts as unset.
//!
//! **Invariant:** every refusal is one line that names the option or the variable, and shows the value.

use std::ffi::OsString;
use std::fmt;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4};
use std::path::PathBuf;

use clap::builder::{OsStringValueParser, StyledStr};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, ArgAction, ArgMatches, Command};
use tracing::level_filters::LevelFilter;

use crate::report::{self, ReportOptions};

/// Where the runtime listens unless told otherwise; bound here, it listens on `[::1]` too.
pub const DEFAULT_BIND: SocketAddr =
    SocketAddr::V4(SocketAddrV4::new(Ipv4Addr::new(127, 0, 0, 1), 9095));

/// The log levels by name, from silent to everything.
const LEVELS: [(&str, LevelFilter); 6] = [
    ("off", LevelFilter::OFF),
    ("error", LevelFilter::ERROR),
    ("warn", LevelFilter::WARN),
    ("info", LevelFilter::INFO),
    ("debug", LevelFilter::DEBUG),
    ("trace", LevelFilter::TRACE),
];

/// The subcommand that makes the study's report, and the directory that it writes to unless told otherwise.
const REPORT: &str = "report";

const AFTER_HELP: &str = "\
An option wins over its environment variable; an empty variable counts as unset.
Exit status: 0 after SIGINT or SIGTERM, 2 for a bad option or variable, 1 for any other failure.";

/// An option and the environment variable that stands in for it.
struct Setting {
    option: &'static str,
    variable: &'static str,
    /// The value's name in the help.
    value: &'static str,
    about: &'static str,
    /// What holds without either, as the help shows it.
    default: &'static str,
}

const LINKS: Setting = Setting {
    option: "links",
    variable: "ARM_SIM_LINKS",
    value: "N",
    about: "Number of links of the arm, 2 or 3",
    default: "2",
};

const BIND: Setting = Setting {
    option: "bind",
    variable: "ARM_SIM_BIND",
    value: "ADDRESS",
    about: "Loopback address and port to listen on; port 0 takes a free one",
    default: "127.0.0.1:9095",
};

const SEED: Setting = Setting {
    option: "seed",
    variable: "ARM_SIM_SEED",
    value: "N",
    about: "Makes the targets of timed trials repeatable",
    default: "a new seed at every start",
};

const LOG: Setting = Setting {
    option: "log",
    variable: "ARM_SIM_LOG",
    value: "LEVEL",
    about: "What is logged to standard error: off, error, warn, info, debug or trace",
    default: "info",
};

const SETTINGS: [&Setting; 4] = [&LINKS, &BIND, &SEED, &LOG];

/// How many links the arm has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Links {
    /// A 2-link arm.
    #[default]
    Two,
    /// A 3-link arm.
    Three,
}

impl Links {
    /// The number itself.
    #[must_use]
    pub const fn count(self) -> usize {
        match self {
            Self::Two => 2,
            Self::Three => 3,
        }
    }
}

/// Everything that is chosen at launch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// How many links the arm has.
    pub links: Links,
    /// Where to listen: a loopback address; port 0 takes a free one.
    pub bind: SocketAddr,
    /// Whether `bind` is [`DEFAULT_BIND`], which brings `[::1]` with it.
    pub is_default_bind: bool,
    /// What the random targets of timed trials start from; a new seed at every start if absent.
    pub seed: Option<u64>,
    /// What is logged.
    pub log: LevelFilter,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            links: Links::default(),
            bind: DEFAULT_BIND,
            is_default_bind: true,
            seed: None,
            log: LevelFilter::INFO,
        }
    }
}

/// What the command line asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Parsed {
    /// To serve clients, with these options.
    Serve(Options),
    /// To make the study's report.
    Report(ReportOptions),
    /// To show this text on standard output, and no more: the help or the version.
    Show(String),
}

/// Where a value came from, as a refusal names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// An option on the command line, by its long name.
    Option(&'static str),
    /// An environment variable.
    Variable(&'static str),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Option(name) => write!(f, "--{name}"),
            Self::Variable(name) => f.write_str(name),
        }
    }
}

/// Why the command line or the environment was refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UsageError {
    /// An argument that is no option of this program.
    #[error("unknown argument {argument:?}; --help shows all of them")]
    UnknownArgument {
        /// The argument as it was given.
        argument: String,
    },
    /// An option at the end, or before another option.
    #[error("{option} needs a value")]
    MissingValue {
        /// The option with its value's name, as in the help.
        option: String,
    },
    /// An option that is given more than once.
    #[error("{option} is given more than once")]
    Repeated {
        /// The option with its value's name, as in the help.
        option: String,
    },
    /// `--help=...` or the like.
    #[error("{option} takes no value, got {value:?}")]
    UnexpectedValue {
        /// The option.
        option: String,
        /// What was given to it.
        value: String,
    },
    /// Anything else that is wrong with the arguments' form.
    #[error("the arguments cannot be read ({kind:?}); --help shows them")]
    Arguments {
        /// What the reader of the arguments calls it.
        kind: ErrorKind,
    },
    /// A number of links other than 2 and 3.
    #[error("{origin} must be 2 or 3, got {value:?}")]
    Links {
        /// Whose value it is.
        origin: Origin,
        /// The value.
        value: String,
    },
    /// No address with a port.
    #[error("{origin} must be an IP address with a port, such as 127.0.0.1:9095, got {value:?}")]
    Bind {
        /// Whose value it is.
        origin: Origin,
        /// The value.
        value: String,
    },
    /// An address that other machines could reach: nothing asks them who they are.
    #[error("{origin} must be a loopback address, such as 127.0.0.1:9095, got {value:?}")]
    NotLoopback {
        /// Whose value it is.
        origin: Origin,
        /// The value.
        value: String,
    },
    /// No seed.
    #[error(
        "{origin} must be a whole number from 0 to {}, got {value:?}",
        u64::MAX
    )]
    Seed {
        /// Whose value it is.
        origin: Origin,
        /// The value.
        value: String,
    },
    /// No log level.
    #[error("{origin} must be one of off, error, warn, info, debug, trace, got {value:?}")]
    Log {
        /// Whose value it is.
        origin: Origin,
        /// The value.
        value: String,
    },
}

impl Options {
    /// Reads the arguments, the program's name first, and for each option that is not among them its variable.
    ///
    /// # Errors
    /// [`UsageError`] for the first argument, option or variable that is not as it should be.
    pub fn parse<I, T, E>(arguments: I, environment: E) -> Result<Parsed, UsageError>
    where
        I: IntoIterator<Item = T>,
        T: Into<OsString> + Clone,
        E: Fn(&str) -> Option<OsString>,
    {
        let matches = match command().try_get_matches_from(arguments) {
            Ok(matches) => matches,
            Err(error) => return told(&error),
        };
        if let Some(report) = matches.subcommand_matches(REPORT) {
            // What serving is told means nothing to a report.
            if let Some(stray) = SETTINGS.iter().find(|s| matches.contains_id(s.option)) {
                return Err(UsageError::UnknownArgument {
                    argument: format!("--{}", stray.option),
                });
            }
            return Ok(Parsed::Report(read_report(report)));
        }
        let given = |setting| given(setting, &matches, &environment);
        let bind = given(&BIND)
            .map(read_bind)
            .transpose()?
            .unwrap_or(DEFAULT_BIND);
        Ok(Parsed::Serve(Self {
            links: given(&LINKS)
                .map(read_links)
                .transpose()?
                .unwrap_or_default(),
            bind,
            is_default_bind: bind == DEFAULT_BIND,
            seed: given(&SEED).map(read_seed).transpose()?,
            log: given(&LOG)
                .map(read_log)
                .transpose()?
                .unwrap_or(LevelFilter::INFO),
        }))
    }
}

/// The command line as `clap` is to read it. The values stay unread, and the variables unknown to it.
fn command() -> Command {
    let options = SETTINGS.map(|setting| {
        let Setting {
            option,
            variable,
            value,
            about,
            default,
        } = *setting;
        Arg::new(option)
            .long(option)
            .value_name(value)
            .value_parser(OsStringValueParser::new())
            .help(StyledStr::from(format!(
                "{about} [env: {variable}] [default: {default}]"
            )))
    });
    Command::new(env!("CARGO_PKG_NAME"))
        .version(env!("CARGO_PKG_VERSION"))
        .about(env!("CARGO_PKG_DESCRIPTION"))
        .after_help(AFTER_HELP)
        .args(options)
        .disable_help_subcommand(true)
        .subcommand(report_command())
}

fn report_command() -> Command {
    let option = |name: &'static str, value: &'static str, about: String| {
        Arg::new(name).long(name).value_name(value).help(about)
    };
    Command::new(REPORT)
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
            .value_delimiter(','),
        )
        .arg(
            Arg::new("quick")
                .long("quick")
                .action(ArgAction::SetTrue)
                .help("Coarser and shorter: a look in seconds"),
        )
}

fn read_report(matches: &ArgMatches) -> ReportOptions {
    ReportOptions {
        out: matches
            .get_one::<OsString>("out")
            .map_or_else(|| PathBuf::from(REPORT), PathBuf::from),
        only: matches
            .get_many::<String>("only")
            .map(|names| names.cloned().collect())
            .unwrap_or_default(),
        quick: matches.get_flag("quick"),
    }
}

/// Turns what `clap` reports into what we say: a text that was asked for, or a refusal on one line.
fn told(error: &clap::Error) -> Result<Parsed, UsageError> {
    let context = |kind| match error.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        _ => String::new(),
    };
    // The argument as the user gave it, and the option as the help shows it, share this place.
    let argument = match error.kind() {
        ErrorKind::InvalidSubcommand => context(ContextKind::InvalidSubcommand),
        _ => context(ContextKind::InvalidArg),
    };
    Err(match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            return Ok(Parsed::Show(error.to_string()));
        }
        ErrorKind::UnknownArgument | ErrorKind::InvalidSubcommand => {
            UsageError::UnknownArgument { argument }
        }
        ErrorKind::InvalidValue => UsageError::MissingValue { option: argument },
        ErrorKind::ArgumentConflict => UsageError::Repeated { option: argument },
        ErrorKind::TooManyValues => UsageError::UnexpectedValue {
            option: argument,
            value: context(ContextKind::InvalidValue),
        },
        kind => UsageError::Arguments { kind },
    })
}

/// A value that somebody gave, and where.
struct Given {
    origin: Origin,
    /// As text: a byte that is no UTF-8 becomes a sign that no valid value holds.
    value: String,
}

fn given(
    setting: &Setting,
    matches: &ArgMatches,
    environment: impl Fn(&str) -> Option<OsString>,
) -> Option<Given> {
    let text = |value: &OsString| value.to_string_lossy().into_owned();
    if let Some(value) = matches.get_one::<OsString>(setting.option) {
        return Some(Given {
            origin: Origin::Option(setting.option),
            value: text(value),
        });
    }
    let value = environment(setting.variable).filter(|value| !value.is_empty())?;
    Some(Given {
        origin: Origin::Variable(setting.variable),
        value: text(&value),
    })
}

fn read_links(Given { origin, value }: Given) -> Result<Links, UsageError> {
    match value.as_str() {
        "2" => Ok(Links::Two),
        "3" => Ok(Links::Three),
        _ => Err(UsageError::Links { origin, value }),
    }
}

fn read_bind(Given { origin, value }: Given) -> Result<SocketAddr, UsageError> {
    match value.parse::<SocketAddr>() {
        Ok(address) if address.ip().is_loopback() => Ok(address),
        Ok(_) => Err(UsageError::NotLoopback { origin, value }),
        Err(_) => Err(UsageError::Bind { origin, value }),
    }
}

fn read_seed(Given { origin, value }: Given) -> Result<u64, UsageError> {
    value
        .parse()
        .map_err(|_| UsageError::Seed { origin, value })
}

fn read_log(Given { origin, value }: Given) -> Result<LevelFilter, UsageError> {
    let known = LEVELS.iter().find(|(name, _)| *name == value);
    known
        .map(|(_, level)| *level)
        .ok_or(UsageError::Log { origin, value })
}
