//! Sockets that listen, the options of the sockets that they accept, and the reason if listening is impossible.
//!
//! **Invariant:** on Unix a port that was just released can be bound at once.

use std::io::{Error, ErrorKind};
use std::net::SocketAddr;
use std::time::Duration;

use socket2::{SockRef, TcpKeepalive};
use tokio::net::{TcpListener, TcpSocket, TcpStream};

/// Bytes of the socket's send buffer. Linux allocates twice as much.
pub const SEND_BUFFER: u32 = 128 * 1024;
/// Connections that wait to be accepted.
pub const BACKLOG: u32 = 1024;
/// Silence of a client before the first TCP keepalive probe. The cost is negligible, and routers do not drop the
/// connection in this time.
pub const KEEPALIVE_IDLE: Duration = Duration::from_secs(60);
/// Time between two probes, of which [`KEEPALIVE_PROBES`] may fail. A client survives half a minute without a network.
pub const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(15);
/// See [`KEEPALIVE_INTERVAL`].
pub const KEEPALIVE_PROBES: u32 = 4;

/// Sets the options of an accepted socket.
///
/// # Errors
/// The error of the operating system.
pub fn prepare(stream: &TcpStream) -> std::io::Result<()> {
    // Without it, a small frame waits for the acknowledgement of the previous one.
    stream.set_nodelay(true)?;
    // Only keepalive distinguishes a silent client from a machine that is gone.
    let keepalive = TcpKeepalive::new()
        .with_time(KEEPALIVE_IDLE)
        .with_interval(KEEPALIVE_INTERVAL)
        .with_retries(KEEPALIVE_PROBES);
    SockRef::from(stream).set_tcp_keepalive(&keepalive)
}

/// Binds a TCP socket in the current runtime, and listens.
///
/// # Errors
/// The error of the operating system, for instance when the port is in use.
pub fn bind(address: SocketAddr) -> std::io::Result<TcpListener> {
    let socket = match address {
        SocketAddr::V4(_) => TcpSocket::new_v4(),
        SocketAddr::V6(_) => TcpSocket::new_v6(),
    }?;
    // A port that was just released can be bound at once.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    // Accepted sockets inherit it.
    socket.set_send_buffer_size(SEND_BUFFER)?;
    socket.bind(address)?;
    socket.listen(BACKLOG)
}

/// The reason, and the remedy where there is one.
pub(in crate::actors) fn remedy(why: &Error) -> String {
    let remedy = match why.kind() {
        ErrorKind::AddrInUse => {
            "another program has that port, perhaps another pendularm; --bind 127.0.0.1:0 takes a free one"
        }
        ErrorKind::PermissionDenied => {
            "this user may not use that port (ports below 1024 usually need root); --bind 127.0.0.1:0 takes a free one"
        }
        ErrorKind::AddrNotAvailable => {
            "this machine does not have that address; use --bind 127.0.0.1:9095"
        }
        _ => return why.to_string(),
    };
    remedy.to_owned()
}

/// Logs why the runtime does not listen on the IPv6 twin of the default address.
pub(in crate::actors) fn report_twin(twin: SocketAddr, why: &Error) {
    if why.kind() == ErrorKind::AddrInUse {
        tracing::warn!(address = %twin, "another program listens there, and may get clients of localhost");
    } else {
        tracing::info!(address = %twin, error = %why, "not listening on IPv6");
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, pipe};
    use std::net::{TcpListener, TcpStream};
    use std::sync::Arc;

    use tracing_subscriber::util::SubscriberInitExt as _;

    use super::*;

    #[tokio::test]
    async fn many_clients_may_wait_to_be_accepted_and_their_sockets_have_the_options() {
        const { assert!(BACKLOG >= 300) };
        let socket = bind("127.0.0.1:0".parse().unwrap()).unwrap();
        let address = socket.local_addr().unwrap();
        let waiting: Vec<_> = (0..300)
            .map(|_| TcpStream::connect_timeout(&address, Duration::from_millis(900)).unwrap())
            .collect();
        let (stream, _) = socket.accept().await.unwrap();
        let size = SockRef::from(&stream).send_buffer_size().unwrap();
        assert!(size <= 2 * SEND_BUFFER as usize, "{size}");
        prepare(&stream).unwrap();
        #[cfg(target_os = "linux")]
        {
            let socket = SockRef::from(&stream);
            assert!(socket.keepalive().unwrap() && socket.tcp_nodelay().unwrap());
            assert_eq!(socket.tcp_keepalive_time().unwrap(), KEEPALIVE_IDLE);
            assert_eq!(socket.tcp_keepalive_interval().unwrap(), KEEPALIVE_INTERVAL);
            assert_eq!(socket.tcp_keepalive_retries().unwrap(), KEEPALIVE_PROBES);
        }
        drop(waiting);
    }

    #[test]
    fn a_twin_that_another_program_has_is_a_warning_and_no_ipv6_is_none() {
        let other = TcpListener::bind("127.0.0.1:0").unwrap();
        let twin = other.local_addr().unwrap();
        let taken = TcpListener::bind(twin).unwrap_err();
        for (why, level) in [
            (taken, "WARN"),
            (ErrorKind::AddrNotAvailable.into(), "INFO"),
        ] {
            let (mut log, writer) = pipe().unwrap();
            let subscriber = tracing_subscriber::fmt().with_writer(Arc::new(writer));
            let logging = subscriber.finish().set_default();
            report_twin(twin, &why);
            drop(logging);
            let mut text = String::new();
            log.read_to_string(&mut text).unwrap();
            assert!(
                text.contains(level) && text.contains(&twin.to_string()),
                "{text}"
            );
        }
    }

    #[test]
    fn a_port_of_the_systems_is_refused_with_the_remedy() {
        let remedy = remedy(&ErrorKind::PermissionDenied.into());
        assert!(
            remedy.contains("need root); --bind 127.0.0.1:0"),
            "{remedy}"
        );
    }
}
