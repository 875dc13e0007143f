//! Who may ask: the rules for `Host`, `Origin` and the token.
//!
//! A page from anywhere can make its visitor's browser send requests to this port. It cannot choose two headers: `Host`
//! tells under which name the browser looked for us (not ours where a hostile name server points a foreign name here),
//! and `Origin` whose page opens a WebSocket. Programs send what they like there, and could use the raw port as well.
//!
//! **Invariant:** what is not allowed by a rule is refused, with a text that names the rule or the option.

use std::net::SocketAddr;

use super::authority::{Authority, Host};
use super::head::RequestHead;
use crate::protocol::op::token::Token;
use crate::protocol::wire::text::push_plain;

/// Characters of a header that a refusal repeats.
const MAX_SHOWN: usize = 80;

/// The rules.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Access {
    /// The token that has to be shown, if there is one.
    pub token: Option<Token>,
    /// Names that `Host` may have besides loopback's; without a port, ours is meant.
    pub hosts: Vec<Authority>,
    /// Pages that may open a WebSocket besides loopback's, as `Origin` writes them, in lower case.
    pub origins: Vec<Box<str>>,
    /// Only our own pages may, and those named; so it is with a token, too.
    pub strict_origin: bool,
}

/// Why a request is refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AccessError {
    /// The request does not say which host it looks for.
    #[error("the request must have one Host header")]
    NoHost,
    /// A name that is not ours.
    #[error(
        "this runtime does not answer to the host {host:?}: it could be another site's name that points here. Ask for \
         http://localhost:{port}/, or start the runtime with --allow-host and that name"
    )]
    Host {
        /// The host that the request names.
        host: String,
        /// Our port.
        port: u16,
    },
    /// A page that may not open a WebSocket.
    #[error(
        "a page of the origin {0:?} may not open a WebSocket here: it could drive the arm without your knowledge. \
         If it may, start the runtime with --allow-origin and that origin"
    )]
    Origin(String),
    /// The token is missing.
    #[error("this runtime asks for its token: add ?token=... to the address, once")]
    NoToken,
    /// Another token.
    #[error(
        "the token is not this runtime's: add ?token=... with the right one to the address, once"
    )]
    WrongToken,
}

impl Access {
    /// The host that the request looks for, if it is ours; `local` is the address that the client has connected to.
    ///
    /// # Errors
    /// [`AccessError::NoHost`] and [`AccessError::Host`].
    pub fn host(&self, request: &RequestHead, local: SocketAddr) -> Result<Authority, AccessError> {
        let text = request.one("host").ok_or(AccessError::NoHost)?;
        let authority = Authority::parse(text).filter(|host| self.is_ours(host, local));
        authority.ok_or_else(|| AccessError::Host {
            host: shown(text),
            port: local.port(),
        })
    }

    fn is_ours(&self, asked: &Authority, local: SocketAddr) -> bool {
        let port = asked.http_port();
        let bound = Host::Address(local.ip().to_canonical());
        if (asked.host.is_loopback() || asked.host == bound) && port == local.port() {
            return true;
        }
        self.hosts
            .iter()
            .any(|one| one.host == asked.host && one.port.unwrap_or(local.port()) == port)
    }

    /// Whether the page that opens a WebSocket may do so; `own` is the host that the request looks for. Without an
    /// `Origin` it is not a browser that asks.
    ///
    /// # Errors
    /// [`AccessError::Origin`].
    pub fn origin(&self, request: &RequestHead, own: &Authority) -> Result<(), AccessError> {
        if request.count("origin") == 0 {
            return Ok(());
        }
        let text = request.one("origin").unwrap_or("more than one");
        let lower = text.to_ascii_lowercase();
        let over_http = lower.strip_prefix("http://").and_then(Authority::parse);
        let is_own = over_http
            .as_ref()
            .is_some_and(|page| page.host == own.host && page.http_port() == own.http_port());
        let is_local = over_http.is_some_and(|page| page.host.is_loopback());
        let is_named = self.origins.iter().any(|named| **named == lower);
        // A browser sends the token's cookie along from every port of its host.
        let is_strict = self.strict_origin || self.token.is_some();
        if is_own || is_named || (is_local && !is_strict) {
            Ok(())
        } else {
            Err(AccessError::Origin(shown(text)))
        }
    }

    /// Whether the request shows the token, in its query or its cookie. True if it did so in the query: a cookie is
    /// due.
    ///
    /// # Errors
    /// [`AccessError::NoToken`] and [`AccessError::WrongToken`].
    pub fn token(&self, request: &RequestHead, local: SocketAddr) -> Result<bool, AccessError> {
        let Some(token) = &self.token else {
            return Ok(false);
        };
        if let Some(shown) = request.query("token") {
            return if token.matches(&shown) {
                Ok(true)
            } else {
                Err(AccessError::WrongToken)
            };
        }
        match request.cookie(&cookie_name(local.port())) {
            Some(shown) if token.matches(&shown) => Ok(false),
            Some(_) => Err(AccessError::WrongToken),
            None => Err(AccessError::NoToken),
        }
    }

    /// The header line that lets a browser show the token from now on: not to scripts, not from other sites.
    #[must_use]
    pub fn cookie(&self, local: SocketAddr) -> Option<String> {
        let token = self.token.as_ref()?;
        let name = cookie_name(local.port());
        let value = encode(token.reveal());
        Some(format!("{name}={value}; Path=/; HttpOnly; SameSite=Strict"))
    }
}

/// Browsers keep cookies by host, not by port: the name tells two runtimes on one machine apart.
fn cookie_name(port: u16) -> String {
    format!("pendularm_{port}")
}

/// Everything but letters, digits, `-`, `_` and `.` as `%` and two digits.
fn encode(text: &str) -> String {
    let mut encoded = String::with_capacity(text.len());
    for byte in text.bytes() {
        if byte.is_ascii_alphanumeric() || matches!(byte, b'-' | b'_' | b'.') {
            encoded.push(char::from(byte));
        } else {
            encoded.push_str(&format!("%{byte:02X}"));
        }
    }
    encoded
}

/// Returns the part of a header that is repeated to its sender.
fn shown(text: &str) -> String {
    let mut shown = String::new();
    for character in text.chars().take(MAX_SHOWN) {
        push_plain(&mut shown, character);
    }
    shown
}
