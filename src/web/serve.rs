//! One request from a stream, one answer to it.
//!
//! **Invariant:** reading a head and writing an answer are bounded in bytes and in time, and so is how many there are at
//! once; a client that does neither costs a place for a few seconds.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use bytes::{Bytes, BytesMut};
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::sync::OwnedSemaphorePermit;
use tokio::time::{timeout, timeout_at};

use super::access::Refusal;
use super::authority::Authority;
use super::head::{self, HeadError, MAX_HEAD, Request};
use super::response::{Response, Status};
use super::{Door, ROOM, page, report, upgrade};

/// How long a client may take no byte of an answer.
pub const TAKE_TIME: Duration = Duration::from_secs(10);
/// How long an answer may take in all: the largest file over a slow line.
pub const ANSWER_TIME: Duration = Duration::from_secs(120);
/// Bytes of an answer that are offered at a time.
const PIECE: usize = 64 * 1024;
/// How long, and how many bytes, of what follows a request are swallowed so that the answer can still be read: closing a
/// socket with unread input resets it.
const DISCARD_TIME: Duration = Duration::from_secs(1);
const DISCARD_BYTES: usize = 1024 * 1024;

/// What is to be done about a request.
enum Outcome {
    Answer(Response),
    /// The stream becomes a WebSocket once this has been sent.
    Upgrade(Vec<u8>),
    /// A file of the report is to be read, and a cookie to be set with it.
    Report(report::Name, Option<String>),
}

/// Serves one request on `stream`, of which `first` has been read; `local` is the address that the client has connected
/// to. Gives what followed the head if the stream is a WebSocket now; else it has ended.
pub async fn serve<S: AsyncRead + AsyncWrite + Unpin>(
    stream: &mut S,
    first: BytesMut,
    door: &Door,
    local: SocketAddr,
    head_time: Duration,
) -> Option<Bytes> {
    let Ok(_place) = door.places.clone().try_acquire_owned() else {
        let sentence = "too many requests at once; try again";
        answer(stream, &Response::text(Status::Unavailable, sentence)).await;
        return None;
    };
    let deadline = tokio::time::Instant::now() + head_time;
    let (request, behind) = match timeout_at(deadline, read_head(stream, first)).await {
        Ok(Some(Ok(read))) => read,
        Ok(Some(Err(error))) => {
            answer(stream, &malformed(&error)).await;
            return None;
        }
        Ok(None) => return None,
        Err(_) => {
            let sentence = "the head of the request took too long";
            answer(stream, &Response::text(Status::RequestTimeout, sentence)).await;
            return None;
        }
    };
    // What a file takes is given back once it has been sent.
    let (response, _room) = match judge(&request, door, local) {
        Outcome::Answer(response) => (response, None),
        Outcome::Report(name, cookie) => {
            let (response, room) = read_report(name, door).await;
            (with_cookie(response, cookie), room)
        }
        Outcome::Upgrade(head) => {
            let sent = take(stream.write_all(&head)).await;
            return sent.map(|()| behind.freeze());
        }
    };
    answer(stream, &response).await;
    None
}

/// Reads up to the end of the head: the request and what came behind it. `None` if the client ends before.
async fn read_head<S: AsyncRead + Unpin>(
    stream: &mut S,
    mut bytes: BytesMut,
) -> Option<Result<(Request, BytesMut), HeadError>> {
    let mut seen = 0;
    loop {
        if let Some(end) = head::end(&bytes, seen) {
            if end > MAX_HEAD {
                return Some(Err(HeadError::TooLong));
            }
            let head = bytes.split_to(end);
            return Some(Request::parse(&head).map(|request| (request, bytes)));
        }
        if bytes.len() > MAX_HEAD {
            return Some(Err(HeadError::TooLong));
        }
        seen = bytes.len();
        if stream.read_buf(&mut bytes).await.unwrap_or(0) == 0 {
            return None;
        }
    }
}

fn malformed(error: &HeadError) -> Response {
    let status = match error {
        HeadError::Malformed(_) => Status::BadRequest,
        HeadError::TooLong => Status::HeadTooLong,
        HeadError::Method => Status::MethodNotAllowed,
    };
    let response = Response::text(status, &error.to_string());
    match error {
        HeadError::Method => response.with("Allow", "GET"),
        _ => response,
    }
}

