//! The rules of admission: `Host`, `Origin` and the token.
//!
//! Any web page can make its visitor's browser send requests to this port, but it cannot choose two headers. `Host` is
//! the name that the browser looked up. It is a foreign name if a hostile name server points one here. `Origin` is the
//! origin of the page that opens a WebSocket. Programs can send any headers, and could use raw TCP as well.
//!
//! **Invariant:** a request that no rule allows is refused. The text names the rule or the option.

use std::net::SocketAddr;

use clap::Args;
use hyper::StatusCode;
use hyper::header::ALLOW;

use super::head::RequestHead;
use super::response::{HttpResponse, set, text};
use crate::address::{Authority, HTTP_PORT, HTTPS_PORT, Host};
use crate::protocol::op::token::Token;
use crate::protocol::wire::text::shortened;
use crate::value::{ValueReader, needed};

/// Most characters of a header in a refusal.
const MAX_SHOWN: usize = 80;

/// The rules, with their options.
#[derive(Debug, Clone, Default, PartialEq, Eq, Args)]
pub struct Access {
    /// The required token, if there is one. It is an option of the whole server.
    #[arg(skip)]
    pub token: Option<Token>,
    /// Other host names for browsers, separated by commas; a name with a port is allowed only at that port
    #[arg(long = "allow-host", env = "ARM_SIM_ALLOW_HOST", value_name = "HOSTS")]
    #[arg(value_delimiter = ',', value_parser = ValueReader(read_host))]
    pub hosts: Vec<Authority>,
    /// Origins of other machines' pages that may open a WebSocket, separated by commas
    #[arg(
        long = "allow-origin",
        env = "ARM_SIM_ALLOW_ORIGIN",
        value_name = "ORIGINS"
    )]
    #[arg(value_delimiter = ',', value_parser = ValueReader(read_origin))]
    pub origins: Vec<Box<str>>,
    /// Allow a WebSocket only to the runtime's own page and to --allow-origin, as with a token
    #[arg(long, env = "ARM_SIM_STRICT_ORIGIN", value_name = "BOOL")]
    #[arg(default_value = "false")]
    #[arg(action = clap::ArgAction::Set, num_args = 0..=1, require_equals = true, default_missing_value = "true")]
    #[arg(value_parser = ValueReader(|text| needed(text.parse::<bool>().ok(), "true or false", text)))]
    pub strict_origin: bool,
}

fn read_host(text: &str) -> Result<Authority, String> {
    let needs = "host names, with or without a port, separated by commas";
    needed(Authority::parse(text.trim()), needs, text)
}

pub(crate) fn read_origin(text: &str) -> Result<Box<str>, String> {
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
    // A browser leaves out the default port.
    let usual = [("http://", HTTP_PORT), ("https://", HTTPS_PORT)].into_iter();
    let mut usual = usual.filter(|(scheme, _)| origin.starts_with(scheme));
    let bare = usual.find_map(|(_, port)| origin.strip_suffix(&format!(":{port}")));
    let origin = bare.unwrap_or(&origin);
    needed(is_origin.then(|| origin.into()), needs, text)
}

/// Why a request is refused, and the connection closed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AccessError {
    /// An authority, or `*`.
    #[error("this is not a well-formed HTTP request: its target must begin with a slash")]
    Target,
    /// Another method.
    #[error("only GET and HEAD are answered here")]
    Method,
    /// A request with a body. Readers may disagree about its end, so a second request could be hidden in it.
    #[error("a request must not have a body here")]
    Body,
    /// The request has no `Host` header, or several.
    #[error("the request must have one Host header")]
    NoHost,
    /// A foreign name.
    #[error(
        "this runtime does not answer to the host {host:?}: it could be another site's name that points here. Ask for \
         http://localhost:{port}/, or start pendularm with --allow-host and that name (without a port, to allow \
         every port)"
    )]
    Host {
        /// The host in the request.
        host: String,
        /// The runtime's port.
        port: u16,
    },
    /// A page that may not open a WebSocket.
    #[error(
        "a page of the origin {0:?} may not open a WebSocket here: it could drive the arm without your knowledge. \
         If it may, start pendularm with --allow-origin and that origin"
    )]
    Origin(String),
    /// The token is missing.
    #[error("this runtime requires a token: add ?token=... to the address once")]
    NoToken,
    /// Another token.
    #[error(
        "the token is not this runtime's: add ?token=... with the right one to the address once"
    )]
    WrongToken,
}

