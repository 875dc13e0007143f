//! A client on an in-memory pipe: plain, or behind a WebSocket. Reading and writing run by themselves.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream, ReadHalf, WriteHalf, split};
use tokio::sync::Notify;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::task::JoinHandle;

use pendularm_client::codec::{Codec, Event, Framing};
use pendularm_client::websocket::{LAST, append, append_close, append_message, handshake, opcode};

/// The client's end of a connection.
pub struct Client {
    out: UnboundedSender<Outgoing>,
    line: Rc<Line>,
    tasks: [JoinHandle<()>; 2],
}

enum Outgoing {
    Bytes(Vec<u8>),
    End,
}

struct Line {
    codec: RefCell<Codec>,
    ended: Cell<bool>,
    paused: Cell<bool>,
    resumed: Notify,
}

impl Client {
    /// A client of this end of a pipe; `piece` bytes are written at a time.
    #[must_use]
    pub fn new(framing: Framing, stream: DuplexStream, piece: usize) -> Self {
        let (input, output) = split(stream);
        let line = Rc::new(Line {
            codec: RefCell::new(Codec::new(framing)),
            ended: Cell::new(false),
            paused: Cell::new(false),
            resumed: Notify::new(),
        });
        let (out, queue) = unbounded_channel();
        let reading = actix::spawn(read(input, Rc::clone(&line)));
        let writing = actix::spawn(write(output, queue, piece.max(1)));
        let client = Self {
            out,
            line,
            tasks: [reading, writing],
        };
        if framing == Framing::WebSocket {
            client.send_bytes(handshake("127.0.0.1:9095", "/", "").into_bytes());
        }
        client
    }

    /// How its frames are separated.
    #[must_use]
    pub fn framing(&self) -> Framing {
        self.line.codec.borrow().framing()
    }

    /// Sends bytes unchanged.
    pub fn send_bytes(&self, bytes: Vec<u8>) {
        // Its end may have closed already.
        let _ = self.out.send(Outgoing::Bytes(bytes));
    }

    /// Sends a frame. `style` selects the line end or the pieces.
    pub fn send(&self, frame: &str, style: u8) {
        self.send_bytes(self.encode(frame, style));
    }

    /// The bytes of a frame in that style.
    #[must_use]
    pub fn encode(&self, frame: &str, style: u8) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(frame.len() + 16);
        match self.framing() {
            Framing::Lines => {
                bytes.extend_from_slice(frame.as_bytes());
                let end = ["\n", "\r\n", "", " \n\n\t"][usize::from(style) % 4];
                bytes.extend_from_slice(end.as_bytes());
            }
            Framing::WebSocket => {
                let kind = if style & 1 == 0 {
                    opcode::TEXT
                } else {
                    opcode::BINARY
                };
                let piece = [0, 1, 7, 100][usize::from(style >> 1) % 4];
                let mask = [style, style.rotate_left(3), 0x5a, 0];
                append_message(&mut bytes, kind, mask, piece, frame.as_bytes());
            }
        }
        bytes
    }

    /// Ends sending: by the stream's end, or by a close frame.
    pub fn finish(&self) {
        if self.framing() == Framing::WebSocket {
            let mut bytes = Vec::new();
            append_close(&mut bytes, [1, 2, 3, 4], 1000, "");
            self.send_bytes(bytes);
        }
        let _ = self.out.send(Outgoing::End);
    }

    /// Stops or continues reading.
    pub fn pause(&self, paused: bool) {
        self.line.paused.set(paused);
        self.line.resumed.notify_one();
    }

    /// Whether it has stopped reading.
    #[must_use]
    pub fn is_paused(&self) -> bool {
        self.line.paused.get()
    }

    /// Whether the runtime has ended the stream.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.line.ended.get()
    }

    /// Whether the handshake is complete.
    #[must_use]
    pub fn is_greeted(&self) -> bool {
        self.line.codec.borrow().is_open()
    }

    /// Whether no message is incomplete, for a stream that has ended.
    #[must_use]
    pub fn ended_in_order(&self) -> bool {
        self.line.codec.borrow().is_between_messages()
    }

    /// The remaining bytes, for a message.
    #[must_use]
    pub fn rest(&self) -> String {
        format!("{:?}", self.line.codec.borrow())
    }

    /// Discards everything received since.
    pub fn take_anything(&self) {
        self.line.codec.borrow_mut().discard();
    }

    /// Takes everything received since. Pings are answered.
    #[must_use]
    pub fn take(&self) -> Vec<Event> {
        let mut codec = self.line.codec.borrow_mut();
        let mut received = Vec::new();
        while let Some(event) = codec.next_event().expect("what a server may send") {
            if let Event::Ping(payload) = &event {
                let mut pong = Vec::new();
                append(&mut pong, LAST | opcode::PONG, [9; 4], payload);
                self.send_bytes(pong);
            }
            received.push(event);
        }
        received
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        for task in &self.tasks {
            task.abort();
        }
    }
}

async fn read(mut input: ReadHalf<DuplexStream>, line: Rc<Line>) {
    let mut chunk = vec![0; 4096];
    loop {
        while line.paused.get() {
            line.resumed.notified().await;
        }
        match input.read(&mut chunk).await {
            Ok(0) | Err(_) => break,
            Ok(read) => line.codec.borrow_mut().push(&chunk[..read]),
        }
    }
    line.ended.set(true);
}

async fn write(
    mut output: WriteHalf<DuplexStream>,
    mut queue: UnboundedReceiver<Outgoing>,
    piece: usize,
) {
    while let Some(next) = queue.recv().await {
        let Outgoing::Bytes(bytes) = next else {
            let _ = output.shutdown().await;
            return;
        };
        for part in bytes.chunks(piece) {
            if output.write_all(part).await.is_err() {
                return;
            }
            tokio::task::yield_now().await;
        }
    }
}
