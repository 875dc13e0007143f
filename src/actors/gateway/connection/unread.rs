//! How many bytes of what was written to a client it has not read yet. For a client on the same machine Linux tells it:
//! `NETLINK_SOCK_DIAG` describes one socket in some microseconds, the client's too (`man 7 sock_diag`).
//!
//! **Invariant:** where the system does not tell, the answer is `None`, and nothing is asked for that client again.

use super::Ends;

/// Gives the bytes that a client has not read, if that is known.
pub type UnreadSource = Box<dyn FnMut() -> Option<usize>>;

/// The source for a client with these ends.
pub(super) fn between(ends: Ends) -> UnreadSource {
    let mut is_known = ends.peer.port() != 0;
    Box::new(move || {
        let unread = is_known.then(|| sockets::unread(ends)).flatten();
        is_known = unread.is_some();
        unread
    })
}

#[cfg(target_os = "linux")]
mod sockets {
    use std::net::{IpAddr, SocketAddr};
    use std::os::fd::OwnedFd;

    use rustix::net::{
        AddressFamily, RecvFlags, SendFlags, SocketFlags, SocketType, netlink, recv, send,
        socket_with,
    };

    use crate::actors::gateway::ends::Ends;

    /// Bytes of the head of a netlink message.
    const HEAD: usize = 16;
    /// The kind of message that asks for a socket (`SOCK_DIAG_BY_FAMILY`), and the flag of a request (`NLM_F_REQUEST`).
    const BY_FAMILY: u16 = 20;
    const REQUEST: u16 = 1;
    /// The places of `idiag_rqueue` and `idiag_wqueue` in `inet_diag_msg`.
    const RECEIVED: usize = HEAD + 56;
    const SENT: usize = HEAD + 60;

    thread_local! {
        static DIAGNOSTICS: Option<OwnedFd> = {
            let (kind, flags) = (SocketType::DGRAM, SocketFlags::CLOEXEC | SocketFlags::NONBLOCK);
            socket_with(AddressFamily::NETLINK, kind, flags, Some(netlink::SOCK_DIAG)).ok()
        };
    }

    /// Bytes in the client's receive queue, and where there are some, in our send queue too.
    pub(super) fn unread(ends: Ends) -> Option<usize> {
        let received = queue(ends.peer, ends.local, RECEIVED)?;
        if received == 0 {
            return Some(0);
        }
        Some(received + queue(ends.local, ends.peer, SENT)?)
    }

    /// Bytes in a queue of the socket at `of`, which is connected to `to`.
    fn queue(of: SocketAddr, to: SocketAddr, place: usize) -> Option<usize> {
        DIAGNOSTICS.with(|socket| {
            let socket = socket.as_ref()?;
            send(socket, &request(of, to), SendFlags::empty()).ok()?;
            let mut answer = [0_u8; 512];
            let (_, length) = recv(socket, &mut answer, RecvFlags::empty()).ok()?;
            let kind = answer.get(4..6)?;
            let bytes = answer
                .get(place..place + 4)
                .filter(|_| length >= place + 4)?;
            // Any other kind is an error: there is no such socket on this machine.
            (kind == BY_FAMILY.to_ne_bytes())
                .then(|| u32::from_ne_bytes(bytes.try_into().unwrap_or_default()) as usize)
        })
    }

    /// `nlmsghdr` and `inet_diag_req_v2`, for one socket in any state.
    fn request(of: SocketAddr, to: SocketAddr) -> Vec<u8> {
        let (of_ip, to_ip) = (of.ip().to_canonical(), to.ip().to_canonical());
        // `AF_INET` and `AF_INET6`; 6 is TCP.
        let family = if of_ip.is_ipv4() { 2 } else { 10 };
        let mut bytes = Vec::with_capacity(HEAD + 56);
        bytes.extend(72_u32.to_ne_bytes());
        bytes.extend([BY_FAMILY, REQUEST].map(u16::to_ne_bytes).as_flattened());
        bytes.extend([0; 8]);
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
        fn it_tells_how_much_a_client_of_this_machine_has_not_read() {
            for address in ["127.0.0.1:0", "[::1]:0", "[::]:0"] {
                let Ok(listener) = TcpListener::bind(address) else {
                    continue;
                };
                let mut connect = listener.local_addr().unwrap();
                if connect.ip().is_unspecified() {
                    // Our end is `::ffff:127.0.0.1` then, the client's is not.
                    connect.set_ip("127.0.0.1".parse().unwrap());
                }
                let mut client = TcpStream::connect(connect).unwrap();
                let (mut ours, peer) = listener.accept().unwrap();
                let local = ours.local_addr().unwrap();
                let ends = Ends { local, peer };
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
    use crate::actors::gateway::ends::Ends;

    pub(super) fn unread(_: Ends) -> Option<usize> {
        None
    }
}
