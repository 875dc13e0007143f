//! A blocking client on its own TCP socket, by line or by WebSocket.
//!
//! [`Client::next_event`] and [`Client::write`] return errors. The other methods are for tests, and panic.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::codec::{Codec, Event, Framing};
use crate::websocket::{LAST, append, append_close, handshake, opcode};
use crate::{Error, call, is_response_to, values};

/// Default limit of every wait. It is long, because machines may be busy.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// The mask of control frames.
const MASK: [u8; 4] = [1, 2, 3, 4];

/// A client.
#[derive(Debug)]
pub struct Client {
    stream: TcpStream,
    codec: Codec,
    patience: Duration,
    chunk: Vec<u8>,
    calls: u64,
    has_closed: bool,
    /// Frames that arrived while another was awaited, the oldest first.
    pub kept: Vec<Value>,
}

impl Client {
    /// Connects by line.
    ///
    /// # Panics
    /// As all methods below: if the expected event does not happen in time.
    #[must_use]
    #[track_caller]
    pub fn to(address: SocketAddr) -> Self {
        expect(
            "a connection",
            Self::connect(Framing::Lines, address, PATIENCE),
        )
    }

    /// Connects by WebSocket.
    #[must_use]
    #[track_caller]
    pub fn web(address: SocketAddr) -> Self {
        expect(
            "a WebSocket",
            Self::connect(Framing::WebSocket, address, PATIENCE),
        )
    }

    /// Connects, with `patience` as the limit of every wait.
    ///
    /// # Errors
    /// The socket's error, or a refused handshake.
    pub fn connect(
        framing: Framing,
        address: SocketAddr,
        patience: Duration,
    ) -> Result<Self, Error> {
        let dial = || {
            let stream = TcpStream::connect_timeout(&address, patience)?;
            stream.set_nodelay(true)?;
            stream.set_read_timeout(Some(patience))?;
            stream.set_write_timeout(Some(patience))?;
            Ok(stream)
        };
        let mut client = Self {
            stream: dial().map_err(Error::Socket)?,
            codec: Codec::new(framing),
            patience,
            chunk: vec![0; 64 * 1024],
            calls: 0,
            has_closed: false,
            kept: Vec::new(),
        };
        if framing == Framing::WebSocket {
            client.write(handshake(&address.to_string(), "/", "").as_bytes())?;
        }
        let deadline = Instant::now() + patience;
        while !client.codec.is_open() {
            // The runtime sends nothing before a request of the client.
            client.codec.next_event()?;
            if !client.codec.is_open() {
                client.read(deadline)?;
            }
        }
        Ok(client)
    }

    /// The socket, for violations of the protocol.
    #[must_use]
    pub fn stream(&self) -> &TcpStream {
        &self.stream
    }

    /// Changes the limit of every wait.
    #[track_caller]
    pub fn set_patience(&mut self, patience: Duration) {
        self.patience = patience;
        let set = self.stream.set_read_timeout(Some(patience));
        expect("a timeout", set.map_err(Error::Socket));
    }

