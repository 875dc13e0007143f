//! One request from a stream, one answer to it.
//!
//! **Invariant:** reading a head and writing an answer are bounded in bytes and in time. How many there are at once is
//! bounded by whoever calls.

use std::net::SocketAddr;
use std::time::Duration;

use bytes::BytesMut;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::task::yield_now;
use tokio::time::{Instant, timeout, timeout_at};

use super::access::AccessError;
use super::authority::Authority;
use super::head::{self, HeadError, MAX_HEAD, RequestHead};
use super::response::{HttpResponse, HttpStatus};
use super::{Site, page, report, upgrade};

/// How long a client may take no byte of an answer.
pub const TAKE_TIME: Duration = Duration::from_secs(10);
/// How long an answer may take for each stretch of [`STRETCH`] bytes that it begins: 280 kB/s.
pub const ANSWER_TIME: Duration = Duration::from_secs(120);
/// Bytes of an answer that may take [`ANSWER_TIME`].
pub const STRETCH: u64 = 32 * 1024 * 1024;
/// Bytes of an answer that are offered at a time.
const PIECE: usize = 64 * 1024;
/// How long, and how many bytes, of what follows a request are swallowed so that the answer can still be read: closing
/// a socket with unread input resets it.
const DISCARD_TIME: Duration = Duration::from_secs(1);
const DISCARD_BYTES: usize = 1024 * 1024;

/// The way in which a request is served.
#[derive(Debug)]
pub enum Served {
    /// It is answered with this, and a cookie to be set with it.
    Answer(Resource, Option<String>),
    /// The stream becomes a WebSocket once this has been sent.
    Upgrade(Vec<u8>),
}

/// Stands at a path.
#[derive(Debug)]
pub enum Resource {
    /// A sentence, or the way to another path.
    Said(HttpResponse),
    /// A file of the page.
    Page(page::PageFile),
    /// A file of the report, which is to be read.
    Report(report::FileName),
}

/// A request that gets nothing but this answer.
#[derive(Debug)]
pub struct Declined {
    /// Why.
    pub response: HttpResponse,
    /// It showed a token that is not ours.
    pub is_wrong_token: bool,
}

impl From<HttpResponse> for Declined {
    fn from(response: HttpResponse) -> Self {
        let is_wrong_token = false;
        Self {
            response,
            is_wrong_token,
        }
    }
}

/// Reads a request from `stream`, of which `bytes` have been read, until `due`; what came behind its head is left in
/// `bytes`. Then what is to be done about it; `local` is the address that the client has connected to. `None` if the
/// client ends before.
pub async fn receive<S: AsyncRead + Unpin>(
    stream: &mut S,
    bytes: &mut BytesMut,
    site: &Site,
    local: SocketAddr,
    due: Instant,
) -> Option<Result<Served, Declined>> {
    match timeout_at(due, read_head(stream, bytes)).await {
        Ok(Some(Ok(request))) => Some(judge(&request, site, local)),
        Ok(Some(Err(error))) => Some(Err(malformed(&error).into())),
        Ok(None) => None,
        Err(_) => {
            let sentence = "the head of the request took too long";
            Some(Err(HttpResponse::text(
                HttpStatus::RequestTimeout,
                sentence,
            )
            .into()))
        }
    }
}

/// Does what is to be done about a request. True if the stream is a WebSocket now; else it has ended.
pub async fn respond<S: AsyncRead + AsyncWrite + Unpin>(
    stream: &mut S,
    outcome: Served,
    site: &Site,
) -> bool {
    let (resource, cookie) = match outcome {
        Served::Answer(resource, cookie) => (resource, cookie),
        Served::Upgrade(head) => return take(stream.write_all(&head)).await.is_some(),
    };
    let (response, file) = match resource {
        Resource::Said(response) => (response, None),
        Resource::Page(file) => (file.answer(site).await, None),
        Resource::Report(name) => open_report(name, site).await,
    };
    let response = with_cookie(response, cookie);
    match file {
        Some(file) => answer_with(stream, &response, file, site).await,
        None => answer(stream, &response).await,
    }
    false
}

/// Reads up to the end of the head; what came behind it is left. `None` if the client ends before.
async fn read_head<S: AsyncRead + Unpin>(
    stream: &mut S,
    bytes: &mut BytesMut,
) -> Option<Result<RequestHead, HeadError>> {
    let mut seen = 0;
    loop {
        if let Some(end) = head::end(bytes, seen) {
            if end > MAX_HEAD {
                return Some(Err(HeadError::TooLong));
            }
            let head = bytes.split_to(end);
            return Some(RequestHead::parse(&head));
        }
        if bytes.len() > MAX_HEAD {
            return Some(Err(HeadError::TooLong));
        }
        seen = bytes.len();
        if stream.read_buf(bytes).await.unwrap_or(0) == 0 {
            return None;
        }
    }
}

fn malformed(error: &HeadError) -> HttpResponse {
    let status = match error {
        HeadError::Malformed(_) => HttpStatus::BadRequest,
        HeadError::TooLong => HttpStatus::HeadTooLong,
        HeadError::Method => HttpStatus::MethodNotAllowed,
    };
    let response = HttpResponse::text(status, &error.to_string());
    match error {
        HeadError::Method => response.with("Allow", "GET"),
        _ => response,
    }
}

/// Judges a request: may it be served, and how.
fn judge(request: &RequestHead, site: &Site, local: SocketAddr) -> Result<Served, Declined> {
    let own = site.access.host(request, local)?;
    let opens_socket = upgrade::is_wanted(request);
    if opens_socket {
        site.access.origin(request, &own)?;
    }
    let is_shown = site.access.token(request, local)?;
    let cookie = is_shown.then(|| site.access.cookie(local)).flatten();
    if opens_socket {
        return Ok(open_socket(request, cookie.as_deref()));
    }
    Ok(Served::Answer(find(request, &own), cookie))
}

