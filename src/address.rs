//! Addresses as people type them: a port, a host, both, or a URL.
//!
//! **Invariant:** no name is looked up here.

use std::net::Ipv6Addr;

/// The port where none is given.
const PORT: u16 = 9095;
/// The host where none is given.
const HOST: &str = "127.0.0.1";
/// The schemes of a URL that can be meant. TLS is for a proxy.
const SCHEMES: [&str; 3] = ["ws", "http", "tcp"];

/// Reads an address as `host:port`, the host in lower case; a URL's path is left out.
#[must_use]
pub fn read(text: &str) -> Option<String> {
    let text = text.to_ascii_lowercase();
    let rest = match text.split_once("://") {
        Some((scheme, rest)) if SCHEMES.contains(&scheme) => rest,
        Some(_) => return None,
        None => &text,
    };
    let authority = rest.split(['/', '?', '#']).next()?;
    if let Ok(address) = authority.parse::<Ipv6Addr>() {
        return Some(format!("[{address}]:{PORT}"));
    }
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|one| one.is_ascii_digit());
    let (host, port) = match authority.rsplit_once(':') {
        Some((host, port)) if is_number(port) => (host, port.parse().ok()?),
        _ if is_number(authority) => ("", authority.parse().ok()?),
        _ if authority.is_empty() => return None,
        _ => (authority, PORT),
    };
    let host = if host.is_empty() { HOST } else { host };
    let address = host
        .strip_prefix('[')
        .and_then(|host| host.strip_suffix(']'));
    let valid = match address {
        Some(address) => address.parse::<Ipv6Addr>().is_ok(),
        None => host
            .chars()
            .all(|one| one.is_alphanumeric() || "-_.".contains(one)),
    };
    valid.then(|| format!("{host}:{port}"))
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
            ("::1", "[::1]:9095"),
            ("[::1]", "[::1]:9095"),
            ("[::1]:9096/", "[::1]:9096"),
            ("ws://127.0.0.1:9096/", "127.0.0.1:9096"),
            ("http://arm.example?token=secret", "arm.example:9095"),
            ("tcp://:9096", "127.0.0.1:9096"),
        ] {
            assert_eq!(read(text).as_deref(), Some(address), "{text}");
        }
        for text in [
            "",
            "/",
            ":",
            "65536",
            "localhost:",
            "localhost:x",
            "localhost:+80",
            "[::1",
            "[::g]:80",
            "https://a:80",
            "ws://",
            "user@host:80",
            "a b:80",
            "a:1:2",
        ] {
            assert_eq!(read(text), None, "{text}");
        }
    }
}
