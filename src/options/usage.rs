//! Why the command line or the environment was refused.
//!
//! **Invariant:** one line that names the option or the variable and shows the value, a secret's apart.

use std::fmt;

use clap::error::ErrorKind;

use crate::protocol::op::token::TokenError;

/// Origin of a value, as a refusal names it.
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
    /// The word `help`.
    #[error("help is an option, behind any command: use --help")]
    Help,
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
        /// The value given to it.
        value: String,
    },
    /// A subject without one of its commands.
    #[error("{before} needs one of {known}; --help shows them")]
    MissingCommand {
        /// The words before it.
        before: String,
        /// The commands that there are.
        known: String,
    },
    /// An argument that has to be there.
    #[error("{arguments} has to be given; --help shows what for")]
    MissingArgument {
        /// The arguments as the help shows them.
        arguments: String,
    },
    /// Two that do not go together.
    #[error("{argument} does not go with {other}")]
    Conflict {
        /// The one.
        argument: String,
        /// The other.
        other: String,
    },
    /// A value that an argument does not take.
    #[error("{argument} {needs}, got {value:?}")]
    Value {
        /// The argument as the help shows it.
        argument: String,
        /// The values that it takes.
        needs: String,
        /// The value.
        value: String,
    },
    /// Anything else that is wrong with the arguments' form.
    #[error("the arguments cannot be read ({kind:?}); --help shows them")]
    Arguments {
        /// The name that the reader of the arguments has for it.
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
    /// An address that other machines could reach, and nothing that asks them who they are.
    #[error(
        "{origin} must be a loopback address, such as 127.0.0.1:9095, unless --token gives something to ask for, got \
         {value:?}"
    )]
    NotLoopback {
        /// Whose value it is.
        origin: Origin,
        /// The value.
        value: String,
    },
    /// A value that cannot be planned with.
    #[error("--{option} must be {needs}, got {value:?}")]
    Plan {
        /// The option.
        option: &'static str,
        /// The kind of value that it takes.
        needs: &'static str,
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
    /// No format of the log.
    #[error("{origin} must be text or json, got {value:?}")]
    LogFormat {
        /// Whose value it is.
        origin: Origin,
        /// The value.
        value: String,
    },
    /// No token. It is a secret, so it is not shown.
    #[error("{origin} {why}")]
    Token {
        /// Whose value it is.
        origin: Origin,
        /// The fault.
        why: TokenError,
    },
    /// No list of hosts.
    #[error("{origin} must be hosts, with or without a port, separated by commas, got {value:?}")]
    AllowHost {
        /// Whose value it is.
        origin: Origin,
        /// The value.
        value: String,
    },
    /// No list of origins.
    #[error(
        "{origin} must be origins as browsers write them, such as https://example.org, null or file://, separated by \
         commas, got {value:?}"
    )]
    AllowOrigin {
        /// Whose value it is.
        origin: Origin,
        /// The value.
        value: String,
    },
    /// Neither on nor off.
    #[error("{origin} must be true or false, got {value:?}")]
    Switch {
        /// Whose value it is.
        origin: Origin,
        /// The value.
        value: String,
    },
}
