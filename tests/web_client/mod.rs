//! What the tests of the web door share: requests as bytes, answers taken apart, and a WebSocket client that blocks.

#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test file uses its own part of this"
)]
#![allow(
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::needless_pass_by_value,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a helper of a test fails by panicking, as a test does; it reads best called with a value"
)]

use std::fs;
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::handshake::client::Request;
use tokio_tungstenite::tungstenite::http::HeaderValue;
use tokio_tungstenite::tungstenite::protocol::frame::coding::CloseCode;
use tokio_tungstenite::tungstenite::{self, Message, WebSocket};

use crate::common::PATIENCE;

/// A folder of one test's own, below the build's.
pub fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}

/// An answer over HTTP.
#[derive(Debug)]
pub struct Answer {
    pub status: u16,
    headers: Vec<(String, String)>,
    pub body: Vec<u8>,
}

impl Answer {
    /// Takes an answer apart, which is all that came before the end of the stream.
    pub fn parse(bytes: &[u8]) -> Self {
        let end = bytes
            .windows(4)
            .position(|window| window == b"\r\n\r\n")
            .unwrap_or_else(|| panic!("no head in {:?}", String::from_utf8_lossy(bytes)));
        let head = std::str::from_utf8(&bytes[..end]).expect("a head is text");
        let mut lines = head.split("\r\n");
        let first = lines.next().unwrap();
        let status = first
            .strip_prefix("HTTP/1.1 ")
            .and_then(|rest| rest.get(..3))
            .and_then(|code| code.parse().ok())
            .unwrap_or_else(|| panic!("not a status line: {first:?}"));
        let headers = lines
            .map(|line| {
                let (name, value) = line.split_once(": ").expect("a header");
                (name.to_ascii_lowercase(), value.to_owned())
            })
            .collect();
        let answer = Self {
            status,
            headers,
            body: bytes[end + 4..].to_vec(),
        };
        if status != 101 {
            let length: usize = answer.header("content-length").unwrap().parse().unwrap();
            assert_eq!(length, answer.body.len());
        }
        answer
    }

    pub fn header(&self, name: &str) -> Option<&str> {
        let found = self.headers.iter().find(|(one, _)| one == name)?;
        Some(&found.1)
    }

    pub fn text(&self) -> &str {
        std::str::from_utf8(&self.body).expect("a text")
    }
}

/// Sends bytes and gives all that comes up to the end of the stream.
pub fn exchange(address: SocketAddr, request: &[u8]) -> Vec<u8> {
    let mut stream = TcpStream::connect(address).expect("the program accepts");
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    stream.write_all(request).expect("the program takes it");
    rest(&mut stream)
}

/// All that comes up to the end of the stream.
pub fn rest(stream: &mut TcpStream) -> Vec<u8> {
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).expect("an orderly end");
    bytes
}

/// Sends a request with these header lines, each with its line end.
pub fn request(address: SocketAddr, path: &str, headers: &str) -> Answer {
    let request = format!("GET {path} HTTP/1.1\r\n{headers}\r\n");
    Answer::parse(&exchange(address, request.as_bytes()))
}

/// The same with our own host.
pub fn get(address: SocketAddr, path: &str) -> Answer {
    request(address, path, &format!("Host: {address}\r\n"))
}

/// The header lines of a handshake that is as it has to be.
pub fn handshake(address: SocketAddr) -> String {
    format!(
        "Host: {address}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
         Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
    )
}

/// The status of a handshake, and its body if it was refused.
pub fn try_handshake(address: SocketAddr, path: &str, headers: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(address).expect("the program accepts");
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let request = format!("GET {path} HTTP/1.1\r\n{headers}\r\n");
    stream.write_all(request.as_bytes()).unwrap();
    let mut bytes = Vec::new();
    let mut chunk = [0; 4096];
    while !bytes.starts_with(b"HTTP/1.1 101 ") || !bytes.ends_with(b"\r\n\r\n") {
        match stream.read(&mut chunk) {
            Ok(0) => break,
            Ok(read) => bytes.extend_from_slice(&chunk[..read]),
            Err(error) => panic!("{error}"),
        }
    }
    let answer = Answer::parse(&bytes);
    (answer.status, answer.text().to_owned())
}

/// A client over WebSocket.
pub struct Socket {
    pub socket: WebSocket<TcpStream>,
    calls: u64,
}

impl Socket {
    pub fn open(address: SocketAddr) -> Self {
        Self::open_with(address, "/", &[])
    }

    pub fn open_with(address: SocketAddr, target: &str, headers: &[(&'static str, &str)]) -> Self {
        let mut request: Request = format!("ws://{address}{target}")
            .into_client_request()
            .unwrap();
        for (name, value) in headers {
            let value = HeaderValue::from_str(value).unwrap();
            request.headers_mut().insert(*name, value);
        }
        let stream = TcpStream::connect(address).expect("the program accepts");
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        let (socket, _) = tungstenite::client(request, stream).expect("a handshake");
        Self { socket, calls: 0 }
    }

    pub fn send(&mut self, frame: &Value) {
        self.send_text(&frame.to_string());
    }

    pub fn send_text(&mut self, text: &str) {
        self.socket
            .send(Message::text(text))
            .expect("an open socket");
    }

    /// The text of the next message.
    pub fn receive_text(&mut self) -> String {
        loop {
            match self.socket.read().expect("a message in time") {
                Message::Text(text) => return text.as_str().to_owned(),
                Message::Ping(_) | Message::Pong(_) => {}
                other => panic!("not a text message: {other:?}"),
            }
        }
    }

    pub fn receive(&mut self) -> Value {
        let text = self.receive_text();
        assert!(!text.contains('\n'), "{text:?}");
        serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error} in {text:?}"))
    }

    /// Calls a service and gives its response, which must be the very next frame.
    pub fn call(&mut self, service: &str, args: Value) -> Value {
        self.calls += 1;
        self.send(
            &json!({"op": "call_service", "service": service, "args": args, "id": self.calls}),
        );
        let response = self.receive();
        assert_eq!(response["op"], "service_response", "{response}");
        assert_eq!(response["id"], self.calls, "{response}");
        response
    }

    /// Waits until all that was sent has been handled, and asserts that nothing else was said.
    pub fn settle(&mut self) {
        let response = self.call("/arm_sim/set_params", json!({}));
        assert_eq!(response["result"], true, "{response}");
    }

    /// The code with which the other side closes; what comes before is ignored.
    pub fn close_code(&mut self) -> Option<CloseCode> {
        let deadline = Instant::now() + PATIENCE;
        while Instant::now() < deadline {
            match self.socket.read() {
                Ok(Message::Close(frame)) => return frame.map(|frame| frame.code),
                Ok(_) => {}
                Err(error) => panic!("{error}"),
            }
        }
        panic!("no close frame in time")
    }

    /// True if the stream ends within the usual patience.
    pub fn is_closed(&mut self) -> bool {
        let mut chunk = [0; 4096];
        loop {
            match self.socket.get_mut().read(&mut chunk) {
                Ok(0) => return true,
                Ok(_) => {}
                Err(error) => return error.kind() == ErrorKind::ConnectionReset,
            }
        }
    }

    /// Changes how long a read may take.
    pub fn set_patience(&mut self, patience: Duration) {
        self.socket
            .get_mut()
            .set_read_timeout(Some(patience))
            .unwrap();
    }
}
