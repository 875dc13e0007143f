//! A hostile client, as data: its protocol, its bytes sent once and repeatedly, its reading, and its end.
//!
//! **Invariant:** a script has only bytes. [`stage`](super::stage) has the sockets and the clock.

use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use pendularm_client::websocket::{LAST, append, opcode};

pub const KIB: usize = 1024;
pub const MIB: usize = 1024 * KIB;
/// A frame of almost the longest accepted length.
pub const LONG: usize = 4 * MIB - KIB;
/// Almost the largest number of registrations, or waiting calls, of one client with names of up to 13 bytes.
pub const MOST: usize = 180;

/// The first bytes of a client.
#[derive(Clone, PartialEq, Eq)]
pub enum Door {
    /// Nothing: lines, or any bytes of the script.
    Tcp,
    /// The handshake of a WebSocket; its later texts follow as messages.
    Web,
    /// A request line. The stage adds the line `Host:`, and the client sends the rest.
    Http(String),
}

/// Whether it reads.
#[derive(Clone, Copy)]
pub enum Ear {
    /// Nothing, ever.
    Deaf,
    /// All bytes, and discards them.
    Reads,
    /// This many bytes every 100 ms.
    Sips(usize),
    /// Lines, and sends the function's result for each.
    Replies(fn(&str) -> Option<Vec<u8>>),
}

/// How it goes.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// Not by itself.
    Stays,
    /// Closes some time after it has sent everything; with unread bytes the system makes a reset of it.
    Closes,
    /// Closes some time after it has connected.
    ClosesOnTime,
    /// Stops sending and stays.
    Halves,
}

/// One client. It is built by chained methods, so an attack is a list of its clients' actions.
#[derive(Clone)]
pub struct Client {
    pub(super) door: Door,
    pub(super) ear: Ear,
    /// Sent once.
    pub(super) first: Arc<Vec<u8>>,
    /// Sent after that, over and over.
    pub(super) again: Arc<Vec<u8>>,
    /// At most this many bytes per interval. Without it, as many as the server accepts.
    pub(super) drip: Option<(usize, Duration)>,
    /// When it connects, from the beginning of the attack.
    pub(super) after: Duration,
    /// How it goes once `first` is sent, and how long after that.
    pub(super) exit: (Exit, Duration),
    /// Reconnects whenever its connection has ended.
    pub(super) returns: bool,
}

impl Client {
    /// A client that connects, sends nothing, and reads everything.
    fn through(door: Door) -> Self {
        Self {
            door,
            ear: Ear::Reads,
            first: Arc::default(),
            again: Arc::default(),
            drip: None,
            after: Duration::ZERO,
            exit: (Exit::Stays, Duration::ZERO),
            returns: false,
        }
    }

    /// Over raw TCP.
    pub fn tcp() -> Self {
        Self::through(Door::Tcp)
    }

    /// Over WebSocket.
    pub fn web() -> Self {
        Self::through(Door::Web)
    }

    /// With an HTTP request of that method and target. The script must send the end of the head.
    pub fn http(request: &str) -> Self {
        Self::through(Door::Http(format!("{request} HTTP/1.1\r\n")))
    }

    /// Sends a frame once.
    pub fn says(self, frame: &str) -> Self {
        let bytes = self.framed(frame);
        self.says_bytes(&bytes)
    }

    /// Sends a frame once for each number.
    pub fn says_each(self, numbers: Range<usize>, frame: impl Fn(usize) -> String) -> Self {
        numbers.fold(self, |client, number| client.says(&frame(number)))
    }

    /// Sends bytes once, unchanged.
    pub fn says_bytes(mut self, bytes: &[u8]) -> Self {
        Arc::make_mut(&mut self.first).extend(bytes);
        self
    }

    /// Becomes a publisher of a topic.
    pub fn advertises(self, topic: &str) -> Self {
        self.says(&on_topic("advertise", topic))
    }

    /// Sends a frame repeatedly, after the frames that are already repeated.
    pub fn repeats(self, frame: &str) -> Self {
        let bytes = self.framed(frame);
        self.repeats_bytes(&bytes)
    }

    /// Sends a frame for each number, and begins again.
    pub fn repeats_each(self, numbers: Range<usize>, frame: impl Fn(usize) -> String) -> Self {
        numbers.fold(self, |client, number| client.repeats(&frame(number)))
    }

