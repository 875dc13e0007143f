//! The first bytes of a connection, which show whether it sends JSON or another protocol.
//!
//! **Invariant:** a connection that starts like HTTP, TLS or BSON is never read as JSON. Otherwise a web page could
//! drive the arm by an HTTP POST.

/// The protocol of a connection, by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Opening {
    /// Undecided: wait for more bytes (at most eight are needed).
    Undecided,
    /// JSON, to be read here.
    Json,
    /// Another protocol: send one line, close, and parse nothing.
    Foreign(Foreign),
}

/// Protocols that must never be read as JSON.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Foreign {
    /// An HTTP request line.
    Http,
    /// A TLS hello.
    Tls,
    /// BSON, as some C++ rosbridge clients send.
    Bson,
}

impl Foreign {
    /// One line for the status: the recognised protocol, and what to use instead.
    #[must_use]
    pub const fn explanation(self) -> &'static str {
        match self {
            Self::Http => {
                "this is an HTTP request that this port does not serve: it speaks rosbridge JSON, one object per line"
            }
            Self::Tls => {
                "this is a TLS hello, and this port speaks rosbridge JSON without TLS: no https:// and no wss://"
            }
            Self::Bson => "this is BSON, and this port speaks rosbridge JSON, one object per line",
        }
    }
}

/// The first bytes of HTTP requests.
const METHODS: [&[u8]; 10] = [
    b"GET ",
    b"HEAD ",
    b"POST ",
    b"PUT ",
    b"DELETE ",
    b"CONNECT ",
    b"OPTIONS ",
    b"TRACE ",
    b"PATCH ",
    b"PRI ",
];
/// The first bytes of a TLS record with a hello.
const TLS_HELLO: &[u8] = &[0x16, 0x03];
/// A BSON document begins with its length in four bytes, little-endian. Below 16 MiB one of them is 0.
const BSON_LENGTH: usize = 4;

/// Determines the protocol from all bytes sent so far.
///
/// At the end of the stream an undecided start counts as JSON.
#[must_use]
pub fn opening(first: &[u8]) -> Opening {
    if first.starts_with(TLS_HELLO) {
        return Opening::Foreign(Foreign::Tls);
    }
    if first.iter().take(BSON_LENGTH).any(|&byte| byte == 0) {
        return Opening::Foreign(Foreign::Bson);
    }
    if METHODS.iter().any(|method| first.starts_with(method)) {
        return Opening::Foreign(Foreign::Http);
    }
    let method_may_follow = METHODS.iter().any(|method| method.starts_with(first));
    let nul_may_follow = first.len() < BSON_LENGTH && !holds_a_line(first);
    if method_may_follow || nul_may_follow {
        Opening::Undecided
    } else {
        Opening::Json
    }
}

/// Whether a malformed line is a header that every browser sends. `start` is the beginning of the line.
///
/// A page may choose the method of a request to its own server, and a hostile name server can direct this request here.
/// The method may then be outside `METHODS`, but the head still precedes the body and has a `Host` line.
#[must_use]
pub fn is_host_line(start: &str) -> bool {
    let name = start.split(':').next().unwrap_or_default();
    name.len() < start.len() && name.eq_ignore_ascii_case("host")
}

/// Whether a line with text is complete. Such a line is answered without waiting for a fourth byte.
fn holds_a_line(bytes: &[u8]) -> bool {
    bytes.trim_ascii_start().contains(&b'\n')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_host_line_is_one_in_any_case_and_with_any_value() {
        for line in ["Host: a", "host:a", "HOST:", "Host: a:1"] {
            assert!(is_host_line(line), "{line}");
        }
        for line in [
            "",
            "Host",
            "Hosts: a",
            "X-Host: a",
            "host a:1",
            " Host: a",
            ":host",
        ] {
            assert!(!is_host_line(line), "{line}");
        }
    }
}
