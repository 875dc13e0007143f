//! Flow control by the bytes that a client has read.
//!
//! Bytes in a client's socket get old, and cannot be dropped. The buffers of Linux hold 15 s of `/joint_states`. So a
//! client slower than its topics is sent only as much as it reads in `AHEAD`. The rest is dropped before it is
//! written. If a client's unread bytes are unknown, its socket's buffers are the only limit. A client that reads all
//! its bytes within `SLOW_AGE` is never delayed.
//!
//! Linux returns the unread bytes of a client on the same machine: `NETLINK_SOCK_DIAG` describes one socket in some
//! microseconds, the client's socket too (`man 7 sock_diag`).
//!
//! **Invariant:** once a query for a client fails, its unread bytes are not queried again, and nothing is held back.

use std::collections::VecDeque;
use std::net::{Ipv4Addr, SocketAddr};
use std::time::Duration;

use tokio::time::Instant;

pub(super) use self::sockets::has_closed;
use crate::protocol::outbox::MAX_AGE;

/// The two addresses of a client's connection. If one is unknown, the client counts as local.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ends {
    /// The runtime's.
    pub local: SocketAddr,
    /// The client's.
    pub peer: SocketAddr,
}

/// Unknown ends, as of a local client.
impl Default for Ends {
    fn default() -> Self {
        SocketAddr::from((Ipv4Addr::LOCALHOST, 0)).into()
    }
}

/// A local client.
impl From<SocketAddr> for Ends {
    fn from(local: SocketAddr) -> Self {
        let peer = local;
        Self { local, peer }
    }
}

/// Returns the bytes that a client has not read, if that is known.
pub type UnreadSource = Box<dyn FnMut() -> Option<usize>>;

/// The source for a client with these ends.
pub(super) fn between(ends: Ends) -> UnreadSource {
    let mut is_known = true;
    Box::new(move || {
        let unread = is_known.then(|| sockets::unread(ends)).flatten();
        is_known = unread.is_some();
        unread
    })
}

/// Nothing more is written once a byte has been unread for this time. Python reads 8 KiB at a time, which is half a
/// second of messages to a client that reads at half the rate.
const SLOW_AGE: Duration = Duration::from_millis(100);
/// A slow client is sent as much as it reads in this time.
const AHEAD: Duration = Duration::from_millis(200);
/// Largest age of a topic message ahead of a response, for a client that is far behind.
pub(super) const FRESH: Duration = Duration::from_millis(200);
/// Time between two queries of the client's unread bytes: after a query that found none, after one that found some, and
/// while the client is slow. A query takes two system calls.
const QUERY_INTERVAL_IDLE: Duration = Duration::from_millis(300);
const QUERY_INTERVAL: Duration = Duration::from_millis(100);
const QUERY_INTERVAL_SLOW: Duration = Duration::from_millis(50);
/// A slow client that reads all bytes within this time gets twice as much.
const KEEPS_UP: Duration = Duration::from_millis(25);
/// Window of the measured read rate. Also the time for which a client counts as slow.
const RATE_WINDOW: Duration = Duration::from_secs(1);
/// Bytes written within this time share one entry of the history.
const HISTORY_STEP: Duration = Duration::from_millis(20);
/// Most entries of the write history, which is 5 s of writing.
const MAX_HISTORY: usize = 256;

/// Counts bytes that were written to a client, and the bytes that it has read.
pub(super) struct FlowControl {
    source: UnreadSource,
    /// Bytes written so far.
    written: u64,
    /// For each range of bytes that may be unread: its end, and the time when its first byte was written.
    history: VecDeque<(u64, Instant)>,
    /// The time and the bytes read so far, for each query of the last second.
    read: VecDeque<(Instant, u64)>,
    /// Time of the next query.
    next: Instant,
    /// The client counts as slow until this time.
    slow_until: Option<Instant>,
    /// Bytes that a slow client may have unread.
    window: u64,
    /// Bytes that may be written before the next query.
    room: u64,
    /// Age of the oldest unread byte at the last query.
    age: Duration,
}

impl FlowControl {
    pub(super) fn new(source: UnreadSource, now: Instant) -> Self {
        Self {
            source,
            written: 0,
            history: VecDeque::new(),
            read: VecDeque::new(),
            next: now,
            slow_until: None,
            window: 0,
            room: u64::MAX,
            age: Duration::ZERO,
        }
    }

    /// Notes that `bytes` have been written.
    pub(super) fn note_written(&mut self, bytes: usize, now: Instant) {
        let bytes = bytes as u64;
        self.written += bytes;
        self.room = self.room.saturating_sub(bytes);
        let is_full = self.history.len() >= MAX_HISTORY;
        match self.history.back_mut() {
            Some((end, first)) if is_full || now < *first + HISTORY_STEP => *end = self.written,
            _ => self.history.push_back((self.written, now)),
        }
    }

