//! Attacks that any server of messages can be put under, in each server's own protocol.

use std::time::Duration;

use super::script::{Client, each};
use crate::protocol::Protocol;

/// An attack in whatever protocol.
pub struct Common {
    /// Its name, for `--only`.
    pub name: &'static str,
    /// Its actions.
    pub what: &'static str,
    /// Its clients.
    pub cast: fn(Protocol) -> Vec<Client>,
}

/// All of them.
pub const ATTACKS: &[Common] = &[
    Common {
        name: "peers-deaf",
        what: "50 subscribers read nothing of a flood of messages of 1 KB",
        cast: deaf,
    },
    Common {
        name: "peers-large",
        what: "10 publishers and 10 subscribers, deaf, with messages of a megabyte",
        cast: large,
    },
    Common {
        name: "peers-calls",
        what: "20 clients ask without end and read no answer",
        cast: calls,
    },
    Common {
        name: "peers-connects",
        what: "20 clients connect and go, over and over",
        cast: connects,
    },
    Common {
        name: "peers-idle",
        what: "800 clients connect and are silent",
        cast: idle,
    },
    Common {
        name: "peers-bytes",
        what: "500 clients send a byte a second",
        cast: bytes,
    },
    Common {
        name: "peers-resets",
        what: "20 clients leave with answers unread, and return",
        cast: resets,
    },
];

const TOPIC: &str = "/attack/peers";

fn bytes_of(write: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut out = Vec::new();
    write(&mut out);
    out
}

/// A client that has greeted; each has a number of its own.
fn greeted(protocol: Protocol, number: usize) -> Client {
    Client::tcp().says_bytes(&bytes_of(|out| protocol.greet(number, out)))
}

fn subscriber(protocol: Protocol, number: usize) -> Client {
    greeted(protocol, number)
        .says_bytes(&bytes_of(|out| protocol.subscribe(TOPIC, out)))
        .deaf()
}

fn publisher(protocol: Protocol, number: usize, length: usize) -> Client {
    let payload = format!(r#"{{"data":"{}"}}"#, "x".repeat(length));
    let advertise = bytes_of(|out| protocol.advertise(TOPIC, out));
    let message = bytes_of(|out| protocol.publish(TOPIC, payload.as_bytes(), out));
    let burst = message.repeat((64 * 1024 / message.len()).max(1));
    greeted(protocol, number)
        .says_bytes(&advertise)
        .repeats_bytes(&burst)
        .after(300)
}

fn deaf(protocol: Protocol) -> Vec<Client> {
    let mut clients = each(0..50, |k| subscriber(protocol, k));
    clients.push(publisher(protocol, 50, 1024));
    clients
}

fn large(protocol: Protocol) -> Vec<Client> {
    let publishers = each(10..20, |k| publisher(protocol, k, 1024 * 1024));
    [each(0..10, |k| subscriber(protocol, k)), publishers].concat()
}

fn calls(protocol: Protocol) -> Vec<Client> {
    let ask = bytes_of(|out| protocol.ask(out)).repeat(1000);
    each(0..20, |k| greeted(protocol, k).repeats_bytes(&ask).deaf())
}

fn connects(protocol: Protocol) -> Vec<Client> {
    each(0..20, |k| greeted(protocol, k).leaves_after(0).returns())
}

fn idle(_: Protocol) -> Vec<Client> {
    Client::tcp().times(800)
}

fn bytes(protocol: Protocol) -> Vec<Client> {
    each(0..500, |k| {
        greeted(protocol, k).drips(1, Duration::from_secs(1))
    })
}

fn resets(protocol: Protocol) -> Vec<Client> {
    let ask = bytes_of(|out| protocol.ask(out)).repeat(20);
    each(0..20, |k| {
        greeted(protocol, k)
            .says_bytes(&ask)
            .deaf()
            .leaves_after(20)
            .returns()
    })
}
