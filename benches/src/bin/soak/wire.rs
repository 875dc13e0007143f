//! One client on the wire, over raw TCP or WebSocket, that reads while it writes and checks every response it gets.
//!
//! It reads and writes frames as `pendularm-client` does. The socket is its own: it is deaf, sips, resets, and takes in
//! what comes while it sends, which a client that waits for one thing at a time cannot.
//!
//! **Invariant:** no response passes unchecked: whoever asks for the next frame is told of it only after the ledger.

use std::io::ErrorKind;
use std::rc::Rc;
use std::time::{Duration, Instant};

use pendularm_client::codec::{Codec, Event, Framing};
use pendularm_client::websocket::{LAST, append, handshake, opcode};
use serde_json::{Value, json};
use tokio::io::{AsyncWriteExt, Interest};
use tokio::net::{TcpSocket, TcpStream};
use tokio::time::timeout_at;

use crate::ledger::{Check, Ledger};
use crate::recent::Recent;
use crate::world::{Fault, PATIENCE, World};

/// Bytes that are read at a time.
const CHUNK: usize = 16 * 1024;

/// The door that the client came through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Door {
    /// One JSON object per line.
    Tcp,
    /// One per message.
    Web,
}

impl Door {
    /// Mostly the first.
    pub fn any(rng: &mut fastrand::Rng) -> Self {
        if rng.u8(..) < 90 {
            Self::Web
        } else {
            Self::Tcp
        }
    }
}

/// Something that came.
pub enum Came {
    /// A response, which was the right one.
    Answer(Value),
    /// Anything else.
    Other(Value),
    /// A binary message.
    Binary,
    /// The stream has ended, orderly or not.
    End,
    /// Nothing in the time given.
    Nothing,
}

/// A client.
pub struct Client {
    /// Who it is, for reports.
    pub name: String,
    /// The world, shared with all.
    pub world: Rc<World>,
    /// Its calls.
    pub ledger: Ledger,
    stream: TcpStream,
    door: Door,
    codec: Codec,
    chunk: Vec<u8>,
    /// Bytes that go with the next [`Client::flush`].
    out: Vec<u8>,
    ended: bool,
    sent: Recent,
    came: Recent,
    /// The most bytes that it can make the program hold: what it has sent and asked so far, as often as that is kept.
    may_hold: usize,
}

/// The status for the client that held the most when all together held too much.
const HELD_MOST: &str = "memory: this connection held the most";
/// A client that holds no more never gives way, whatever the others hold.
const MODEST: usize = 256 * 1024;
/// How often the bytes of a frame may be there at once: as they came, in a buffer that may be twice as long, as text, and as what was
/// read of it.
const COPIES: usize = 5;

impl Client {
    /// Connects. Over WebSocket it asks for every status, as there are over TCP.
    pub async fn connect(world: &Rc<World>, kind: &str, door: Door) -> Result<Self, Fault> {
        Self::with_buffer(world, kind, door, None).await
    }

    /// The same, with a receive buffer of about so many bytes.
    pub async fn with_buffer(
        world: &Rc<World>,
        kind: &str,
        door: Door,
        buffer: Option<u32>,
    ) -> Result<Self, Fault> {
        let name = format!("{kind} {}", world.number());
        let connecting = async {
            let socket = TcpSocket::new_v4()?;
            if let Some(size) = buffer {
                socket.set_recv_buffer_size(size)?;
            }
            let stream = socket.connect(world.address).await?;
            stream.set_nodelay(true)?;
            Ok::<_, std::io::Error>(stream)
        };
        let stream = tokio::time::timeout(PATIENCE, connecting)
            .await
            .map_err(|_| Fault::of(&name, "not accepted in time"))?
            .map_err(|error| Fault::of(&name, format!("not accepted: {error}")))?;
        world.count("connections", 1);
        let mut client = Self {
            name,
            world: Rc::clone(world),
            ledger: Ledger::default(),
            stream,
            door,
            codec: Codec::new(match door {
                Door::Tcp => Framing::Lines,
                Door::Web => Framing::WebSocket,
            }),
            chunk: vec![0; CHUNK],
            out: Vec::new(),
            ended: false,
            sent: Recent::default(),
            came: Recent::default(),
            may_hold: 0,
        };
        if door == Door::Web {
            client.shake_hands().await?;
        }
        Ok(client)
    }

    async fn shake_hands(&mut self) -> Result<(), Fault> {
        let hello = handshake(&self.world.address.to_string(), "/", "");
        self.send_bytes(hello.as_bytes()).await?;
        let deadline = Instant::now() + PATIENCE;
        loop {
            // Nothing comes before the client has asked for it.
            let next = self.codec.next_event();
            next.map_err(|why| self.fault(why.to_string()))?;
            if self.codec.is_open() {
                break;
            }
            if self.ended || !self.wait_readable(deadline).await? {
                return Err(self.fault("the handshake is not answered"));
            }
        }
        self.world.count("connections over WebSocket", 1);
        self.push(&json!({"op": "set_level", "level": "info"}));
        Ok(())
    }

