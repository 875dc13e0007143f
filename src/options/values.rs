//! The values of the options, each read from its text.
//!
//! **Invariant:** a value that is refused is named with the option or variable that it came from.

use std::net::SocketAddr;

use tracing::level_filters::LevelFilter;

use super::links::Links;
use super::setting::Given;
use super::usage::UsageError;
use crate::logging::LogFormat;
use crate::protocol::op::token::Token;

/// The log levels by name, from silent to everything.
const LEVELS: [(&str, LevelFilter); 6] = [
    ("off", LevelFilter::OFF),
    ("error", LevelFilter::ERROR),
    ("warn", LevelFilter::WARN),
    ("info", LevelFilter::INFO),
    ("debug", LevelFilter::DEBUG),
    ("trace", LevelFilter::TRACE),
];

pub(super) fn read_links(Given { origin, value }: Given) -> Result<Links, UsageError> {
    match value.as_str() {
        "2" => Ok(Links::Two),
        "3" => Ok(Links::Three),
        _ => Err(UsageError::Links { origin, value }),
    }
}

pub(super) fn read_token(Given { origin, value }: Given) -> Result<Token, UsageError> {
    Token::new(&value).map_err(|why| UsageError::Token { origin, why })
}

/// With a token to ask for, any address will do.
pub(super) fn read_bind(
    Given { origin, value }: Given,
    has_token: bool,
) -> Result<SocketAddr, UsageError> {
    match value.parse::<SocketAddr>() {
        Ok(address) if address.ip().is_loopback() || has_token => Ok(address),
        Ok(_) => Err(UsageError::NotLoopback { origin, value }),
        Err(_) => Err(UsageError::Bind { origin, value }),
    }
}

pub(super) fn read_seed(Given { origin, value }: Given) -> Result<u64, UsageError> {
    value
        .parse()
        .map_err(|_| UsageError::Seed { origin, value })
}

pub(super) fn read_log(Given { origin, value }: Given) -> Result<LevelFilter, UsageError> {
    let known = LEVELS.iter().find(|(name, _)| *name == value);
    known
        .map(|(_, level)| *level)
        .ok_or(UsageError::Log { origin, value })
}

pub(super) fn read_log_format(Given { origin, value }: Given) -> Result<LogFormat, UsageError> {
    match value.as_str() {
        "text" => Ok(LogFormat::Text),
        "json" => Ok(LogFormat::Json),
        _ => Err(UsageError::LogFormat { origin, value }),
    }
}