    /// Sends bytes unchanged.
    ///
    /// # Errors
    /// The socket's error.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.stream.write_all(bytes).map_err(Error::Socket)
    }

    /// Sends a frame.
    #[track_caller]
    pub fn send(&mut self, frame: &Value) {
        self.send_text(&frame.to_string());
    }

    /// Sends a frame as text.
    #[track_caller]
    pub fn send_text(&mut self, frame: &str) {
        let mut bytes = Vec::with_capacity(frame.len() + 16);
        self.codec.write(frame, &mut bytes);
        self.send_bytes(&bytes);
    }

    /// Sends bytes unchanged.
    #[track_caller]
    pub fn send_bytes(&mut self, bytes: &[u8]) {
        expect("room for what is sent", self.write(bytes));
    }

    /// Says that the WebSocket is to end.
    #[track_caller]
    pub fn close(&mut self, code: u16, reason: &str) {
        let mut bytes = Vec::new();
        append_close(&mut bytes, MASK, code, reason);
        self.has_closed = true;
        self.send_bytes(&bytes);
    }

    fn read(&mut self, deadline: Instant) -> Result<(), Error> {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(Error::Late);
        }
        self.stream
            .set_read_timeout(Some(left))
            .map_err(Error::Socket)?;
        match self.stream.read(&mut self.chunk) {
            Ok(0) => Err(Error::Ended),
            Ok(read) => {
                self.codec.push(&self.chunk[..read]);
                Ok(())
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => Ok(()),
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {
                Err(Error::Late)
            }
            Err(error) => Err(Error::Socket(error)),
        }
    }

    /// The next message, pong or close before `deadline`. Pings and a close are answered.
    ///
    /// # Errors
    /// If none arrives.
    pub fn next_event(&mut self, deadline: Instant) -> Result<Event, Error> {
        loop {
            let mut answer = Vec::new();
            let event = match self.codec.next_event()? {
                None => {
                    self.read(deadline)?;
                    continue;
                }
                Some(Event::Ping(payload)) => {
                    append(&mut answer, LAST | opcode::PONG, MASK, &payload);
                    self.write(&answer)?;
                    continue;
                }
                Some(event) => event,
            };
            if let Event::Close(code, _) = &event
                && !std::mem::replace(&mut self.has_closed, true)
            {
                append_close(&mut answer, MASK, code.unwrap_or(1000), "");
                // The runtime may have ended already.
                let _ = self.write(&answer);
            }
            return Ok(event);
        }
    }

    /// The next frame before `deadline`.
    ///
    /// # Errors
    /// If none arrives, or if it is not JSON.
    pub fn next_frame(&mut self, deadline: Instant) -> Result<Value, Error> {
        loop {
            if let Some(frame) = self.next_event(deadline)?.into_frame()? {
                return Ok(frame);
            }
        }
    }

    /// The next frame.
    #[track_caller]
    pub fn receive(&mut self) -> Value {
        expect("a frame", self.next_frame(Instant::now() + self.patience))
    }

    /// The next frame for which `wanted` is true. The others are kept.
    #[track_caller]
    pub fn receive_where(&mut self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let deadline = Instant::now() + self.patience;
        loop {
            let frame = expect(what, self.next_frame(deadline));
            if wanted(&frame) {
                return frame;
            }
            self.kept.push(frame);
        }
    }

    /// The frames that arrive within `time`.
    #[track_caller]
    pub fn receive_for(&mut self, time: Duration) -> Vec<Value> {
        let deadline = Instant::now() + time;
        let mut frames = Vec::new();
        loop {
            match self.next_frame(deadline) {
                Ok(frame) => frames.push(frame),
                Err(Error::Late | Error::Ended) => break,
                Err(error) => panic!("{error}"),
            }
        }
        self.set_patience(self.patience);
        frames
    }

    /// The next message on `topic`.
    #[track_caller]
    pub fn message(&mut self, topic: &str) -> Value {
        let mut frame = self.receive_where(topic, |frame| {
            frame["op"] == "publish" && frame["topic"] == topic
        });
        frame["msg"].take()
    }

    /// The next status.
    #[track_caller]
    pub fn status(&mut self) -> Value {
        self.receive_where("status", |frame| frame["op"] == "status")
    }

    /// Calls a service and returns the whole response.
    #[track_caller]
    pub fn call(&mut self, service: &str, args: Value) -> Value {
        self.calls += 1;
        let id = json!(format!("call-{}", self.calls));
        self.send(&call(service, &args, &id));
        self.receive_where(service, |frame| is_response_to(frame, &id))
    }

    /// Calls a service that must succeed and returns its values.
    #[track_caller]
    pub fn ask(&mut self, service: &str, args: Value) -> Value {
        values(self.call(service, args))
    }

    /// Subscribes and waits for the confirmation, which comes over TCP only unless the client has set a level.
    #[track_caller]
    pub fn subscribe(&mut self, topic: &str) {
        self.send(&json!({"op": "subscribe", "topic": topic}));
        let status = self.status();
        assert_eq!(status["level"], "info", "{status}");
    }

    /// Waits until the runtime has handled all sent frames, because a call is answered in order.
    #[track_caller]
    pub fn settle(&mut self) {
        self.ask("/arm_sim/set_params", json!({}));
    }

    /// True if the stream ends (or breaks) in time. Earlier data is ignored.
    #[track_caller]
    pub fn is_closed(&mut self) -> bool {
        self.set_patience(self.patience);
        loop {
            match self.stream.read(&mut self.chunk) {
                Ok(0) => return true,
                Ok(_) => {}
                Err(error) => return error.kind() == ErrorKind::ConnectionReset,
            }
        }
    }
}

#[track_caller]
fn expect<T>(what: &str, result: Result<T, Error>) -> T {
    result.unwrap_or_else(|error| panic!("{what} is awaited: {error}"))
}
