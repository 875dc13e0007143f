//! The listener on a real socket, with the real clock.
//!
//! **Invariant:** an accepted client stays connected when the listening ends; a later one is not accepted.

use std::net::SocketAddr;
use std::sync::Arc;

use crate::system::in_real_time;
use actix::prelude::*;
#[cfg(target_os = "linux")]
use pendularm::actors::gateway::listener::{KEEPALIVE_IDLE, KEEPALIVE_INTERVAL, KEEPALIVE_PROBES};
use pendularm::actors::gateway::listener::{Listener, StopListening, bind};
use pendularm::actors::gateway::registry::Registry;
use pendularm::actors::resources::gauges::Gauges;
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::TcpStream;

fn listen() -> (Addr<Listener>, SocketAddr) {
    let socket = bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let address = socket.local_addr().unwrap();
    let gauges = Arc::new(Gauges::default());
    let registry = Registry::new(Arc::clone(&gauges)).start();
    (Listener::new(socket, registry, gauges).start(), address)
}

async fn exchange(stream: &mut BufReader<TcpStream>) {
    stream
        .get_mut()
        .write_all(b"{\"op\":\"nonsense\"}\n")
        .await
        .unwrap();
    let mut line = String::new();
    stream.read_line(&mut line).await.unwrap();
    assert!(line.contains("nonsense"), "{line:?}");
}

#[test]
fn accepted_clients_outlive_the_listening() {
    in_real_time(async {
        let (listener, address) = listen();
        let mut clients = Vec::new();
        for _ in 0..20 {
            let mut client = BufReader::new(TcpStream::connect(address).await.unwrap());
            exchange(&mut client).await;
            clients.push(client);
        }
        listener.send(StopListening).await.unwrap();
        while listener.connected() {
            tokio::task::yield_now().await;
        }
        for client in &mut clients {
            exchange(client).await;
        }
        assert!(
            TcpStream::connect(address).await.is_err(),
            "the port is closed"
        );
    });
}

/// The kernel has set a timer to probe a silent client.
#[cfg(target_os = "linux")]
#[test]
fn a_silent_client_gets_a_ping_after_a_while() {
    in_real_time(async {
        let (_listener, address) = listen();
        let mut client = BufReader::new(TcpStream::connect(address).await.unwrap());
        exchange(&mut client).await;
        let (ours, theirs) = (
            address.port(),
            client.get_ref().local_addr().unwrap().port(),
        );
        let began = std::time::Instant::now();
        let kept = loop {
            // Until the last answer is acknowledged, the timer is another one.
            if let Some((2, jiffies)) = timer(ours, theirs) {
                break std::time::Duration::from_millis(10 * jiffies);
            }
            assert!(began.elapsed().as_secs() < 20, "no timer");
            actix_rt::time::sleep(std::time::Duration::from_millis(20)).await;
        };
        let awaited = kept + began.elapsed();
        assert!(
            kept <= KEEPALIVE_IDLE && awaited + std::time::Duration::from_secs(1) > KEEPALIVE_IDLE,
            "{kept:?}"
        );
        let asked = KEEPALIVE_IDLE + KEEPALIVE_INTERVAL * KEEPALIVE_PROBES;
        assert_eq!(asked.as_secs(), 120, "as the README has it");
    });
}

/// The timer that a connection has, and when it runs out, in hundredths of a second: 2 is the one of keepalive.
#[cfg(target_os = "linux")]
fn timer(local: u16, remote: u16) -> Option<(u8, u64)> {
    let table = std::fs::read_to_string("/proc/net/tcp").unwrap();
    let line = table.lines().find(|line| {
        let mut ends = line.split_whitespace().skip(1);
        let mut is = |port: u16| {
            ends.next()
                .is_some_and(|end| end.ends_with(&format!(":{port:04X}")))
        };
        is(local) && is(remote)
    })?;
    let (kind, when) = line.split_whitespace().nth(5)?.split_once(':')?;
    Some((kind.parse().ok()?, u64::from_str_radix(when, 16).ok()?))
}
