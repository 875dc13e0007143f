//! Answers over HTTP, each with the headers that keep a browser strict.
//!
//! **Invariant:** no byte of a request becomes part of a header; what a text repeats of one is plain text, and labelled
//! so.

use std::borrow::Cow;
use std::fmt::Write;

/// A status code and its phrase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HttpStatus {
    /// Here it is.
    Ok,
    /// It is elsewhere.
    MovedPermanently,
    /// The request is not as it has to be.
    BadRequest,
    /// The request may not have that.
    Forbidden,
    /// There is no such thing.
    NotFound,
    /// Another method than GET.
    MethodNotAllowed,
    /// The head took too long.
    RequestTimeout,
    /// A WebSocket of another version.
    UpgradeRequired,
    /// The head is too long.
    HeadTooLong,
    /// Too many requests at once.
    Unavailable,
}

impl HttpStatus {
    const fn line(self) -> &'static str {
        match self {
            Self::Ok => "200 OK",
            Self::MovedPermanently => "301 Moved Permanently",
            Self::BadRequest => "400 Bad Request",
            Self::Forbidden => "403 Forbidden",
            Self::NotFound => "404 Not Found",
            Self::MethodNotAllowed => "405 Method Not Allowed",
            Self::RequestTimeout => "408 Request Timeout",
            Self::UpgradeRequired => "426 Upgrade Required",
            Self::HeadTooLong => "431 Request Header Fields Too Large",
            Self::Unavailable => "503 Service Unavailable",
        }
    }
}

/// An answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HttpResponse {
    status: HttpStatus,
    kind: &'static str,
    policy: Cow<'static, str>,
    /// How long a browser may keep it.
    cache: &'static str,
    /// Headers besides those that every answer has.
    headers: Vec<(&'static str, String)>,
    body: Cow<'static, [u8]>,
}

/// The policy of a text in a browser, which may do nothing.
const NOTHING: &str = "default-src 'none'; frame-ancestors 'none'";

/// Never: the next time it may be another.
const NOT_KEPT: &str = "no-store";
/// For ever, by that browser alone: its name stands for what is in it.
const KEPT: &str = "private, max-age=31536000, immutable";

impl HttpResponse {
    /// A file, and what it may do in a browser.
    #[must_use]
    pub fn file(
        kind: &'static str,
        policy: impl Into<Cow<'static, str>>,
        body: impl Into<Cow<'static, [u8]>>,
    ) -> Self {
        Self {
            status: HttpStatus::Ok,
            kind,
            policy: policy.into(),
            cache: NOT_KEPT,
            headers: Vec::new(),
            body: body.into(),
        }
    }

    /// A sentence to whoever asked.
    #[must_use]
    pub fn text(status: HttpStatus, sentence: &str) -> Self {
        Self {
            status,
            kind: "text/plain; charset=utf-8",
            policy: NOTHING.into(),
            cache: NOT_KEPT,
            headers: Vec::new(),
            body: format!("{sentence}\n").into_bytes().into(),
        }
    }

    /// The same with one more header, whose value is ours.
    #[must_use]
    pub fn with(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.headers.push((name, value.into()));
        self
    }

    /// The same, to be kept for ever: what is at that path never changes.
    #[must_use]
    pub fn kept(mut self) -> Self {
        self.cache = KEPT;
        self
    }

    /// The same with `body`, its own body packed by `deflate`.
    #[must_use]
    pub fn packed(mut self, body: &'static [u8]) -> Self {
        self.body = body.into();
        self.with("Content-Encoding", "deflate")
    }

    /// The sentence.
    #[must_use]
    pub fn body(&self) -> &[u8] {
        &self.body
    }

    /// The head, which comes before the body; nothing comes after that, the connection is closed.
    #[must_use]
    pub fn head(&self) -> String {
        self.head_of(self.body.len() as u64)
    }

    /// The head before another body, of so many bytes, that is sent instead of its own.
    #[must_use]
    pub fn head_of(&self, length: u64) -> String {
        let Self {
            status,
            kind,
            policy,
            cache,
            headers,
            body: _,
        } = self;
        let mut head = format!(
            "HTTP/1.1 {}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\
             Cache-Control: {cache}\r\nContent-Security-Policy: {policy}\r\nX-Content-Type-Options: nosniff\r\n\
             Referrer-Policy: no-referrer\r\nCross-Origin-Resource-Policy: same-origin\r\n\
             Cross-Origin-Opener-Policy: same-origin\r\nX-Frame-Options: DENY\r\n",
            status.line(),
        );
        for (name, value) in headers {
            // Writing to a `String` cannot fail.
            let _ = write!(head, "{name}: {value}\r\n");
        }
        head.push_str("\r\n");
        head
    }
}
