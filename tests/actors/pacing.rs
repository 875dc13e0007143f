//! Backpressure on a publisher: its next frame is handled once its last message has been offered to every subscriber.
//!
//! It uses real sockets, because only those are written to in turns, and one thread, so nothing depends on time.
//!
//! **Invariant:** the test counts the messages that had arrived when the publisher's next frame was handled.

use std::cell::Cell;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::rc::Rc;
use std::sync::Arc;

use crate::system::in_real_time;
use crate::virtual_time::{Gateway, WIDE, route, settle};
use pendularm::actors::gateway::connection::{self, Ends};
use pendularm::actors::gateway::registry::Nodes;
use pendularm::actors::node::ServiceCall;
use pendularm::protocol::catalog::Service;
use serde_json::json;

/// Number of subscribers: many more than are written to in one turn.
const SUBSCRIBERS: usize = 100;

/// Subscribes over a socket. Returns the client's end.
async fn subscriber(gateway: &Gateway, listener: &TcpListener, topic: &str) -> TcpStream {
    let mut client = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let (stream, _) = listener.accept().unwrap();
    stream.set_nonblocking(true).unwrap();
    let stream = tokio::net::TcpStream::from_std(stream).unwrap();
    connection::start(
        None,
        Arc::default(),
        Ends::default(),
        stream,
        gateway.registry.clone(),
        Arc::clone(&gateway.gauges),
    );
    let subscribe = json!({"op": "subscribe", "topic": topic});
    client
        .write_all(format!("{subscribe}\n").as_bytes())
        .unwrap();
    client.set_nonblocking(true).unwrap();
    while client.peek(&mut [0]).is_err() {
        settle().await;
    }
    client.set_nonblocking(false).unwrap();
    let mut status = String::new();
    BufReader::with_capacity(1, &client)
        .read_line(&mut status)
        .unwrap();
    client.set_nonblocking(true).unwrap();
    client
}

#[test]
fn a_publisher_continues_when_all_its_subscribers_have_been_written_to() {
    let msg = json!({"data": "x".repeat(40_000)});
    // Forwarded unchanged, and read.
    let spelled = format!("{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{msg}}}\n");
    let otherwise = format!("{{ \"op\":\"publish\",\"topic\":\"/t\",\"msg\":{msg}}}\n");
    for publish in [spelled, otherwise] {
        in_real_time(async {
            let subscribers = Rc::new(std::cell::RefCell::new(Vec::<TcpStream>::new()));
            let arrived = Rc::new(Cell::new(usize::MAX));
            let (seen, all) = (Rc::clone(&arrived), Rc::clone(&subscribers));
            let mut nodes = Nodes::default();
            let look = move |mut call: ServiceCall| {
                let all = all.borrow();
                seen.set(all.iter().filter(|one| one.peek(&mut [0]).is_ok()).count());
                call.caller.succeed(&json!({}));
            };
            nodes.services.insert(Service::Pause, route(look));
            let gateway = Gateway::with(nodes).await;
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            for _ in 0..SUBSCRIBERS {
                let one = subscriber(&gateway, &listener, "/t").await;
                subscribers.borrow_mut().push(one);
            }
            let mut publisher = gateway.connect(WIDE);
            let advertise = json!({"op": "advertise", "topic": "/t"});
            publisher.send(&advertise).await;
            settle().await;
            let call = r#"{"op":"call_service","service":"/arm_sim/pause","id":1}"#;
            publisher.send_text(&format!("{publish}{call}")).await;
            assert_eq!(publisher.receive().await["id"], 1);
            assert_eq!(arrived.get(), SUBSCRIBERS);
        });
    }
}