    /// The door that it came through.
    pub fn door(&self) -> Door {
        self.door
    }

    /// A fault of this client, with what went before it.
    pub fn fault(&self, what: impl Into<String>) -> Fault {
        Fault {
            client: self.name.clone(),
            what: what.into(),
            sent: self.sent.frames(),
            came: self.came.frames(),
            gave_way: false,
        }
    }

    /// It asks for an answer of so many bytes.
    pub fn expect_bytes(&mut self, bytes: usize) {
        self.may_hold += bytes;
    }

    /// It is told that it held the most: rightly, if it can have held what it is told, and that is more than is modest.
    fn gives_way(&self, why: &str) -> Fault {
        let told = why
            .rsplit_once('(')
            .and_then(|(_, rest)| rest.split(' ').next()?.parse::<usize>().ok());
        let can = self.may_hold.div_ceil(1_000_000);
        let gave_way = self.may_hold > MODEST && told.is_some_and(|told| told <= can);
        let may_hold = self.may_hold;
        Fault {
            gave_way,
            ..self.fault(format!(
                "cut off, though it can hold {may_hold} bytes at most: {why}"
            ))
        }
    }

    /// A fault of a client that reads late. If it can hold more than is modest its stream may have ended before the end of a
    /// frame: it held the most, and who has not read the frame before can't be told.
    pub fn read_late(&self, fault: Fault) -> Fault {
        Fault {
            gave_way: fault.gave_way || (self.ended && self.may_hold > MODEST),
            ..fault
        }
    }

    /// Appends a frame to what goes out next.
    pub fn push(&mut self, frame: &Value) {
        self.push_text(&frame.to_string());
    }

    /// The same for a frame as text.
    pub fn push_text(&mut self, frame: &str) {
        self.sent.keep(frame);
        self.may_hold += COPIES * frame.len();
        self.world.count("frames sent", 1);
        self.codec.write(frame, &mut self.out);
    }