    /// Bytes of topic messages that may be written now. A limit is updated at [`next_query`](Self::next_query).
    pub(super) fn room(&mut self, now: Instant) -> usize {
        if now >= self.next {
            self.query(now);
        }
        usize::try_from(self.room).unwrap_or(usize::MAX)
    }

    /// Whether the client still reads bytes that were written more than a second ago.
    pub(super) fn is_far_behind(&self) -> bool {
        self.age > MAX_AGE
    }

    /// Age of the oldest unread byte at the last query.
    pub(super) const fn age(&self) -> Duration {
        self.age
    }

    /// The time of the next query, if nothing may be written before it.
    pub(super) fn next_query(&self) -> Option<Instant> {
        (self.room == 0).then_some(self.next)
    }

    fn query(&mut self, now: Instant) {
        self.next = now + QUERY_INTERVAL;
        let Some(unread) = (self.source)() else {
            self.room = u64::MAX;
            return;
        };
        let unread = (unread as u64).min(self.written);
        let read = self.written - unread;
        let is_read = |stretch: &&(u64, Instant)| stretch.0 <= read;
        let count = self.history.iter().take_while(is_read).count();
        self.history.drain(..count);
        let oldest = self.history.front();
        let age = oldest.map_or(Duration::ZERO, |(_, first)| now.duration_since(*first));
        self.age = age;
        let is_old = |(time, _): &(Instant, u64)| now.duration_since(*time) > RATE_WINDOW;
        while self.read.front().is_some_and(is_old) {
            self.read.pop_front();
        }
        self.read.push_back((now, read));
        if age > SLOW_AGE {
            self.slow_until = Some(now + RATE_WINDOW);
            self.window = 0;
            self.room = 0;
        } else if self.slow_until.is_some_and(|until| now < until) {
            let doubled = if age < KEEPS_UP { 2 * self.window } else { 0 };
            self.window = doubled.max(self.bytes_ahead(now)).max(1);
            self.room = self.window.saturating_sub(unread);
        } else {
            self.slow_until = None;
            self.room = u64::MAX;
            if unread == 0 {
                self.next = now + QUERY_INTERVAL_IDLE;
            }
            return;
        }
        self.next = now + QUERY_INTERVAL_SLOW;
    }

    /// Bytes that the client reads in [`AHEAD`], at its rate over the last second.
    fn bytes_ahead(&self, now: Instant) -> u64 {
        let (Some((since, first)), Some((_, last))) = (self.read.front(), self.read.back()) else {
            return 0;
        };
        let time = now.duration_since(*since).max(AHEAD).as_millis();
        let bytes = u128::from(last - first) * AHEAD.as_millis() / time;
        u64::try_from(bytes).unwrap_or(u64::MAX)
    }
}

// ---- unread bytes from the system -----------------------------------------------------------------------------------

#[cfg(target_os = "linux")]
mod sockets {
    use std::net::{IpAddr, SocketAddr};
    use std::os::fd::OwnedFd;

    use rustix::net::{
        AddressFamily, RecvFlags, SendFlags, SocketFlags, SocketType, netlink, recv, send,
        socket_with,
    };

    use crate::actors::gateway::connection::flow::Ends;

    /// Bytes of the header of a netlink message.
    const HEAD: usize = 16;
    /// The message type for a query of a socket (`SOCK_DIAG_BY_FAMILY`), and the request flag (`NLM_F_REQUEST`).
    const BY_FAMILY: u16 = 20;
    const REQUEST: u16 = 1;
    /// The offsets of `idiag_rqueue`, `idiag_wqueue` and `idiag_inode` in `inet_diag_msg`.
    const RECEIVED: usize = HEAD + 56;
    const SENT: usize = HEAD + 60;
    const INODE: usize = HEAD + 68;

    thread_local! {
        static DIAGNOSTICS: Option<OwnedFd> = {
            let (kind, flags) = (SocketType::DGRAM, SocketFlags::CLOEXEC | SocketFlags::NONBLOCK);
            socket_with(AddressFamily::NETLINK, kind, flags, Some(netlink::SOCK_DIAG)).ok()
        };
    }

    /// Bytes in the client's receive queue. If there are some, plus those in our send queue.
    pub(super) fn unread(ends: Ends) -> Option<usize> {
        let received = value(ends.peer, ends.local, RECEIVED)?;
        if received == 0 {
            return Some(0);
        }
        Some((received + value(ends.local, ends.peer, SENT)?) as usize)
    }

    /// Whether the client has closed its socket, if it is on this machine: the socket belongs to no program any more. A
    /// client that has only stopped sending may still read.
    pub(in crate::actors::gateway::connection) fn has_closed(ends: Ends) -> bool {
        value(ends.peer, ends.local, INODE) == Some(0)
    }