impl From<AccessError> for Declined {
    fn from(why: AccessError) -> Self {
        tracing::debug!(%why, "request refused");
        let status = match why {
            AccessError::NoHost => HttpStatus::BadRequest,
            _ => HttpStatus::Forbidden,
        };
        Self {
            response: HttpResponse::text(status, &why.to_string()),
            is_wrong_token: why == AccessError::WrongToken,
        }
    }
}

fn with_cookie(response: HttpResponse, cookie: Option<String>) -> HttpResponse {
    match cookie {
        Some(cookie) => response.with("Set-Cookie", cookie),
        None => response,
    }
}

fn open_socket(request: &RequestHead, cookie: Option<&str>) -> Served {
    if request.path != "/" {
        let sentence = "the WebSocket of this runtime is at /";
        let response = HttpResponse::text(HttpStatus::NotFound, sentence);
        return Served::Answer(Resource::Said(response), None);
    }
    match upgrade::accept(request, cookie) {
        Ok(head) => Served::Upgrade(head),
        Err(response) => Served::Answer(Resource::Said(response), None),
    }
}

/// Finds the page, the file or the sentence that stands at a path.
fn find(request: &RequestHead, own: &Authority) -> Resource {
    let path = request.path.as_str();
    let encodings = request.one("accept-encoding").unwrap_or_default();
    if let Some(file) = page::find(path, own, encodings) {
        return Resource::Page(file);
    }
    if let Some(rest) = path.strip_prefix(report::PREFIX) {
        return match report::FileName::parse(rest) {
            Some(name) => Resource::Report(name),
            None => Resource::Said(HttpResponse::text(HttpStatus::NotFound, NO_SUCH_FILE)),
        };
    }
    if path == report::PREFIX.trim_end_matches('/') {
        let response =
            HttpResponse::text(HttpStatus::MovedPermanently, "the report is at /report/");
        return Resource::Said(response.with("Location", report::PREFIX));
    }
    let sentence = "there is nothing here: the page is at /, the last report at /report/";
    Resource::Said(HttpResponse::text(HttpStatus::NotFound, sentence))
}

const NO_SUCH_FILE: &str = "there is no such file in the report; the report is at /report/, if there is one. It is \
     read from the folder that --report names";

/// A file of the report, and the answer to be sent with it; or why there is none.
async fn open_report(name: report::FileName, site: &Site) -> (HttpResponse, Option<report::File>) {
    let (kind, folder) = (name.kind, site.report.clone());
    match site.at_disk(move || name.find(&folder)).await {
        Some(Ok(Some(file))) => (
            HttpResponse::file(kind, report::POLICY, &[][..]),
            Some(file),
        ),
        Some(Err(why)) => {
            let sentence = format!("this file of the report can't be read now: {why}");
            (HttpResponse::text(HttpStatus::Unavailable, &sentence), None)
        }
        _ => (HttpResponse::text(HttpStatus::NotFound, NO_SUCH_FILE), None),
    }
}

/// Sends an answer and ends the stream, within bounds of time.
pub(crate) async fn answer<S: AsyncRead + AsyncWrite + Unpin>(
    stream: &mut S,
    response: &HttpResponse,
) {
    let send = async {
        take(stream.write_all(response.head().as_bytes())).await?;
        for piece in response.body().chunks(PIECE) {
            take(stream.write_all(piece)).await?;
            // The system may take megabytes at once: others have their turns in between.
            yield_now().await;
        }
        take(stream.shutdown()).await
    };
    if matches!(timeout(ANSWER_TIME, send).await, Ok(Some(()))) {
        swallow(stream).await;
    }
}

/// The same with a file, each piece of which is read when the one before has been taken.
async fn answer_with<S: AsyncRead + AsyncWrite + Unpin>(
    stream: &mut S,
    response: &HttpResponse,
    mut file: report::File,
    site: &Site,
) {
    let length = file.length();
    let send = async {
        let head = response.head_of(length);
        take(stream.write_all(head.as_bytes())).await?;
        loop {
            let read = move || file.next_piece(PIECE).map(|piece| (piece, file));
            let (piece, rest) = site.at_disk(read).await?.ok()?;
            if piece.is_empty() {
                break;
            }
            file = rest;
            take(stream.write_all(&piece)).await?;
            yield_now().await;
        }
        take(stream.shutdown()).await
    };
    if matches!(timeout(answer_time(length), send).await, Ok(Some(()))) {
        swallow(stream).await;
    }
}

/// How long an answer of so many bytes may take in all.
fn answer_time(length: u64) -> Duration {
    let stretches = length / STRETCH + 1;
    ANSWER_TIME.saturating_mul(u32::try_from(stretches).unwrap_or(u32::MAX))
}

/// Reads some of what follows a request, so that its answer can still be read.
async fn swallow<S: AsyncRead + Unpin>(stream: &mut S) {
    let reading = async {
        let mut chunk = BytesMut::new();
        let mut swallowed = 0;
        while swallowed < DISCARD_BYTES {
            chunk.clear();
            chunk.reserve(PIECE);
            match stream.read_buf(&mut chunk).await {
                Ok(0) | Err(_) => break,
                Ok(read) => swallowed += read,
            }
        }
    };
    let _ = timeout(DISCARD_TIME, reading).await;
}

/// Waits until a piece has been taken; `None` if the client does not take it.
async fn take(writing: impl Future<Output = std::io::Result<()>>) -> Option<()> {
    timeout(TAKE_TIME, writing).await.ok()?.ok()
}