    /// Sends bytes repeatedly.
    pub fn repeats_bytes(mut self, bytes: &[u8]) -> Self {
        Arc::make_mut(&mut self.again).extend(bytes);
        self
    }

    /// Sends a short message many times in one write, as floods do.
    pub fn floods(self, frame: &str) -> Self {
        let bytes = self.framed(frame);
        let times = (64 * KIB / bytes.len()).max(1);
        self.repeats_bytes(&bytes.repeat(times))
    }

    /// Sends at most this number of bytes every `pause`.
    pub fn drips(mut self, bytes: usize, pause: Duration) -> Self {
        self.drip = Some((bytes, pause));
        self
    }

    /// Reads nothing.
    pub fn deaf(mut self) -> Self {
        self.ear = Ear::Deaf;
        self
    }

    /// Reads `bytes` bytes ten times a second.
    pub fn sips(mut self, bytes: usize) -> Self {
        self.ear = Ear::Sips(bytes);
        self
    }

    /// Answers lines. Only for a client that repeats nothing, so no answer interrupts a frame.
    pub fn replies(mut self, reply: fn(&str) -> Option<Vec<u8>>) -> Self {
        self.ear = Ear::Replies(reply);
        self
    }

    /// Connects `milliseconds` after the others.
    pub fn after(mut self, milliseconds: u64) -> Self {
        self.after = Duration::from_millis(milliseconds);
        self
    }

    /// Closes `milliseconds` after it has sent everything.
    pub fn leaves_after(mut self, milliseconds: u64) -> Self {
        self.exit = (Exit::Closes, Duration::from_millis(milliseconds));
        self
    }

    /// Closes `milliseconds` after it has connected, whether it has sent everything or not.
    pub fn stays_for(mut self, milliseconds: u64) -> Self {
        self.exit = (Exit::ClosesOnTime, Duration::from_millis(milliseconds));
        self
    }

    /// Stops sending after its last bytes, and stays connected.
    pub fn half_closes(mut self) -> Self {
        self.exit = (Exit::Halves, Duration::ZERO);
        self
    }

    /// Reconnects whenever its connection has ended.
    pub fn returns(mut self) -> Self {
        self.returns = true;
        self
    }

    /// This much of it.
    pub fn times(self, count: usize) -> Vec<Self> {
        vec![self; count]
    }

    fn framed(&self, frame: &str) -> Vec<u8> {
        match self.door {
            Door::Web => web_frame(opcode::TEXT, true, frame.as_bytes()),
            Door::Tcp | Door::Http(_) => format!("{frame}\n").into_bytes(),
        }
    }
}

/// A masked WebSocket frame.
pub fn web_frame(kind: u8, last: bool, payload: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(payload.len() + 14);
    let first = if last { LAST | kind } else { kind };
    append(&mut out, first, [0x5b, 0xd1, 0xe9, 0x95], payload);
    out
}

/// One client for each number.
pub fn each(numbers: Range<usize>, client: impl Fn(usize) -> Client) -> Vec<Client> {
    numbers.map(client).collect()
}

/// A call of a service with those arguments, as JSON; `id` too.
pub fn call(service: &str, id: &str, args: &str) -> String {
    format!(r#"{{"op":"call_service","service":"{service}","id":{id},"args":{args}}}"#)
}

/// A call without arguments, the lightest request.
pub fn light(service: &str) -> String {
    call(service, "1", "{}")
}

/// A message, as JSON.
pub fn publish(topic: &str, msg: &str) -> String {
    format!(r#"{{"op":"publish","topic":"{topic}","msg":{msg}}}"#)
}

/// A subscription with further fields, such as `,"throttle_rate":5`.
pub fn subscribe(topic: &str, further: &str) -> String {
    format!(r#"{{"op":"subscribe","topic":"{topic}"{further}}}"#)
}

/// An operation on a topic.
pub fn on_topic(op: &str, topic: &str) -> String {
    format!(r#"{{"op":"{op}","topic":"{topic}"}}"#)
}

/// An operation on a service.
pub fn on_service(op: &str, service: &str) -> String {
    format!(r#"{{"op":"{op}","service":"{service}"}}"#)
}

/// Two numbers that are slow to convert: twenty digits near the middle between two doubles.
pub const SLOW: &str = "10000000000000001268e281,10000000000000001268e281";

/// A string of `bytes` bytes, without its quotes.
pub fn filler(bytes: usize) -> String {
    "x".repeat(bytes)
}