    /// A number in the description of the socket at `of`, which is connected to `to`.
    fn value(of: SocketAddr, to: SocketAddr, place: usize) -> Option<u32> {
        DIAGNOSTICS.with(|socket| {
            let socket = socket.as_ref()?;
            send(socket, &request(of, to), SendFlags::empty()).ok()?;
            let mut answer = [0_u8; 512];
            // The answer to an earlier query is left if that could not be received.
            let length = loop {
                let (_, length) = recv(socket, &mut answer, RecvFlags::empty()).ok()?;
                if answer.get(8..12)? == number(of, to) {
                    break length;
                }
            };
            let kind = answer.get(4..6)?;
            let bytes = answer
                .get(place..place + 4)
                .filter(|_| length >= place + 4)?;
            // Any other kind is an error: there is no such socket on this machine.
            (kind == BY_FAMILY.to_ne_bytes())
                .then(|| u32::from_ne_bytes(bytes.try_into().unwrap_or_default()))
        })
    }

    /// The sequence number of a query, which its answer has too: both ports.
    fn number(of: SocketAddr, to: SocketAddr) -> [u8; 4] {
        let [[a, b], [c, d]] = [of, to].map(|end| end.port().to_be_bytes());
        [a, b, c, d]
    }

    /// `nlmsghdr` and `inet_diag_req_v2`, for one socket in any state.
    fn request(of: SocketAddr, to: SocketAddr) -> Vec<u8> {
        let (of_ip, to_ip) = (of.ip().to_canonical(), to.ip().to_canonical());
        // `AF_INET` and `AF_INET6`; 6 is TCP.
        let family = if of_ip.is_ipv4() { 2 } else { 10 };
        let mut bytes = Vec::with_capacity(HEAD + 56);
        bytes.extend(72_u32.to_ne_bytes());
        bytes.extend([BY_FAMILY, REQUEST].map(u16::to_ne_bytes).as_flattened());
        bytes.extend(number(of, to));
        bytes.extend([0; 4]);
        bytes.extend([family, 6, 0, 0]);
        bytes.extend(u32::MAX.to_ne_bytes());
        bytes.extend([of.port(), to.port()].map(u16::to_be_bytes).as_flattened());
        bytes.extend(padded(of_ip));
        bytes.extend(padded(to_ip));
        bytes.extend([0, u32::MAX, u32::MAX].map(u32::to_ne_bytes).as_flattened());
        bytes
    }

    fn padded(address: IpAddr) -> [u8; 16] {
        match address {
            IpAddr::V4(address) => {
                let [a, b, c, d] = address.octets();
                [a, b, c, d, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]
            }
            IpAddr::V6(address) => address.octets(),
        }
    }

    #[cfg(test)]
    mod tests {
        use std::io::{Read, Write};
        use std::net::{TcpListener, TcpStream};

        use super::*;

        #[test]
        fn the_unread_bytes_of_a_local_client_are_known() {
            for address in ["127.0.0.1:0", "[::1]:0", "[::]:0"] {
                let Ok(listener) = TcpListener::bind(address) else {
                    continue;
                };
                let mut connect = listener.local_addr().unwrap();
                if connect.ip().is_unspecified() {
                    // Our end is then `::ffff:127.0.0.1`, and the client's end is not.
                    connect.set_ip("127.0.0.1".parse().unwrap());
                }
                let mut client = TcpStream::connect(connect).unwrap();
                let (mut ours, peer) = listener.accept().unwrap();
                let local = ours.local_addr().unwrap();
                let ends = Ends { local, peer };
                // An answer that was not received.
                let query = request(connect, peer);
                DIAGNOSTICS.with(|socket| {
                    send(socket.as_ref().unwrap(), &query, SendFlags::empty()).unwrap()
                });
                assert_eq!(unread(ends), Some(0), "{address}");
                ours.write_all(&[0; 1234]).unwrap();
                assert_eq!(unread(ends), Some(1234));
                client.read_exact(&mut [0; 1000]).unwrap();
                assert_eq!(unread(ends), Some(234));
                // More than the client's buffer holds waits on our side.
                ours.set_nonblocking(true).unwrap();
                let mut sent = 234;
                while let Ok(written) = ours.write(&[0; 65536]) {
                    sent += written;
                }
                // Bytes that are not acknowledged yet count on both sides.
                let both = unread(ends).unwrap();
                assert!(
                    (sent..sent + 128 * 1024).contains(&both),
                    "{both} of {sent}"
                );
                drop((client, ours));
                assert_eq!(unread(ends), None);
            }
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod sockets {
    use crate::actors::gateway::connection::flow::Ends;

    pub(super) fn unread(_: Ends) -> Option<usize> {
        None
    }

    pub(in crate::actors::gateway::connection) fn has_closed(_: Ends) -> bool {
        false
    }
}
