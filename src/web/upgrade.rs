//! The WebSocket handshake (RFC 6455, section 4.2), apart from who may open one.
//!
//! **Invariant:** nothing is agreed to but the protocol itself: no extension, no subprotocol.

use tokio_tungstenite::tungstenite::handshake::derive_accept_key;

use super::head::RequestHead;
use super::response::{HttpResponse, HttpStatus};

/// The version that everybody speaks.
const VERSION: &str = "13";
/// Sixteen bytes in base64: 22 characters and two for padding.
const KEY_LENGTH: usize = 24;

/// Whether the request wants to become a WebSocket, rightly or not.
#[must_use]
pub fn is_wanted(request: &RequestHead) -> bool {
    request.has_word("upgrade", "websocket") || request.count("sec-websocket-key") > 0
}

/// The answer after which the stream is a WebSocket.
///
/// # Errors
/// The answer to a handshake that is not as it has to be.
pub fn accept(request: &RequestHead, cookie: Option<&str>) -> Result<Vec<u8>, HttpResponse> {
    let refused = |why| Err(HttpResponse::text(HttpStatus::BadRequest, why));
    if !request.is_http_1_1 {
        return refused("a WebSocket is opened with HTTP/1.1");
    }
    if !request.has_word("upgrade", "websocket") || !request.has_word("connection", "upgrade") {
        return refused(
            "to open a WebSocket, the request must say `Upgrade: websocket` and `Connection: Upgrade`",
        );
    }
    if request.one("sec-websocket-version").map(str::trim) != Some(VERSION) {
        let sentence = "this runtime speaks version 13 of the WebSocket protocol";
        let answer = HttpResponse::text(HttpStatus::UpgradeRequired, sentence);
        return Err(answer
            .with("Sec-WebSocket-Version", VERSION)
            .with("Upgrade", "websocket"));
    }
    let Some(key) = request
        .one("sec-websocket-key")
        .map(str::trim)
        .filter(|key| is_key(key))
    else {
        return refused("Sec-WebSocket-Key must be 16 bytes in base64");
    };
    let accept = derive_accept_key(key.as_bytes());
    let cookie = cookie.map_or_else(String::new, |cookie| format!("Set-Cookie: {cookie}\r\n"));
    Ok(format!(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Accept: {accept}\r\n{cookie}\r\n"
    )
    .into_bytes())
}

fn is_key(key: &str) -> bool {
    let sextet = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'/');
    key.len() == KEY_LENGTH
        && key
            .strip_suffix("==")
            .is_some_and(|digits| digits.bytes().all(sextet))
}