/// What a request may have, and what it gets.
fn judge(request: &Request, door: &Door, local: SocketAddr) -> Outcome {
    let refused = |why: &Refusal| {
        tracing::debug!(%why, "request refused");
        let status = match why {
            Refusal::NoHost => Status::BadRequest,
            _ => Status::Forbidden,
        };
        Outcome::Answer(Response::text(status, &why.to_string()))
    };
    let own = match door.access.host(request, local) {
        Ok(own) => own,
        Err(why) => return refused(&why),
    };
    let opens_socket = upgrade::is_wanted(request);
    if opens_socket && let Err(why) = door.access.origin(request, &own) {
        return refused(&why);
    }
    let cookie = match door.access.token(request, local) {
        Ok(true) => door.access.cookie(local),
        Ok(false) => None,
        Err(why) => return refused(&why),
    };
    if opens_socket {
        return open_socket(request, cookie.as_deref());
    }
    match find(request, &own) {
        Outcome::Answer(response) => Outcome::Answer(with_cookie(response, cookie)),
        Outcome::Report(name, _) => Outcome::Report(name, cookie),
        upgrade @ Outcome::Upgrade(_) => upgrade,
    }
}

fn with_cookie(response: Response, cookie: Option<String>) -> Response {
    match cookie {
        Some(cookie) => response.with("Set-Cookie", cookie),
        None => response,
    }
}

fn open_socket(request: &Request, cookie: Option<&str>) -> Outcome {
    if request.path != "/" {
        let sentence = "the WebSocket of this runtime is at /";
        return Outcome::Answer(Response::text(Status::NotFound, sentence));
    }
    match upgrade::accept(request, cookie) {
        Ok(head) => Outcome::Upgrade(head),
        Err(response) => Outcome::Answer(response),
    }
}

/// What there is at a path.
fn find(request: &Request, own: &Authority) -> Outcome {
    let path = request.path.as_str();
    if let Some(asset) = page::find(path) {
        let policy = page::policy(own);
        return Outcome::Answer(Response::file(asset.kind, policy, asset.bytes));
    }
    if let Some(rest) = path.strip_prefix(report::PREFIX) {
        return match report::Name::parse(rest) {
            Some(name) => Outcome::Report(name, None),
            None => Outcome::Answer(Response::text(Status::NotFound, NO_SUCH_FILE)),
        };
    }
    if path == report::PREFIX.trim_end_matches('/') {
        let response = Response::text(Status::MovedPermanently, "the report is at /report/");
        return Outcome::Answer(response.with("Location", report::PREFIX));
    }
    let sentence = "there is nothing here: the page is at /, the last report at /report/";
    Outcome::Answer(Response::text(Status::NotFound, sentence))
}

const TOO_MANY_FILES: &str = "too many files of the report are being sent; try again";
const NO_SUCH_FILE: &str = "there is no such file in the report; the report is at /report/, if there is one. It is read from \
     the folder that --report names";

/// Reads a file where waiting for the disk holds up nobody, if there is room for it.
async fn read_report(name: report::Name, door: &Door) -> (Response, Option<OwnedSemaphorePermit>) {
    let (folder, room) = (door.report.clone(), Arc::clone(&door.room));
    let read = tokio::task::spawn_blocking(move || {
        let room_needed = name.length(&folder)? / ROOM + 1;
        let taken = room.try_acquire_many_owned(u32::try_from(room_needed).ok()?);
        let Ok(taken) = taken else {
            return Some(None);
        };
        Some(Some((name.read(&folder)?, taken)))
    });
    match read.await {
        Ok(Some(Some((file, taken)))) => {
            let response = Response::file(file.kind, report::POLICY, file.bytes);
            (response, Some(taken))
        }
        Ok(Some(None)) => (Response::text(Status::Unavailable, TOO_MANY_FILES), None),
        _ => (Response::text(Status::NotFound, NO_SUCH_FILE), None),
    }
}

/// Sends an answer and ends the stream, within bounds of time.
async fn answer<S: AsyncRead + AsyncWrite + Unpin>(stream: &mut S, response: &Response) {
    let send = async {
        take(stream.write_all(response.head().as_bytes())).await?;
        for piece in response.body().chunks(PIECE) {
            take(stream.write_all(piece)).await?;
        }
        take(stream.shutdown()).await
    };
    if !matches!(timeout(ANSWER_TIME, send).await, Ok(Some(()))) {
        return;
    }
    let swallow = async {
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
    let _ = timeout(DISCARD_TIME, swallow).await;
}

/// Waits until a piece has been taken; `None` if the client does not take it.
async fn take(writing: impl Future<Output = std::io::Result<()>>) -> Option<()> {
    timeout(TAKE_TIME, writing).await.ok()?.ok()
}
