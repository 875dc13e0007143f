//! The values of the options, each read from its text.
//!
//! **Invariant:** a value that is refused is named with the option or variable that it came from.

use std::net::SocketAddr;

use super::links::Links;
use super::setting::Given;
use super::usage::UsageError;
use crate::protocol::op::token::Token;

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
