//! The command line and the environment, each option once.
//!
//! Pure: arguments and variables are handed in, and what the program is to do comes back as a value. `clap` reads the
//! arguments and lays out the help; the values are read here, so that an option and its variable follow one rule.
//!
//! An option wins over its variable, which is then not looked at; an empty variable counts as unset.
//!
//! **Invariant:** every refusal is one line that names the option or the variable, and shows the value.

mod explained;
mod links;
mod log;
mod plan;
#[cfg(feature = "record")]
mod record;
#[cfg(feature = "report")]
mod report;
mod setting;
mod usage;
mod values;
#[cfg(feature = "web")]
mod web;

use std::ffi::OsString;
use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4};
#[cfg(feature = "cli")]
use std::path::PathBuf;

#[cfg(feature = "record")]
use clap::ArgMatches;
use clap::builder::{OsStringValueParser, StyledStr};
use clap::{Arg, Command};
use tracing::level_filters::LevelFilter;

use self::explained::explained;
pub use self::links::Links;
pub use self::plan::PlanOptions;
#[cfg(feature = "record")]
pub use self::record::{RecordOptions, ReplayOptions};
use self::setting::{Given, LaunchOption, given};
pub use self::usage::{Origin, UsageError};
use self::values::{read_bind, read_links, read_seed, read_token};
#[cfg(feature = "web")]
pub use self::web::WebOptions;
#[cfg(feature = "cli")]
use crate::command::{self, Asked};
use crate::logging::LogFormat;
use crate::protocol::op::token::Token;
#[cfg(feature = "report")]
use crate::report::ReportOptions;

/// Address of the runtime unless an option says otherwise; bound here, it listens on `[::1]` too.
pub const DEFAULT_BIND: SocketAddr =
    SocketAddr::V4(SocketAddrV4::new(Ipv4Addr::new(127, 0, 0, 1), 9095));

/// The features of this build, as the version shows them.
const BUILD: &str = if cfg!(feature = "web") {
    concat!(env!("CARGO_PKG_VERSION"), " (web)")
} else {
    concat!(env!("CARGO_PKG_VERSION"), " (without web)")
};

#[cfg(feature = "web")]
const TRANSPORTS: &str = "\
This build has the web feature: the port speaks rosbridge JSON over TCP and over WebSocket, and serves a page \
over HTTP.";
#[cfg(not(feature = "web"))]
const TRANSPORTS: &str = "\
This build is without the web feature: the port speaks rosbridge JSON over TCP, and neither WebSocket nor HTTP.";

const AFTER_HELP: &str = "\
An option wins over its environment variable; an empty variable counts as unset.
Exit status: 0 after SIGINT or SIGTERM, 2 for a bad option or variable, 1 for any other failure.";

const LINKS: LaunchOption = LaunchOption {
    option: "links",
    variable: "ARM_SIM_LINKS",
    value: "N",
    about: "Number of links of the arm, 2 or 3",
    default: "2",
    is_switch: false,
};

const BIND: LaunchOption = LaunchOption {
    option: "bind",
    variable: "ARM_SIM_BIND",
    value: "ADDRESS",
    about: "Address and port to listen on, loopback unless there is a token; port 0 takes a free one",
    default: "127.0.0.1:9095",
    is_switch: false,
};

const SEED: LaunchOption = LaunchOption {
    option: "seed",
    variable: "ARM_SIM_SEED",
    value: "N",
    about: "Makes the targets of timed trials repeatable",
    default: "a new seed at every start",
    is_switch: false,
};

const TOKEN: LaunchOption = LaunchOption {
    option: "token",
    variable: "ARM_SIM_TOKEN",
    value: "TOKEN",
    about: "What every client has to show, 16 characters at least; who may list this machine's processes \
            sees it, so better use the variable",
    default: "none",
    is_switch: false,
};

