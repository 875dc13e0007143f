//! The listener on a real socket, with the real clock.
//!
//! **Invariant:** who has been accepted stays connected when the listening ends; who comes later is not accepted.

#![allow(
    clippy::expect_used,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::unwrap_used,
    reason = "a helper of a test fails by panicking, as a test does"
)]

use std::sync::Arc;

use actix::prelude::*;
use pendularm::actors::gauges::Gauges;
use pendularm::actors::listener::{Listener, StopListening, bind};
use pendularm::actors::registry::Registry;
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::TcpStream;

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
    System::new().block_on(async {
        let socket = bind("127.0.0.1:0".parse().unwrap()).await.unwrap();
        let address = socket.local_addr().unwrap();
        let gauges = Arc::new(Gauges::default());
        let registry = Registry::new(Arc::clone(&gauges)).start();
        let listener = Listener::new(socket, registry, gauges).start();
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

#[test]
fn a_port_in_use_is_an_error() {
    System::new().block_on(async {
        let socket = bind("127.0.0.1:0".parse().unwrap()).await.unwrap();
        assert!(bind(socket.local_addr().unwrap()).await.is_err());
    });
}
