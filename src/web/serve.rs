//! The requests of one connection and their answers. The library reads heads; this module chooses the answers.
//!
//! **Invariant:** reading a head and writing an answer are bounded in bytes and in time. The caller bounds the number
//! of connections.

use std::cell::Cell;
use std::future::poll_fn;
use std::io;
use std::net::SocketAddr;
use std::rc::Rc;
use std::task::{Poll, ready};
use std::time::Duration;

use bytes::{Bytes, BytesMut};
use hyper::body::{Body as _, Incoming};
use hyper::header::{CONNECTION, LOCATION, SET_COOKIE};
use hyper::server::conn::http1::Builder;
use hyper::service::service_fn;
use hyper::{Method, Request, StatusCode};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::time::{Instant, timeout};

use super::access::AccessError;
use super::head::{MAX_HEAD, MAX_HEADERS, RequestHead};
use super::response::{AnswerBody, HttpResponse, file, permit_frames, refusal, set, text};
use super::stream::{Deadline, HttpStream};
use super::{Site, page, report, upgrade};
use crate::address::Authority;

/// Time for the end of a connection, and most further bytes of the client that are read there.
const DISCARD_TIME: Duration = Duration::from_secs(1);
const DISCARD_BYTES: u64 = 1024 * 1024;

/// Decides about requests, in addition to the rules of the site.
pub trait Gate {
    /// Admits the client. It is called before each answer. An error holds the reason for a refusal.
    fn admit(&self) -> impl Future<Output = Result<(), String>>;

    /// Waits for the delay of an answer to a wrong token.
    fn delay(&self) -> impl Future<Output = ()>;
}

/// Answers the requests on `stream`, whose bytes `first` have been read already. The first head must be complete by
/// `due`. `local` is the address that the client has connected to. `cut_off` ends the connection. Its sentence is sent
/// if there is no request yet.
///
/// Returns the stream and the bytes after the handshake, if it is a WebSocket now. Otherwise it has ended.
pub async fn serve<S, G>(
    stream: S,
    first: BytesMut,
    due: Instant,
    site: &Site,
    local: SocketAddr,
    gate: &G,
    cut_off: impl Future<Output = String>,
) -> Option<(S, Bytes)>
where
    S: AsyncRead + AsyncWrite + Unpin,
    G: Gate,
{
    let deadline = Rc::new(Deadline::new(due));
    let stream = HttpStream {
        stream,
        first: first.freeze(),
        deadline: Rc::clone(&deadline),
    };
    let responder = Responder {
        site,
        local,
        gate,
        deadline: &deadline,
        is_socket: Cell::new(false),
    };
    let service = |request| Box::pin(responder.answer(request));
    let mut connection = Builder::new()
        .half_close(true)
        .title_case_headers(true)
        .auto_date_header(false)
        .max_headers(MAX_HEADERS)
        .max_header_size(MAX_HEAD)
        .max_buf_size(MAX_HEAD)
        .header_read_timeout(None)
        .serve_connection(stream, service_fn(service));
    let served = tokio::select! {
        biased;
        served = poll_fn(|cx| {
            let served = ready!(connection.poll_without_shutdown(cx));
            // The library returns once the last answer is in its buffer. It continues to write when polled again.
            let may_write = served.as_ref().map_or_else(hyper::Error::is_parse, |()| true);
            if may_write && !deadline.is_flushed.get() {
                return Poll::Pending;
            }
            Poll::Ready(served)
        }) => Ok(served),
        () = deadline.pass() => Err(None),
        why = cut_off => Err(Some(why)),
    };
    let parts = connection.into_parts();
    let HttpStream {
        mut stream, first, ..
    } = parts.io;
    let is_asked = deadline.is_asked.get();
    let message = match served {
        Ok(Ok(())) if responder.is_socket.get() => {
            return Some((stream, [parts.read_buf, first].concat().into()));
        }
        Ok(Err(error)) if !is_asked && error.is_parse() => refusal_of_head(&error),
        // The library has refused a bad head after an answered one.
        Ok(_) => Vec::new(),
        Err(_) if is_asked => return None,
        Err(None) => {
            let sentence = "the head of the request took too long";
            refusal(StatusCode::REQUEST_TIMEOUT, sentence)
        }
        Err(Some(why)) => {
            let message = refusal(StatusCode::SERVICE_UNAVAILABLE, &why);
            // The stream is closed at once, even if the client does not read the sentence.
            let _ = timeout(Duration::ZERO, stream.write_all(&message)).await;
            return None;
        }
    };
    // Some of the client's further bytes are read, because closing a socket with unread input resets it and loses
    // the last answer.
    let end = async {
        stream.write_all(&message).await?;
        stream.shutdown().await?;
        tokio::io::copy(&mut stream.take(DISCARD_BYTES), &mut tokio::io::sink()).await
    };
    let _ = timeout(DISCARD_TIME, end).await;
    None
}