/// All of them, in the order of the help.
const SETTINGS: &[&LaunchOption] = &[
    &LINKS,
    &BIND,
    &SEED,
    &log::LOG,
    &log::LOG_FORMAT,
    &TOKEN,
    #[cfg(feature = "record")]
    &record::RECORD,
    #[cfg(feature = "record")]
    &record::RECORD_DIR,
    #[cfg(feature = "web")]
    &web::ALLOW_HOST,
    #[cfg(feature = "web")]
    &web::ALLOW_ORIGIN,
    #[cfg(feature = "web")]
    &web::STRICT_ORIGIN,
    #[cfg(feature = "web")]
    &web::REPORT,
];

/// Everything that is chosen at launch.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// How many links the arm has.
    pub links: Links,
    /// Address to listen on: a loopback address, or any if there is a token; port 0 takes a free one.
    pub bind: SocketAddr,
    /// Whether `bind` is [`DEFAULT_BIND`], which brings `[::1]` with it.
    pub is_default_bind: bool,
    /// The seed of the random targets of timed trials; a new one at every start if absent.
    pub seed: Option<u64>,
    /// The log level.
    pub log: LevelFilter,
    /// How each line of the log is written.
    pub log_format: LogFormat,
    /// The token that every client has to show, if there is one.
    pub token: Option<Token>,
    /// About runs on record.
    #[cfg(feature = "record")]
    pub record: RecordOptions,
    /// About the site.
    #[cfg(feature = "web")]
    pub web: WebOptions,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            links: Links::default(),
            bind: DEFAULT_BIND,
            is_default_bind: true,
            seed: None,
            log: LevelFilter::INFO,
            log_format: LogFormat::default(),
            token: None,
            #[cfg(feature = "record")]
            record: RecordOptions::default(),
            #[cfg(feature = "web")]
            web: WebOptions::default(),
        }
    }
}

