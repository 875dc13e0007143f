//! The least that actors need to hand messages to many clients: what `load` compares pendularm with.
//!
//! `bare PORT` listens on loopback. Each client has an actor, one registry actor has the subscribers of each topic, and
//! a delivery is one message to a mailbox and one write. An actor wakes up 60 times a second, as the arm does. There is
//! no outbox, no limit and no JSON parser: lines are taken as `load` sends them, and a client that does not read enough
//! ends the program.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use tokio::net::{TcpListener, TcpStream};

/// The confirmation that `load` waits for.
const SUBSCRIBED: &[u8] = b"{\"op\":\"status\",\"level\":\"info\",\"msg\":\"\"}\n";
const READ_BYTES: usize = 16 * 1024;

/// Bytes for a client.
#[derive(Message)]
#[rtype(result = "()")]
struct Deliver(Bytes);

/// A line of a client.
#[derive(Message)]
#[rtype(result = "()")]
struct Line(Bytes, Addr<Client>);

/// A client has left.
#[derive(Message)]
#[rtype(result = "()")]
struct Left(Addr<Client>);

struct Client(Arc<TcpStream>);

impl Actor for Client {
    type Context = Context<Self>;
}

impl Handler<Deliver> for Client {
    type Result = ();

    fn handle(&mut self, Deliver(bytes): Deliver, ctx: &mut Context<Self>) {
        match self.0.try_write(&bytes) {
            Ok(written) => assert_eq!(written, bytes.len(), "a client reads too little"),
            Err(_) => ctx.stop(),
        }
    }
}

#[derive(Default)]
struct Registry(HashMap<Vec<u8>, Vec<Addr<Client>>>);

impl Actor for Registry {
    type Context = Context<Self>;
}

impl Handler<Line> for Registry {
    type Result = ();

    fn handle(&mut self, Line(line, from): Line, _: &mut Context<Self>) {
        let topic = field(&line, b"\"topic\":\"").unwrap_or_default();
        match field(&line, b"\"op\":\"") {
            Some(b"subscribe") => {
                from.do_send(Deliver(Bytes::from_static(SUBSCRIBED)));
                self.0.entry(topic.to_vec()).or_default().push(from);
            }
            Some(b"publish") => {
                for client in self.0.get(topic).into_iter().flatten() {
                    client.do_send(Deliver(line.clone()));
                }
            }
            _ => {}
        }
    }
}

impl Handler<Left> for Registry {
    type Result = ();

    fn handle(&mut self, Left(client): Left, _: &mut Context<Self>) {
        for subscribers in self.0.values_mut() {
            subscribers.retain(|one| *one != client);
        }
    }
}

/// Wakes up, and does nothing.
struct Tick;

impl Actor for Tick {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        ctx.run_interval(Duration::from_secs(1) / 60, |_, _| ());
    }
}

/// The text between `key` and the next quotation mark.
fn field<'a>(line: &'a [u8], key: &[u8]) -> Option<&'a [u8]> {
    let start = memchr::memmem::find(line, key)? + key.len();
    let length = memchr::memchr(b'"', &line[start..])?;
    Some(&line[start..start + length])
}

/// Hands the lines of a client to the registry until it leaves.
async fn read(stream: Arc<TcpStream>, client: Addr<Client>, registry: Addr<Registry>) {
    let (mut unread, mut chunk) = (Vec::new(), [0; READ_BYTES]);
    while stream.readable().await.is_ok() {
        match stream.try_read(&mut chunk) {
            Ok(read) if read > 0 => unread.extend_from_slice(&chunk[..read]),
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => continue,
            _ => break,
        }
        while let Some(end) = memchr::memchr(b'\n', &unread) {
            let line = unread.drain(..=end).collect();
            registry.do_send(Line(line, client.clone()));
        }
    }
    registry.do_send(Left(client));
}

fn main() {
    let port = std::env::args().nth(1).expect("a port");
    let port: u16 = port.parse().expect("a port");
    System::new().block_on(async move {
        let listener = TcpListener::bind(("127.0.0.1", port)).await;
        let listener = listener.expect("a free port");
        let registry = Registry::default().start();
        let _tick = Tick.start();
        loop {
            let (stream, _) = listener.accept().await.expect("a client");
            stream.set_nodelay(true).expect("nodelay");
            let stream = Arc::new(stream);
            let client = Client(Arc::clone(&stream)).start();
            actix::spawn(read(stream, client, registry.clone()));
        }
    });
}