/// The answer to a head that cannot be read.
fn refusal_of_head(error: &hyper::Error) -> Vec<u8> {
    if error.is_parse_too_large() {
        let most = format!("{MAX_HEAD} bytes and {MAX_HEADERS} header lines");
        let sentence = format!("the head of a request may have at most {most}");
        refusal(StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE, &sentence)
    } else {
        let sentence = format!("this is not a well-formed HTTP request: {error}");
        refusal(StatusCode::BAD_REQUEST, &sentence)
    }
}

/// Answers the requests of one connection.
struct Responder<'a, G> {
    site: &'a Site,
    local: SocketAddr,
    gate: &'a G,
    deadline: &'a Deadline,
    /// Whether the connection is a WebSocket after the last answer.
    is_socket: Cell<bool>,
}

impl<G: Gate> Responder<'_, G> {
    /// The answer to a request. Without one the connection ends.
    async fn answer(&self, request: Request<Incoming>) -> io::Result<HttpResponse> {
        self.deadline.begin_answer();
        let (parts, body) = request.into_parts();
        let has_body = !body.is_end_stream();
        let request = RequestHead(parts);
        let checked = match self.check(&request) {
            Ok(_) if has_body => Err(AccessError::Body),
            checked => checked,
        };
        let mut response = match checked {
            Ok((own, cookie)) => match self.gate.admit().await {
                Ok(()) => {
                    let mut response = self.resource(&request, &own).await;
                    if response.status() == StatusCode::OK && !self.site.frames.is_empty() {
                        permit_frames(&mut response, &self.site.frames);
                    }
                    if let Some(cookie) = cookie {
                        set(&mut response, SET_COOKIE, &cookie);
                    }
                    response
                }
                Err(why) => text(StatusCode::SERVICE_UNAVAILABLE, &why),
            },
            Err(why) => {
                // A browser does not show the answer to a WebSocket handshake, so it is logged.
                if matches!(why, AccessError::Origin(_)) {
                    tracing::warn!(%why, "request refused");
                } else {
                    tracing::debug!(%why, "request refused");
                }
                if why == AccessError::WrongToken {
                    self.gate.delay().await;
                }
                why.response()
            }
        };
        let status = response.status();
        self.is_socket
            .set(status == StatusCode::SWITCHING_PROTOCOLS);
        if status.as_u16() >= 400 && status != StatusCode::NOT_FOUND {
            set(&mut response, CONNECTION, "close");
        }
        Ok(response)
    }

    /// Checks whether a request may be served. Returns its host, and the cookie to set.
    fn check(&self, request: &RequestHead) -> Result<(Authority, Option<String>), AccessError> {
        let access = &self.site.access;
        if !request.path().starts_with('/') || request.0.uri.authority().is_some() {
            return Err(AccessError::Target);
        }
        if ![Method::GET, Method::HEAD].contains(&request.0.method) {
            return Err(AccessError::Method);
        }
        let own = access.host(request, self.local)?;
        if upgrade::is_wanted(request) {
            access.origin(request, &own)?;
        }
        let is_shown = access.token(request, self.local)?;
        let cookie = is_shown.then(|| access.cookie(self.local)).flatten();
        Ok((own, cookie))
    }

    /// Finds the WebSocket, the page, the file or the sentence for a path.
    async fn resource(&self, request: &RequestHead, own: &Authority) -> HttpResponse {
        let path = request.path();
        if upgrade::is_wanted(request) {
            return match path {
                "/" => upgrade::accept(request),
                _ => text(
                    StatusCode::NOT_FOUND,
                    "the WebSocket of this runtime is at /",
                ),
            };
        }
        if let Some(asset) = page::find(path) {
            return page::answer(asset, own, self.site).await;
        }
        if let Some(rest) = path.strip_prefix(report::PREFIX) {
            return open_report(rest, self.site).await;
        }
        if path == report::PREFIX.trim_end_matches('/') {
            let mut response = text(StatusCode::MOVED_PERMANENTLY, "the report is at /report/");
            set(&mut response, LOCATION, report::PREFIX);
            return response;
        }
        let sentence = "there is nothing here: the page is at /, the last report at /report/";
        text(StatusCode::NOT_FOUND, sentence)
    }
}

/// The answer with the file of the report at `rest`, the path after the prefix, or the reason for none.
async fn open_report(rest: &str, site: &Site) -> HttpResponse {
    let Some(name) = report::FileName::parse(rest) else {
        return text(StatusCode::NOT_FOUND, NO_SUCH_FILE);
    };
    let kind = name.kind;
    match site.look(move |folder| name.read(folder)).await {
        Some((Ok(Some(bytes)), permit)) => {
            file(kind, report::POLICY, AnswerBody::of(bytes, permit))
        }
        Some((Err(why), _)) => {
            let sentence = format!("this file of the report can't be read now: {why}");
            text(StatusCode::SERVICE_UNAVAILABLE, &sentence)
        }
        _ => text(StatusCode::NOT_FOUND, NO_SUCH_FILE),
    }
}

const NO_SUCH_FILE: &str = "there is no such file in the report; the report is at /report/, if there is one. It is \
     read from the folder that --report names";