/// The request of the command line.
#[derive(Debug, Clone, PartialEq)]
pub enum Parsed {
    /// To serve clients, with these options.
    Serve(Options),
    /// To plan method and timestep for an allowed error.
    Plan(PlanOptions),
    /// To replay a record.
    #[cfg(feature = "record")]
    Replay(ReplayOptions),
    /// To ask a running one.
    #[cfg(feature = "cli")]
    Ask(Asked),
    /// To write the pages of the manual into this folder.
    #[cfg(feature = "cli")]
    WriteManual(PathBuf),
    /// To make the study's report.
    #[cfg(feature = "report")]
    Report(ReportOptions),
    /// To show this text on standard output, and no more: the help or the version.
    Show(String),
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
        let matches = match command_line().try_get_matches_from(arguments) {
            Ok(matches) => matches,
            Err(error) => return explained(&error).map(Parsed::Show),
        };
        if let Some((name, subcommand)) = matches.subcommand() {
            // An option of serving means nothing to a subcommand.
            if let Some(stray) = SETTINGS.iter().find(|s| matches.contains_id(s.option)) {
                return Err(UsageError::UnknownArgument {
                    argument: format!("--{}", stray.option),
                });
            }
            return match name {
                #[cfg(feature = "report")]
                report::NAME => Ok(Parsed::Report(report::read(subcommand))),
                #[cfg(feature = "record")]
                record::REPLAY => Self::of_replay(subcommand, environment),
                plan::NAME => plan::read(subcommand).map(Parsed::Plan),
                #[cfg(feature = "cli")]
                command::COMPLETIONS => {
                    let script = command::complete(command::shell(subcommand), command_line());
                    Ok(Parsed::Show(script))
                }
                #[cfg(feature = "cli")]
                command::MAN => Ok(Parsed::WriteManual(command::folder(subcommand))),
                #[cfg(feature = "cli")]
                subject => {
                    let leaf = subcommand.subcommand().map_or(subcommand, |(_, leaf)| leaf);
                    let token = setting::given(&TOKEN, leaf, &environment);
                    let token = token.map(read_token).transpose()?;
                    Ok(Parsed::Ask(Asked::new(subject, subcommand, token)))
                }
                #[cfg(not(feature = "cli"))]
                _ => Err(UsageError::UnknownArgument {
                    argument: name.to_owned(),
                }),
            };
        }
        let given = |setting: &LaunchOption| given(setting, &matches, &environment);
        Self::read(given).map(Parsed::Serve)
    }

    /// A record to be replayed, or to be served in the arm's place.
    #[cfg(feature = "record")]
    fn of_replay(
        matches: &ArgMatches,
        environment: impl Fn(&str) -> Option<OsString>,
    ) -> Result<Parsed, UsageError> {
        let replay = record::read(matches);
        let mut of_serving = SETTINGS.iter().filter(|one| record::is_of_replay(one));
        if matches.get_flag(record::SERVE) {
            let given = |setting: &LaunchOption| {
                let is_ours = record::is_of_replay(setting);
                is_ours.then(|| given(setting, matches, &environment))?
            };
            let mut options = Self::read(given)?;
            options.record.replay = Some(replay.file);
            return Ok(Parsed::Serve(options));
        }
        match of_serving.find(|one| matches.contains_id(one.option)) {
            Some(stray) => Err(UsageError::UnknownArgument {
                argument: format!("--{} without --{}", stray.option, record::SERVE),
            }),
            None => Ok(Parsed::Replay(replay)),
        }
    }

    fn read(given: impl Fn(&LaunchOption) -> Option<Given>) -> Result<Self, UsageError> {
        let token = given(&TOKEN).map(read_token).transpose()?;
        let bind = given(&BIND)
            .map(|bind| read_bind(bind, token.is_some()))
            .transpose()?
            .unwrap_or(DEFAULT_BIND);
        Ok(Self {
            links: given(&LINKS)
                .map(read_links)
                .transpose()?
                .unwrap_or_default(),
            bind,
            is_default_bind: bind == DEFAULT_BIND,
            seed: given(&SEED).map(read_seed).transpose()?,
            log: given(&log::LOG)
                .map(log::read_level)
                .transpose()?
                .unwrap_or(LevelFilter::INFO),
            log_format: given(&log::LOG_FORMAT)
                .map(log::read_format)
                .transpose()?
                .unwrap_or_default(),
            token,
            #[cfg(feature = "record")]
            record: RecordOptions::read(&given),
            #[cfg(feature = "web")]
            web: WebOptions::read(&given)?,
        })
    }
}

/// The command line as `clap` is to read it. The values stay unread, and the variables unknown to it.
#[must_use]
pub fn command_line() -> Command {
    let command = Command::new(env!("CARGO_PKG_NAME"))
        .version(BUILD)
        .about(env!("CARGO_PKG_DESCRIPTION"))
        .after_help(format!("{TRANSPORTS}\n{AFTER_HELP}"))
        .args(arguments(|_| true))
        .disable_help_subcommand(true)
        .subcommand(plan::command());
    #[cfg(feature = "report")]
    let command = command.subcommand(report::command());
    #[cfg(feature = "record")]
    let command = command.subcommand(record::command(arguments(record::is_of_replay)));
    #[cfg(feature = "cli")]
    let command = command
        .subcommands(command::subjects())
        .subcommands(command::tools());
    command
}

/// The options of serving as `clap` is to read them, as far as they are `chosen`.
fn arguments(chosen: fn(&LaunchOption) -> bool) -> impl Iterator<Item = Arg> {
    let chosen = SETTINGS.iter().filter(move |setting| chosen(setting));
    chosen.map(|setting| {
        let LaunchOption {
            option,
            variable,
            value,
            about,
            default,
            is_switch,
        } = **setting;
        let arg = Arg::new(option)
            .long(option)
            .value_name(value)
            .value_parser(OsStringValueParser::new())
            .allow_negative_numbers(true)
            .help(StyledStr::from(format!(
                "{about} [env: {variable}] [default: {default}]"
            )));
        if is_switch {
            arg.num_args(0..=1)
                .require_equals(true)
                .default_missing_value("true")
        } else {
            arg
        }
    })
}
