//! The system's description of a client's socket on the same machine: its unread bytes, and whether the client has
//! closed it.
//!
//! Linux describes one socket in some microseconds by `NETLINK_SOCK_DIAG` (`man 7 sock_diag`). Other systems do not.
//!
//! **Invariant:** once a query for a client's unread bytes fails, they are not queried again.

use std::net::{Ipv4Addr, SocketAddr};
use std::time::Duration;

use tokio::time::sleep;

#[cfg(target_os = "linux")]
use self::sockets::value;

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

/// Interval of checks whether a client that has stopped sending, or is not read, has closed its socket.
const CLOSED_CHECK: Duration = Duration::from_millis(250);
/// Bytes of the header of a netlink message.
const HEAD: usize = 16;
/// The offsets of `idiag_rqueue`, `idiag_wqueue` and `idiag_inode` in `inet_diag_msg`.
const RECEIVED: usize = HEAD + 56;
const SENT: usize = HEAD + 60;
const INODE: usize = HEAD + 68;

/// Returns the bytes that a client with these ends has not read, if that is known.
pub fn source(ends: Ends) -> impl FnMut() -> Option<usize> {
    let mut is_known = true;
    move || {
        let unread = is_known.then(|| unread(ends)).flatten();
        is_known = unread.is_some();
        unread
    }
}

/// Bytes in the client's receive queue. If there are some, plus those in our send queue.
fn unread(ends: Ends) -> Option<usize> {
    let received = value(ends.peer, ends.local, RECEIVED)?;
    if received == 0 {
        return Some(0);
    }
    Some((received + value(ends.local, ends.peer, SENT)?) as usize)
}

/// Whether the client has closed its socket, if it is on this machine: the socket belongs to no program any more. A
/// client that has only stopped sending may still read. For a client on another machine it is false.
#[must_use]
pub fn is_closed(ends: Ends) -> bool {
    value(ends.peer, ends.local, INODE) == Some(0)
}

/// Ends when the client has [closed](is_closed) its socket.
pub async fn closed(ends: Ends) {
    while !is_closed(ends) {
        sleep(CLOSED_CHECK).await;
    }
}

#[cfg(target_os = "linux")]
mod sockets {
    use std::net::{IpAddr, SocketAddr};
    use std::os::fd::OwnedFd;

    use rustix::net::{
        AddressFamily, RecvFlags, SendFlags, SocketFlags, SocketType, netlink, recv, send,
        socket_with,
    };

    use super::HEAD;

    /// The message type for a query of a socket (`SOCK_DIAG_BY_FAMILY`), and the request flag (`NLM_F_REQUEST`).
    const BY_FAMILY: u16 = 20;
    const REQUEST: u16 = 1;

    thread_local! {
        static DIAGNOSTICS: Option<OwnedFd> = {
            let (kind, flags) = (SocketType::DGRAM, SocketFlags::CLOEXEC | SocketFlags::NONBLOCK);
            socket_with(AddressFamily::NETLINK, kind, flags, Some(netlink::SOCK_DIAG)).ok()
        };
    }

    /// A number in the description of the socket at `of`, which is connected to `to`.
    pub(super) fn value(of: SocketAddr, to: SocketAddr, offset: usize) -> Option<u32> {
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
                .get(offset..offset + 4)
                .filter(|_| length >= offset + 4)?;
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

        use super::super::{Ends, unread};
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
fn value(_: SocketAddr, _: SocketAddr, _: usize) -> Option<u32> {
    None
}