impl AccessError {
    /// The answer.
    #[must_use]
    pub fn response(&self) -> HttpResponse {
        let status = match self {
            Self::Target | Self::Body | Self::NoHost => StatusCode::BAD_REQUEST,
            Self::Method => StatusCode::METHOD_NOT_ALLOWED,
            Self::Host { .. } | Self::Origin(_) | Self::NoToken | Self::WrongToken => {
                StatusCode::FORBIDDEN
            }
        };
        let mut response = text(status, &self.to_string());
        if *self == Self::Method {
            set(&mut response, ALLOW, "GET, HEAD");
        }
        response
    }
}

impl Access {
    /// The host of the request, if it is this runtime. `local` is the address that the client has connected to.
    ///
    /// # Errors
    /// [`AccessError::NoHost`] and [`AccessError::Host`].
    pub fn host(&self, request: &RequestHead, local: SocketAddr) -> Result<Authority, AccessError> {
        let text = request.one("host").ok_or(AccessError::NoHost)?;
        let bound = Host::Address(local.ip().to_canonical());
        let is_named = |asked: &Authority| self.hosts.iter().any(|one| one.allows(asked));
        // Name servers have no effect on the first two. Their port may be that of a proxy or of a tunnel.
        let authority = Authority::parse(&text)
            .filter(|asked| asked.host.is_loopback() || asked.host == bound || is_named(asked));
        authority.ok_or_else(|| AccessError::Host {
            host: shortened(&text, MAX_SHOWN),
            port: local.port(),
        })
    }

    /// Whether the page may open a WebSocket. `own` is the host of the request. A request without `Origin` is not
    /// from a browser.
    ///
    /// # Errors
    /// [`AccessError::Origin`].
    pub fn origin(&self, request: &RequestHead, own: &Authority) -> Result<(), AccessError> {
        if !request.0.headers.contains_key("origin") {
            return Ok(());
        }
        let text = request.one("origin").unwrap_or("more than one".into());
        let lower = text.to_ascii_lowercase();
        let over_http = lower.strip_prefix("http://").and_then(Authority::parse);
        let is_own = over_http
            .as_ref()
            .is_some_and(|page| page.host == own.host && page.http_port() == own.http_port());
        let is_local = over_http.is_some_and(|page| page.host.is_loopback());
        let is_named = self.origins.iter().any(|named| **named == lower);
        // A browser sends the token's cookie from pages at every port of the host.
        let is_strict = self.strict_origin || self.token.is_some();
        if is_own || is_named || (is_local && !is_strict) {
            return Ok(());
        }
        Err(AccessError::Origin(shortened(&text, MAX_SHOWN)))
    }

    /// Checks the token in the query or the cookie of the request. Returns `true` if it is in the query: the answer
    /// then sets a cookie.
    ///
    /// # Errors
    /// [`AccessError::NoToken`] and [`AccessError::WrongToken`].
    pub fn token(&self, request: &RequestHead, local: SocketAddr) -> Result<bool, AccessError> {
        let Some(token) = &self.token else {
            return Ok(false);
        };
        let in_query = request.query("token");
        let is_in_query = in_query.is_some();
        match in_query.or_else(|| request.cookie(&cookie_name(local.port()))) {
            Some(shown) if token.matches(&shown) => Ok(is_in_query),
            Some(_) => Err(AccessError::WrongToken),
            None => Err(AccessError::NoToken),
        }
    }

    /// The header line that sets the token's cookie. Scripts cannot read it, and requests from other sites
    /// do not send it.
    #[must_use]
    pub fn cookie(&self, local: SocketAddr) -> Option<String> {
        let token = self.token.as_ref()?;
        let name = cookie_name(local.port());
        // Some characters of a token are not allowed in a cookie.
        let bytes = token.reveal().bytes();
        let value: String = bytes.map(|byte| format!("%{byte:02X}")).collect();
        Some(format!("{name}={value}; Path=/; HttpOnly; SameSite=Strict"))
    }
}

/// Browsers store cookies by host, not by port, so the name distinguishes two runtimes on one machine.
fn cookie_name(port: u16) -> String {
    format!("pendularm_{port}")
}
