//! Answers over HTTP, each with the headers that keep a browser strict.
//!
//! **Invariant:** no byte of a request becomes part of a header. A text that quotes a request is served as plain text.

use std::convert::Infallible;
use std::fmt::Write as _;
use std::pin::Pin;
use std::task::{Context, Poll};

use bytes::Bytes;
use hyper::body::{Body, Frame, SizeHint};
use hyper::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, HeaderValue, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS, X_FRAME_OPTIONS,
};
use hyper::{Response, StatusCode};
use tokio::sync::OwnedSemaphorePermit;

/// An answer.
pub type HttpResponse = Response<AnswerBody>;

const RESOURCE_POLICY: HeaderName = HeaderName::from_static("cross-origin-resource-policy");
const OPENER_POLICY: HeaderName = HeaderName::from_static("cross-origin-opener-policy");

/// The policy of a text in a browser: nothing is allowed.
const NOTHING: &str = "default-src 'none'; frame-ancestors 'none'";
/// Bytes passed to the library at a time.
const PIECE: usize = 64 * 1024;

/// A file, with its policy in a browser. Browsers do not cache it, because it may change.
#[must_use]
pub fn file(kind: &'static str, policy: &str, body: impl Into<AnswerBody>) -> HttpResponse {
    let mut response = Response::new(body.into());
    for (name, value) in [
        (CONTENT_TYPE, kind),
        (CACHE_CONTROL, "no-store"),
        (CONTENT_SECURITY_POLICY, policy),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (REFERRER_POLICY, "no-referrer"),
        (RESOURCE_POLICY, "same-origin"),
        (OPENER_POLICY, "same-origin"),
        (X_FRAME_OPTIONS, "DENY"),
    ] {
        set(&mut response, name, value);
    }
    response
}

/// An answer with one sentence.
#[must_use]
pub fn text(status: StatusCode, sentence: &str) -> HttpResponse {
    let body = Bytes::from(format!("{sentence}\n"));
    let mut response = file("text/plain; charset=utf-8", NOTHING, body);
    *response.status_mut() = status;
    response
}

/// Lets pages of these origins, separated by spaces, show the answer in a frame.
pub(super) fn permit_frames(response: &mut HttpResponse, origins: &str) {
    let headers = response.headers_mut();
    let policy = headers.get(CONTENT_SECURITY_POLICY);
    let Some(policy) = policy.and_then(|policy| policy.to_str().ok()) else {
        return;
    };
    let permitted = format!("frame-ancestors {origins}");
    let policy = policy.replace("frame-ancestors 'none'", &permitted);
    // This header can only forbid all other pages. Browsers that support `frame-ancestors` ignore it.
    headers.remove(X_FRAME_OPTIONS);
    set(response, CONTENT_SECURITY_POLICY, &policy);
}

/// Sets a header with a value of the runtime.
pub(super) fn set(response: &mut HttpResponse, name: HeaderName, value: &str) {
    if let Ok(value) = HeaderValue::from_str(value) {
        response.headers_mut().insert(name, value);
    }
}

/// The bytes of a one-sentence answer to a client whose request was not read to its end. The connection is then closed.
#[must_use]
pub fn refusal(status: StatusCode, sentence: &str) -> Vec<u8> {
    let response = text(status, sentence);
    let body = &response.body().bytes;
    let length = body.len();
    let mut message =
        format!("HTTP/1.1 {status}\r\nConnection: close\r\nContent-Length: {length}\r\n");
    for (name, value) in response.headers() {
        // Writing to a `String` cannot fail.
        let value = value.to_str().unwrap_or_default();
        let _ = write!(message, "{name}: {value}\r\n");
    }
    message.push_str("\r\n");
    [message.as_bytes(), body].concat()
}

/// The body of an answer.
pub struct AnswerBody {
    bytes: Bytes,
    /// The permit of a file.
    _permit: Option<OwnedSemaphorePermit>,
}

impl From<Bytes> for AnswerBody {
    fn from(bytes: Bytes) -> Self {
        Self {
            bytes,
            _permit: None,
        }
    }
}

impl AnswerBody {
    pub(super) fn of(file: Vec<u8>, permit: OwnedSemaphorePermit) -> Self {
        Self {
            bytes: file.into(),
            _permit: Some(permit),
        }
    }
}

impl Body for AnswerBody {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        let piece = self.bytes.len().min(PIECE);
        let piece = self.bytes.split_to(piece);
        Poll::Ready((!piece.is_empty()).then(|| Ok(Frame::data(piece))))
    }

    fn is_end_stream(&self) -> bool {
        self.bytes.is_empty()
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.bytes.len() as u64)
    }
}
