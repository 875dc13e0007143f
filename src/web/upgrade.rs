//! The WebSocket handshake (RFC 6455, section 4.2), without the rules of admission.
//!
//! **Invariant:** only the protocol itself is accepted: no extension and no subprotocol.

use bytes::Bytes;
use hyper::header::{CONNECTION, HeaderValue, SEC_WEBSOCKET_VERSION, UPGRADE};
use hyper::{Request, StatusCode};
use tungstenite::error::{Error, ProtocolError};
use tungstenite::handshake::server::create_response;

use super::head::RequestHead;
use super::response::{HttpResponse, set, text};

/// Whether the request asks for a WebSocket, valid or not.
#[must_use]
pub fn is_wanted(request: &RequestHead) -> bool {
    request.has_word("upgrade", "websocket") || request.0.headers.contains_key("sec-websocket-key")
}

/// The answer to a handshake. After the status 101 the stream is a WebSocket.
#[must_use]
pub fn accept(request: &RequestHead) -> HttpResponse {
    let mut head = request.0.clone();
    // Both headers are lists, on one line or several (RFC 9110, sections 5.3 and 7.8). `create_response` accepts only one
    // protocol, and reads only one line.
    for (name, word) in [(UPGRADE, "websocket"), (CONNECTION, "upgrade")] {
        if request.has_word(name.as_str(), word) {
            head.headers.insert(name, HeaderValue::from_static(word));
        }
    }
    match create_response(&Request::from_parts(head, ())) {
        Ok(answer) => answer.map(|()| Bytes::new().into()),
        Err(Error::Protocol(ProtocolError::MissingSecWebSocketVersionHeader)) => {
            let sentence = "this runtime supports only version 13 of the WebSocket protocol";
            let mut answer = text(StatusCode::UPGRADE_REQUIRED, sentence);
            set(&mut answer, SEC_WEBSOCKET_VERSION, "13");
            set(&mut answer, UPGRADE, "websocket");
            answer
        }
        Err(why) => text(StatusCode::BAD_REQUEST, &why.to_string()),
    }
}
