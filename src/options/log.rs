//! The options of the log: down to which level, and in which format.
//!
//! **Invariant:** a level has one name, that of `tracing`.

use tracing::level_filters::LevelFilter;

use super::setting::{Given, LaunchOption};
use super::usage::UsageError;
use crate::logging::LogFormat;

/// The log levels by name, from silent to everything.
const LEVELS: [(&str, LevelFilter); 6] = [
    ("off", LevelFilter::OFF),
    ("error", LevelFilter::ERROR),
    ("warn", LevelFilter::WARN),
    ("info", LevelFilter::INFO),
    ("debug", LevelFilter::DEBUG),
    ("trace", LevelFilter::TRACE),
];

pub(super) const LOG: LaunchOption = LaunchOption {
    option: "log",
    variable: "ARM_SIM_LOG",
    value: "LEVEL",
    about: "What is logged to standard error: off, error, warn, info, debug or trace",
    default: "info",
    is_switch: false,
};

pub(super) const LOG_FORMAT: LaunchOption = LaunchOption {
    option: "log-format",
    variable: "ARM_SIM_LOG_FORMAT",
    value: "FORMAT",
    about: "How it is logged: text, or json for one object a line",
    default: "text",
    is_switch: false,
};

pub(super) fn read_level(Given { origin, value }: Given) -> Result<LevelFilter, UsageError> {
    let known = LEVELS.iter().find(|(name, _)| *name == value);
    known
        .map(|(_, level)| *level)
        .ok_or(UsageError::Log { origin, value })
}

pub(super) fn read_format(Given { origin, value }: Given) -> Result<LogFormat, UsageError> {
    match value.as_str() {
        "text" => Ok(LogFormat::Text),
        "json" => Ok(LogFormat::Json),
        _ => Err(UsageError::LogFormat { origin, value }),
    }
}
