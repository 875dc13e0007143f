//! Attacks on what clients share: permits for long frames and long answers, held as slowly as the server allows.
//!
//! Newcomers ask for long frames and answers during these attacks, and have the time that a permit may be held.

use super::Attack;
use super::script::{Client, KIB, MIB, call, each, filler, publish, subscribe};

/// Bytes of a frame that needs a permit.
const LONG_FRAME: usize = 300 * KIB;

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "unread-topics",
        "3 clients publish a megabyte to themselves again and again and read nothing",
        || long_topics(Client::deaf),
    )
    .holds(),
    Attack::new(
        "sipped-topics",
        "3 clients publish a megabyte to themselves again and again and read 16 KiB/s",
        || long_topics(|client| client.sips(1640)),
    )
    .holds(),
    Attack::new(
        "unread-answer",
        "a client asks for a million steps (60 MB) and reads nothing, again and again",
        || long_answer().deaf().returns().times(1),
    )
    .holds(),
    Attack::new(
        "sipped-answer",
        "a client asks for a million steps (60 MB) and reads 50 kB/s",
        || long_answer().sips(5_000).returns().times(1),
    )
    .holds(),
    Attack::new(
        "begun-frames",
        "3 clients send all of a frame of 300 KiB but its end, again and again",
        || {
            let begun = format!(r#"{{"op":"none","x":"{}"#, filler(LONG_FRAME));
            Client::tcp()
                .says_bytes(begun.as_bytes())
                .returns()
                .times(3)
        },
    )
    .holds(),
    Attack::new(
        "queued-formulas",
        "3 clients send formulas of 100 kB behind eight runs of ten million steps each",
        || {
            let sum = "t+".repeat(50_000);
            Client::tcp()
                .repeats_each(0..8, |_| super::computing::rollout(""))
                .repeats(&super::computing::steps(&(sum + "t"), 10))
                .times(3)
        },
    )
    .holds(),
];

/// Clients with messages of a megabyte on topics of their own, read in this way.
fn long_topics(read: fn(Client) -> Client) -> Vec<Client> {
    let msg = format!(r#"{{"data":"{}"}}"#, filler(MIB));
    each(0..3, |k| {
        let topic = format!("/attack/held/{k}");
        let client = Client::tcp()
            .says(&subscribe(&topic, ""))
            .advertises(&topic)
            .repeats(&publish(&topic, &msg))
            .returns();
        read(client)
    })
}

fn long_answer() -> Client {
    let args = r#"{"function":"sin(t)","x0":0,"dt":1e-3,"steps":1000000,"integrator":"euler"}"#;
    Client::tcp().says(&call("/arm_sim/integration_step", "1", args))
}
