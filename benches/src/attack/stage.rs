//! Plays hostile clients on real sockets: all of them behind one `epoll`, on the thread that asks for it.
//!
//! **Invariant:** bounded by the script: its number of connections at once, at one address of loopback.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, SocketAddr};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use mio::net::TcpStream;
use mio::{Events, Interest, Poll, Token};

use super::script::{Client, Door, Ear, Exit};
use pendularm_client::websocket;

/// Bytes that one client may send or read before it is another's turn.
const TURN: usize = 256 * 1024;
/// Interval of the checks for slow sending, slow reading and due connections.
const SWEEP: Duration = Duration::from_millis(5);
/// Bytes of replies that wait to be sent before more is read.
const REPLIES: usize = 8 * 1024 * 1024;
/// Between two sips.
const SIP: Duration = Duration::from_millis(100);
/// Connections of one play, including repeated ones. Loopback has a limited number of ports.
const MAX_CONNECTIONS: u64 = 20_000;
/// Time between two attempts of a client that reconnects and is refused at once.
const RETURN: Duration = Duration::from_millis(10);
/// Connections made in one sweep: a listener's queue holds some hundreds, and what overflows comes a second later.
const CONNECTS: usize = 20;

/// The actions so far, for a thread that reports them.
#[derive(Default)]
pub struct Deeds {
    pub connections: AtomicU64,
    pub sent: AtomicU64,
    pub received: AtomicU64,
}

/// A client on the stage.
struct Player<'a> {
    client: &'a Client,
    stream: Option<TcpStream>,
    opening: Vec<u8>,
    /// Bytes sent of the opening and of the part that is sent once.
    said: usize,
    /// Position in the repeated bytes.
    at: usize,
    /// Bytes that it may still send in this interval.
    allowance: usize,
    replies: VecDeque<u8>,
    /// Input that is not replied to.
    unread: Vec<u8>,
    writable: bool,
    readable: bool,
    /// It can send or read at once.
    is_busy: bool,
    thirsty: bool,
    next_drip: Instant,
    next_sip: Instant,
    /// When it connects, or goes.
    due: Option<Instant>,
}

/// Plays the clients until `over`. Then the connections end.
pub fn play(cast: &[Client], address: SocketAddr, deeds: &Deeds, over: impl Fn() -> bool) {
    let began = Instant::now();
    let (Ok(mut poll), mut events) = (Poll::new(), Events::with_capacity(1024)) else {
        return;
    };
    let mut players: Vec<Player> = cast
        .iter()
        .map(|client| Player::new(client, address, began))
        .collect();
    let mut chunk = vec![0; TURN];
    let mut swept = began - SWEEP;
    while !over() {
        let wait = if players.iter().any(|player| player.is_busy) {
            Duration::ZERO
        } else {
            SWEEP
        };
        if poll
            .poll(&mut events, Some(wait))
            .is_err_and(|error| error.kind() != ErrorKind::Interrupted)
        {
            return;
        }
        for event in &events {
            let Token(number) = event.token();
            let player = &mut players[number];
            player.writable |= event.is_writable();
            player.readable |= event.is_readable();
            player.is_busy = true;
            if event.is_error() || event.is_read_closed() && event.is_write_closed() {
                player.end(Instant::now());
            }
        }
        let now = Instant::now();
        if now >= swept + SWEEP {
            swept = now;
            let mut connects = CONNECTS;
            for (number, player) in players.iter_mut().enumerate() {
                if player.connects(now) {
                    if connects > 0 {
                        connects -= 1;
                        player.connect(number, address, &poll, deeds);
                    }
                } else {
                    player.is_busy |= player.sweep(now);
                }
            }
        }
        for player in players.iter_mut().filter(|player| player.is_busy) {
            player.is_busy = player.turn(&mut chunk, deeds);
        }
    }
}

impl<'a> Player<'a> {
    fn new(client: &'a Client, address: SocketAddr, began: Instant) -> Self {
        let opening = match &client.door {
            Door::Tcp => String::new(),
            Door::Web => websocket::handshake(&address.to_string(), "/", ""),
            Door::Http(line) => format!("{line}Host: {address}\r\n"),
        };
        Self {
            client,
            stream: None,
            opening: opening.into_bytes(),
            said: 0,
            at: 0,
            allowance: 0,
            replies: VecDeque::new(),
            unread: Vec::new(),
            writable: false,
            readable: false,
            is_busy: false,
            thirsty: false,
            next_drip: began,
            next_sip: began,
            due: Some(began + client.after),
        }
    }

    /// Whether it is due to connect.
    fn connects(&self, now: Instant) -> bool {
        self.stream.is_none() && self.due.is_some_and(|due| due <= now)
    }

    fn connect(&mut self, number: usize, address: SocketAddr, poll: &Poll, deeds: &Deeds) {
        self.due = None;
        if deeds.connections.load(Ordering::Relaxed) >= MAX_CONNECTIONS {
            return;
        }
        let open = || {
            let mut stream = TcpStream::connect(address)?;
            poll.registry().register(
                &mut stream,
                Token(number),
                Interest::READABLE | Interest::WRITABLE,
            )?;
            stream.set_nodelay(true)?;
            Ok::<_, std::io::Error>(stream)
        };
        let Ok(stream) = open() else {
            self.due = Some(Instant::now() + SIP);
            return;
        };
        deeds.connections.fetch_add(1, Ordering::Relaxed);
        (
            self.stream,
            self.said,
            self.at,
            self.writable,
            self.readable,
        ) = (Some(stream), 0, 0, false, false);
        self.replies.clear();
        self.unread.clear();
        if self.client.exit.0 == Exit::ClosesOnTime {
            self.due = Some(Instant::now() + self.client.exit.1);
        }
    }

