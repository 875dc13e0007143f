//! The listener on a real socket, with the real clock.
//!
//! **Invariant:** an accepted client stays connected when the listening ends; a later one is not accepted.

use std::net::SocketAddr;
use std::sync::Arc;

use crate::system::in_real_time;
use actix::prelude::*;
use pendularm::actors::gateway::listener::accept;
use pendularm::actors::gateway::registry::Registry;
use pendularm::actors::resources::{gauges::Gauges, listening::bind};
use tokio::io::{AsyncBufReadExt, AsyncWriteExt, BufReader};
use tokio::net::TcpStream;
use tokio::task::JoinHandle;

fn listen() -> (JoinHandle<()>, SocketAddr) {
    let socket = bind("127.0.0.1:0".parse().unwrap()).unwrap();
    let address = socket.local_addr().unwrap();
    let gauges = Arc::new(Gauges::default());
    let registry = Registry::new(Arc::clone(&gauges)).start();
    let listening = accept(socket, Arc::default(), registry, gauges);
    (actix_rt::spawn(listening), address)
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
        listener.abort();
        assert!(listener.await.unwrap_err().is_cancelled());
        for client in &mut clients {
            exchange(client).await;
        }
        assert!(
            TcpStream::connect(address).await.is_err(),
            "the port is closed"
        );
    });
}
