//! The remedy for an address on which the runtime cannot listen.
//!
//! **Invariant:** a port in use by another program is always reported.

use std::io::{Error, ErrorKind};
use std::net::SocketAddr;

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
    use std::net::TcpListener;
    use std::sync::Arc;

    use tracing_subscriber::util::SubscriberInitExt as _;

    use super::*;

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