    /// Does all due actions. Returns whether it can send or read more.
    fn sweep(&mut self, now: Instant) -> bool {
        if self.due.is_some_and(|due| due <= now) {
            self.due = None;
            match (self.client.exit.0, &self.stream) {
                (Exit::Closes | Exit::ClosesOnTime, _) => self.end(now),
                (Exit::Halves, Some(stream)) => drop(stream.shutdown(Shutdown::Write)),
                _ => {}
            }
        }
        let mut more = false;
        if let Some((bytes, pause)) = self.client.drip.filter(|_| now >= self.next_drip) {
            (self.allowance, self.next_drip, more) = (bytes, now + pause, true);
        }
        if matches!(self.client.ear, Ear::Sips(_)) && now >= self.next_sip {
            (self.next_sip, self.thirsty, more) = (now + SIP, true, true);
        }
        more && self.stream.is_some()
    }

    /// Closes. A client that reconnects is due again.
    fn end(&mut self, now: Instant) {
        self.stream = None;
        self.due = self.client.returns.then_some(now + RETURN);
    }

    /// Reads and sends for a while. Returns whether it can continue at once.
    fn turn(&mut self, chunk: &mut [u8], deeds: &Deeds) -> bool {
        if self.stream.is_none() {
            return false;
        }
        let silent = self.opening.is_empty() && self.client.first.is_empty();
        if silent && self.writable && self.due.is_none() {
            self.has_said_all();
        }
        let read_more = self.read(chunk, deeds);
        let mut budget = TURN;
        while self.writable && budget > 0 {
            let Some(sent) = self.send(budget) else { break };
            deeds.sent.fetch_add(sent as u64, Ordering::Relaxed);
            budget = budget.saturating_sub(sent);
        }
        self.stream.is_some() && (read_more || self.writable && budget == 0)
    }

    /// Reads by its script. Returns whether there may be more.
    fn read(&mut self, chunk: &mut [u8], deeds: &Deeds) -> bool {
        let (awake, most) = match self.client.ear {
            Ear::Deaf => (false, 0),
            Ear::Reads => (true, chunk.len()),
            Ear::Sips(bytes) => (std::mem::take(&mut self.thirsty), bytes.min(chunk.len())),
            Ear::Replies(reply) => (!self.reply(reply), chunk.len()),
        };
        if !awake {
            return false;
        }
        let Some(stream) = self.stream.as_mut().filter(|_| self.readable) else {
            return false;
        };
        match stream.read(&mut chunk[..most]) {
            Ok(0) => self.end(Instant::now()),
            Ok(read) => {
                deeds.received.fetch_add(read as u64, Ordering::Relaxed);
                if let Ear::Replies(_) = self.client.ear {
                    self.unread.extend_from_slice(&chunk[..read]);
                }
                return !matches!(self.client.ear, Ear::Sips(_));
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => self.readable = false,
            Err(_) => self.end(Instant::now()),
        }
        false
    }

    /// Replies to received lines, unless too many replies wait. Returns whether lines are left.
    fn reply(&mut self, reply: fn(&str) -> Option<Vec<u8>>) -> bool {
        while let Some(end) = self.unread.iter().position(|byte| *byte == b'\n') {
            if self.replies.len() > REPLIES {
                return true;
            }
            let line: Vec<u8> = self.unread.drain(..=end).collect();
            self.replies
                .extend(reply(&String::from_utf8_lossy(&line)).into_iter().flatten());
        }
        false
    }

    /// Sends some of the next bytes. Returns their number, `None` if there are none or none can be sent.
    fn send(&mut self, most: usize) -> Option<usize> {
        let client = self.client;
        let (first, said) = (&client.first, self.said);
        let once = self.opening.len() + first.len();
        let bytes = if said < self.opening.len() {
            &self.opening[said..]
        } else if said < once {
            &first[said - self.opening.len()..]
        } else if !self.replies.is_empty() {
            self.replies.as_slices().0
        } else if !client.again.is_empty() {
            &client.again[self.at..]
        } else {
            return None;
        };
        let dripping = client.drip.is_some() && said >= self.opening.len();
        let most = if dripping {
            most.min(self.allowance)
        } else {
            most
        };
        let bytes = &bytes[..bytes.len().min(most)];
        if bytes.is_empty() {
            return None;
        }
        match self.stream.as_mut()?.write(bytes) {
            Ok(sent) => {
                if dripping {
                    self.allowance -= sent;
                }
                if said < once {
                    self.said += sent;
                } else if !self.replies.is_empty() {
                    self.replies.drain(..sent);
                } else {
                    self.at = (self.at + sent) % client.again.len();
                }
                if said < once && self.said == once {
                    self.has_said_all();
                }
                Some(sent)
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                self.writable = false;
                None
            }
            Err(_) => {
                self.end(Instant::now());
                None
            }
        }
    }

    fn has_said_all(&mut self) {
        if matches!(self.client.exit.0, Exit::Closes | Exit::Halves) {
            self.due = Some(Instant::now() + self.client.exit.1);
        }
    }
}
