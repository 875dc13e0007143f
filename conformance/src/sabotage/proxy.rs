//! A proxy between clients and a server that changes frames, so the clients see a server with a fault.
//!
//! **Invariant:** each connection has at most two threads and [`MOST_FRAME`] bytes in each direction.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use serde_json::Value;

/// The longest frame that is passed, in bytes. A longer one ends its connection.
const MOST_FRAME: u64 = 96 << 20;
/// Most connections at once. Further ones are closed.
const MOST_CONNECTIONS: usize = 256;

/// The source of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// From a client.
    Client,
    /// From the server.
    Server,
}

/// Converts a frame of a side into the forwarded frames: none, one or more. A line that is not JSON is passed as a text.
pub type Fault = Box<dyn FnMut(Side, Value) -> Vec<Value> + Send>;

/// A proxy. Its threads end with the connections.
#[derive(Debug)]
pub struct Proxy {
    /// Where it listens.
    pub address: String,
}

impl Proxy {
    /// Starts one at a free port before the server at an address.
    ///
    /// # Errors
    /// If no port can be opened.
    pub fn start(server: &str, fault: Fault) -> io::Result<Self> {
        Self::listen(TcpListener::bind("127.0.0.1:0")?, server, fault)
    }

    /// Starts one at `listener` before the server at an address.
    ///
    /// # Errors
    /// If the listener has no address.
    pub fn listen(listener: TcpListener, server: &str, fault: Fault) -> io::Result<Self> {
        let address = listener.local_addr()?.to_string();
        let (server, fault) = (server.to_owned(), Arc::new(Mutex::new(fault)));
        let open = Arc::new(AtomicUsize::new(0));
        thread::spawn(move || {
            for client in listener.incoming().flatten() {
                if open.load(Ordering::Relaxed) >= MOST_CONNECTIONS {
                    continue;
                }
                let Ok(server) = TcpStream::connect(&server) else {
                    return;
                };
                let _ = join(&client, &server, &fault, &open);
            }
        });
        Ok(Self { address })
    }
}

/// Passes frames in both directions, each in a thread.
fn join(client: &TcpStream, server: &TcpStream, fault: &Arc<Mutex<Fault>>, open: &Arc<AtomicUsize>) -> io::Result<()> {
    for stream in [client, server] {
        stream.set_nodelay(true)?;
    }
    for (from, to, side) in [(client, server, Side::Client), (server, client, Side::Server)] {
        let (from, mut to) = (from.try_clone()?, to.try_clone()?);
        let (fault, open) = (Arc::clone(fault), Arc::clone(open));
        open.fetch_add(usize::from(side == Side::Client), Ordering::Relaxed);
        thread::spawn(move || {
            let _ = pass(from, &mut to, side, &fault);
            // Both directions end with the first.
            let _ = to.shutdown(Shutdown::Both);
            open.fetch_sub(usize::from(side == Side::Client), Ordering::Relaxed);
        });
    }
    Ok(())
}

fn pass(from: TcpStream, to: &mut TcpStream, side: Side, fault: &Mutex<Fault>) -> io::Result<()> {
    let mut from = BufReader::new(from);
    loop {
        let mut line = String::new();
        let length = from.by_ref().take(MOST_FRAME).read_line(&mut line)?;
        if length == 0 || !line.ends_with('\n') {
            return Ok(());
        }
        let line = line.trim_end_matches(['\n', '\r']);
        let frame = serde_json::from_str(line).unwrap_or_else(|_| Value::String(line.to_owned()));
        let frames = fault.lock().unwrap_or_else(PoisonError::into_inner)(side, frame);
        let mut text = String::new();
        for frame in frames {
            text += &frame.as_str().map_or_else(|| frame.to_string(), str::to_owned);
            text.push('\n');
        }
        to.write_all(text.as_bytes())?;
    }
}
