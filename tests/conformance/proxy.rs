//! A proxy between the suite and the program that changes frames, so the suite tests a server with a fault.

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};
use std::thread;

use serde_json::Value;

/// The source of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// From the suite.
    Client,
    /// From the program.
    Server,
}

/// Converts a frame of a side into the forwarded frames: none, one or more. A line that is not JSON is passed as a text.
pub type Fault = Box<dyn FnMut(Side, Value) -> Vec<Value> + Send>;

/// A proxy. Its threads end with the connections.
pub struct Proxy {
    /// Where it listens.
    pub address: String,
}

impl Proxy {
    /// Starts one before the server at an address.
    pub fn start(server: &str, fault: Fault) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let (server, fault) = (server.to_owned(), Arc::new(Mutex::new(fault)));
        thread::spawn(move || {
            for client in listener.incoming().flatten() {
                let Ok(server) = TcpStream::connect(&server) else {
                    return;
                };
                for stream in [&client, &server] {
                    stream.set_nodelay(true).unwrap();
                }
                let (from, to) = (client.try_clone().unwrap(), server.try_clone().unwrap());
                let shared = Arc::clone(&fault);
                thread::spawn(move || pass(from, to, Side::Client, &shared));
                let shared = Arc::clone(&fault);
                thread::spawn(move || pass(server, client, Side::Server, &shared));
            }
        });
        Self { address }
    }
}

fn pass(from: TcpStream, mut to: TcpStream, side: Side, fault: &Mutex<Fault>) {
    for line in BufReader::new(from).lines() {
        let Ok(line) = line else { break };
        let frame = serde_json::from_str(&line).unwrap_or(Value::String(line));
        let frames = fault.lock().unwrap()(side, frame);
        let mut text = String::new();
        for frame in frames {
            text += &frame.as_str().map_or_else(|| frame.to_string(), str::to_owned);
            text.push('\n');
        }
        if to.write_all(text.as_bytes()).is_err() {
            break;
        }
    }
    // Both directions end with the first.
    let _ = to.shutdown(std::net::Shutdown::Both);
}