    /// Takes what would go out next.
    pub fn take_out(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.out)
    }

    /// Appends a call and notes what has to come back; `extra` are further fields of the frame, such as `timeout`.
    pub fn push_call(
        &mut self,
        service: &str,
        args: Value,
        extra: Value,
        ordered: bool,
        check: Check,
    ) {
        let number = self.world.number();
        // Ids of every kind: they come back as they went.
        let id = match number % 4 {
            0 => json!(number),
            1 => json!([self.name, number]),
            2 => json!({"n": number}),
            _ => json!(format!("{}/{number}", self.name)),
        };
        let mut frame = json!({"op": "call_service", "service": service, "id": id, "args": args});
        if let (Some(frame), Some(extra)) = (frame.as_object_mut(), extra.as_object()) {
            frame.extend(extra.clone());
        }
        self.ledger.ask(&id, service, ordered, check);
        self.world.count("calls asked", 1);
        self.push(&frame);
    }

    /// Sends what was appended.
    pub async fn flush(&mut self) -> Result<(), Fault> {
        let out = self.take_out();
        self.send_bytes(&out).await
    }

    /// Sends bytes as they are, and takes in what comes meanwhile: the program need not read whoever does not.
    pub async fn send_bytes(&mut self, mut bytes: &[u8]) -> Result<(), Fault> {
        let deadline = Instant::now() + PATIENCE;
        while !bytes.is_empty() {
            let interest = if self.ended {
                Interest::WRITABLE
            } else {
                Interest::READABLE | Interest::WRITABLE
            };
            let ready = timeout_at(deadline.into(), self.stream.ready(interest)).await;
            let Ok(Ok(ready)) = ready else {
                return Err(self.fault("the program takes nothing more"));
            };
            if ready.is_readable() && !self.ended {
                self.take_in();
            }
            if ready.is_writable() {
                match self.stream.try_write(bytes) {
                    Ok(written) => {
                        self.world.count("bytes sent", written as u64);
                        bytes = &bytes[written..];
                    }
                    Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                    Err(error) => {
                        let why = self.why_it_ended();
                        return Err(
                            why.unwrap_or_else(|| self.fault(format!("cannot send: {error}")))
                        );
                    }
                }
            }
        }
        Ok(())
    }

    /// Sends without reading anything; how many bytes were taken within `time`.
    pub async fn send_deaf(&mut self, bytes: &[u8], time: Duration) -> usize {
        let mut written = 0;
        let deadline = Instant::now() + time;
        while written < bytes.len() {
            match timeout_at(deadline.into(), self.stream.write(&bytes[written..])).await {
                Ok(Ok(more)) => written += more,
                Ok(Err(_)) | Err(_) => break,
            }
        }
        self.world.count("bytes sent", written as u64);
        written
    }

    fn take_in(&mut self) {
        match self.stream.try_read(&mut self.chunk) {
            Ok(0) => self.ended = true,
            Ok(read) => {
                self.codec.push(&self.chunk[..read]);
                self.world.count("bytes received", read as u64);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(_) => self.ended = true,
        }
    }

    /// Why the program has ended the connection, if it gave way for memory: what had come before can still be read.
    fn why_it_ended(&mut self) -> Option<Fault> {
        while !self.ended {
            let before = self.codec.pending().len();
            self.take_in();
            if self.codec.pending().len() == before {
                break;
            }
        }
        while let Ok(Some(event)) = self.codec.next_event() {
            if let Event::Text(text) = event
                && let Ok(frame) = serde_json::from_str::<Value>(&text)
                && let Some(why) = frame["msg"].as_str()
                && why.starts_with(HELD_MOST)
            {
                return Some(self.gives_way(why));
            }
        }
        None
    }

    /// Waits for bytes; false if none came until `deadline`.
    async fn wait_readable(&mut self, deadline: Instant) -> Result<bool, Fault> {
        let readable = self.is_readable(deadline).await?;
        if readable {
            self.take_in();
        }
        Ok(readable)
    }

    /// Waits for bytes and leaves them where they are; false if none came until `deadline`.
    pub async fn is_readable(&mut self, deadline: Instant) -> Result<bool, Fault> {
        match timeout_at(deadline.into(), self.stream.readable()).await {
            Ok(Ok(())) => Ok(true),
            Ok(Err(error)) => Err(self.fault(format!("cannot read: {error}"))),
            Err(_) => Ok(false),
        }
    }

    /// At most so many bytes of what has come so far, thrown away: a slow reader reads like that.
    pub fn sip(&mut self, most: usize) -> usize {
        let mut buffer = vec![0; most];
        match self.stream.try_read(&mut buffer) {
            Ok(0) => {
                self.ended = true;
                0
            }
            Ok(read) => {
                buffer.truncate(read);
                self.world.count("bytes received", read as u64);
                self.codec.push(&buffer);
                read
            }
            Err(error) => {
                self.ended |= error.kind() != ErrorKind::WouldBlock;
                0
            }
        }
    }

    /// Whether the stream has ended, with all of it read.
    pub fn is_over(&self) -> bool {
        self.ended
    }

    /// The next frame within `patience`; responses are settled on the way.
    pub async fn next(&mut self, patience: Duration) -> Result<Came, Fault> {
        let deadline = Instant::now() + patience;
        loop {
            if let Some(came) = self.take_frame().await? {
                return Ok(came);
            }
            if self.ended {
                return Ok(Came::End);
            }
            if !self.wait_readable(deadline).await? {
                return Ok(Came::Nothing);
            }
        }
    }

    /// A frame of what has come already.
    async fn take_frame(&mut self) -> Result<Option<Came>, Fault> {
        let text = loop {
            let next = self.codec.next_event();
            match next.map_err(|why| self.fault(why.to_string()))? {
                None => return Ok(None),
                Some(Event::Text(text)) => break text,
                Some(Event::Binary(_)) => return Ok(Some(Came::Binary)),
                Some(Event::Ping(payload)) => {
                    let mut pong = Vec::new();
                    append(&mut pong, LAST | opcode::PONG, [0, 0, 0, 7], &payload);
                    self.send_bytes(&pong).await?;
                    self.world.count("pings answered", 1);
                }
                Some(Event::Pong(_)) => {}
                Some(Event::Close(..)) => self.ended = true,
            }
        };
        self.came.keep(&text);
        self.world.count("frames received", 1);
        let frame: Value = serde_json::from_str(&text).map_err(|error| {
            self.fault(format!("{} bytes that are no JSON: {error}", text.len()))
        })?;
        if let Some(why) = frame["msg"]
            .as_str()
            .filter(|why| why.starts_with(HELD_MOST))
        {
            return Err(self.gives_way(why));
        }
        if frame["op"] != "service_response" {
            return Ok(Some(Came::Other(frame)));
        }
        self.ledger.settle(&frame).map_err(|why| self.fault(why))?;
        self.world.count("calls answered and checked", 1);
        Ok(Some(Came::Answer(frame)))
    }

    /// Stops sending; what is owed still comes.
    pub async fn shut_down(&mut self) -> Result<(), Fault> {
        self.stream
            .shutdown()
            .await
            .map_err(|error| self.fault(format!("cannot shut down: {error}")))
    }

    /// Throws away what comes; the number of bytes up to the end, or an error where neither a byte nor the end comes for
    /// so long. Megabytes through a small buffer take their time on a busy machine.
    pub async fn swallow(&mut self, patience: Duration) -> Result<usize, Fault> {
        let mut swallowed = 0;
        loop {
            swallowed += self.codec.discard();
            if self.ended {
                return Ok(swallowed);
            }
            if !self.wait_readable(Instant::now() + patience).await? {
                let why = format!("no end of the connection after {swallowed} bytes");
                return Err(self.fault(why));
            }
        }
    }

    /// Goes with a reset instead of an orderly end.
    pub fn reset(self) {
        let _ = self.stream.set_zero_linger();
        self.world.count("connections reset", 1);
    }
}
