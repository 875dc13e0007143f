//! Addresses as people type them (a port, a host, both, or a URL), and hosts with ports as in the `Host` and `Origin`
//! headers.
//!
//! **Invariant:** no name is looked up here. Two spellings of the same host are equal values. Case, the brackets of IPv6
//! and a default port make no difference.

use std::fmt;
use std::net::{IpAddr, Ipv6Addr};

/// The port where none is given.
const PORT: u16 = 9095;
/// The host where none is given.
const HOST: &str = "127.0.0.1";
/// The schemes of a URL that can be meant. TLS is for a proxy.
const SCHEMES: [&str; 3] = ["ws", "http", "tcp"];

/// Longest name of a host that DNS allows, in bytes.
const MAX_NAME: usize = 253;
/// The default port of `http`.
pub const HTTP_PORT: u16 = 80;
/// The default port of `https`, which a proxy may use.
pub const HTTPS_PORT: u16 = 443;

/// Reads an address or a URL as `host:port`, the host in lower case. A URL's path is left out.
#[must_use]
pub fn read_url(text: &str) -> Option<String> {
    let rest = match text.split_once("://") {
        Some((scheme, rest)) if SCHEMES.iter().any(|one| one.eq_ignore_ascii_case(scheme)) => rest,
        Some(_) => return None,
        None => text,
    };
    read(rest.split(['/', '?', '#']).next()?)
}

/// Reads a port, a host or both as `host:port`, the host in lower case.
#[must_use]
pub fn read(text: &str) -> Option<String> {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|one| one.is_ascii_digit());
    if let Ok(address) = text.parse::<Ipv6Addr>() {
        // Without brackets, `::1:9095` may be an address, or another one with a port.
        let (rest, _) = text.rsplit_once(':')?;
        return match rest.parse::<Ipv6Addr>() {
            Ok(_) => None,
            Err(_) => Some(format!("[{address}]:{PORT}")),
        };
    }
    let (host, port) = match text.rsplit_once(':') {
        Some((host, port)) if is_number(port) => (host, port.parse().ok()?),
        _ if is_number(text) => ("", text.parse().ok()?),
        _ if text.is_empty() => return None,
        _ => (text, PORT),
    };
    let host = Host::parse(if host.is_empty() { HOST } else { host })?;
    Some(format!("{host}:{port}"))
}

/// A host: a name, or an address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Host {
    /// A name, in lower case.
    Name(Box<str>),
    /// An address.
    Address(IpAddr),
}

impl Host {
    /// Reads a name or an address, IPv6 in brackets; letters, digits, `-`, `_` and `.` only.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        if let Some(inner) = text.strip_prefix('[') {
            let address: Ipv6Addr = inner.strip_suffix(']')?.parse().ok()?;
            return Some(Self::Address(address.into()));
        }
        if let Ok(address) = text.parse::<std::net::Ipv4Addr>() {
            return Some(Self::Address(address.into()));
        }
        let plain = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_' | b'.');
        let is_name = (1..=MAX_NAME).contains(&text.len()) && text.bytes().all(plain);
        is_name.then(|| Self::Name(text.to_ascii_lowercase().into()))
    }

    /// The host's text without a final full stop, which does not change the name.
    fn bare(&self) -> String {
        let text = self.to_string();
        text.strip_suffix('.').unwrap_or(&text).to_owned()
    }

    /// Whether the name means this machine, independent of any name server.
    #[must_use]
    pub fn is_loopback(&self) -> bool {
        match self {
            Self::Name(name) => &**name == "localhost",
            Self::Address(address) => address.is_loopback(),
        }
    }
}

impl fmt::Display for Host {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name(name) => f.write_str(name),
            Self::Address(IpAddr::V4(address)) => address.fmt(f),
            Self::Address(IpAddr::V6(address)) => write!(f, "[{address}]"),
        }
    }
}

/// A host with an optional port: `arm.example:9095`, `127.0.0.1`, `[::1]:9095`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Authority {
    /// The host.
    pub host: Host,
    /// The port, if one is written.
    pub port: Option<u16>,
}

impl Authority {
    /// Reads a host with or without a port.
    #[must_use]
    pub fn parse(text: &str) -> Option<Self> {
        let (host, port) = match text.rsplit_once(':') {
            // The last colon of `[::1]` does not begin a port.
            Some((host, port)) if !port.ends_with(']') => {
                // `parse` also accepts a plus sign.
                let is_number = port.bytes().all(|byte| byte.is_ascii_digit());
                (host, Some(port.parse().ok().filter(|_| is_number)?))
            }
            _ => (text, None),
        };
        let host = Host::parse(host)?;
        Some(Self { host, port })
    }

    /// Whether this entry of an option allows `asked`. Without a port it allows every port.
    #[must_use]
    pub fn allows(&self, asked: &Self) -> bool {
        let is_default = |port| asked.port.is_none() && [HTTP_PORT, HTTPS_PORT].contains(&port);
        let has_port = |port| asked.port == Some(port) || is_default(port);
        self.host.bare() == asked.host.bare() && self.port.is_none_or(has_port)
    }

    /// The port, or the default one of `http`.
    #[must_use]
    pub fn http_port(&self) -> u16 {
        self.port.unwrap_or(HTTP_PORT)
    }
}

impl fmt::Display for Authority {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.port {
            Some(port) => write!(f, "{}:{port}", self.host),
            None => self.host.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_a_host_both_and_a_url_are_addresses() {
        for (text, address) in [
            ("9096", "127.0.0.1:9096"),
            (":9096", "127.0.0.1:9096"),
            ("127.0.0.1", "127.0.0.1:9095"),
            ("LocalHost:80", "localhost:80"),
            ("[::1]", "[::1]:9095"),
            ("::1", "[::1]:9095"),
            ("ws://::1/", "[::1]:9095"),
            ("FE80::1", "[fe80::1]:9095"),
            ("[::1]:9096/", "[::1]:9096"),
            ("ws://127.0.0.1:9096/", "127.0.0.1:9096"),
            ("http://arm.example?token=secret", "arm.example:9095"),
            ("tcp://:9096", "127.0.0.1:9096"),
        ] {
            assert_eq!(read_url(text).as_deref(), Some(address), "{text}");
        }
        for text in [
            "",
            "/",
            ":",
            "65536",
            "localhost:",
            "localhost:x",
            "localhost:+80",
            "::1:9095",
            "fe80::1:2",
            "[::1",
            "[::g]:80",
            "https://a:80",
            "ws://",
            "user@host:80",
            "a b:80",
            "a:1:2",
        ] {
            assert_eq!(read_url(text), None, "{text}");
        }
    }
}
