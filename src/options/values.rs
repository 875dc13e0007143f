//! The readers of the options' values.
//!
//! **Invariant:** a refusal names the valid values and shows the given one, unless it is a secret.

use std::net::{Ipv4Addr, SocketAddr};

use tracing::level_filters::LevelFilter;

use crate::address;
use crate::logging::LogFormat;
use crate::protocol::limits::MAX_CLIENTS;
use crate::protocol::op::token::Token;
use crate::value::{needed, one_of, within};
#[cfg(feature = "web")]
use crate::web::authority::Authority;

pub(super) fn read_bind(text: &str) -> Result<SocketAddr, String> {
    let address = address::read(text).and_then(|text| match text.strip_prefix("localhost:") {
        Some(port) => Some(SocketAddr::from((Ipv4Addr::LOCALHOST, port.parse().ok()?))),
        None => text.parse().ok(),
    });
    let needs = "localhost or an IP address, a port, or both, such as 127.0.0.1:9095 or [::1]:9095";
    needed(address, needs, text)
}

pub(super) fn read_clients(text: &str) -> Result<usize, String> {
    within(&(1..=MAX_CLIENTS), "a whole number", text)
}

pub(super) fn read_period(text: &str) -> Result<f64, String> {
    let period = text.parse().ok();
    let period = period.filter(|period: &f64| period.is_finite() && *period >= 0.0);
    needed(period, "a time in seconds, at least 0", text)
}

pub(super) fn read_seed(text: &str) -> Result<u64, String> {
    within(&(0..=u64::MAX), "a whole number", text)
}

pub(super) fn read_level(text: &str) -> Result<LevelFilter, String> {
    let levels = [
        ("off", LevelFilter::OFF),
        ("error", LevelFilter::ERROR),
        ("warn", LevelFilter::WARN),
        ("info", LevelFilter::INFO),
        ("debug", LevelFilter::DEBUG),
        ("trace", LevelFilter::TRACE),
    ];
    one_of(&levels, text)
}

pub(super) fn read_log_format(text: &str) -> Result<LogFormat, String> {
    let formats = [("text", LogFormat::Text), ("json", LogFormat::Json)];
    one_of(&formats, text)
}

/// A token is a secret, so a refusal does not show it.
pub(super) fn read_token(text: &str) -> Result<Token, String> {
    Token::new(text).map_err(|why| why.to_string())
}

#[cfg(feature = "web")]
pub(super) fn read_host(text: &str) -> Result<Authority, String> {
    let needs = "host names, with or without a port, separated by commas";
    needed(Authority::parse(text.trim()), needs, text)
}

#[cfg(feature = "web")]
pub(super) fn read_origin(text: &str) -> Result<Box<str>, String> {
    let origin = text.trim().to_ascii_lowercase();
    let in_scheme = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-' | b'.');
    let is_origin = match origin.split_once("://") {
        Some(("file", "")) => true,
        Some((scheme, host)) => {
            !scheme.is_empty() && scheme.bytes().all(in_scheme) && Authority::parse(host).is_some()
        }
        None => origin == "null",
    };
    let needs = "origins, such as https://example.org, null or file://, separated by commas";
    needed(is_origin.then(|| origin.into()), needs, text)
}

/// The origin of a page that may show this one in a frame. A browser compares scheme, host and port, so it needs a
/// host.
#[cfg(feature = "web")]
pub(super) fn read_frame(text: &str) -> Result<Box<str>, String> {
    let origin = text.trim().to_ascii_lowercase();
    let host = ["http://", "https://"]
        .iter()
        .find_map(|scheme| origin.strip_prefix(scheme));
    let is_page = host.and_then(Authority::parse).is_some();
    let needs = "origins of web pages, such as https://example.org, separated by commas";
    needed(is_page.then(|| origin.into()), needs, text)
}

#[cfg(feature = "web")]
pub(super) fn read_switch(text: &str) -> Result<bool, String> {
    let switch = match text {
        "true" | "1" | "yes" | "on" => Some(true),
        "false" | "0" | "no" | "off" => Some(false),
        _ => None,
    };
    needed(switch, "true or false", text)
}
