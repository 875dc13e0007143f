//! Attacks on the gateway's thread by numbers: hundreds of clients with light requests at the same time.

use super::Attack;
use super::script::{Client, MOST, call, each, on_service, publish, subscribe};

/// The number of subscribers or callers. Together with the attackers they take nearly all places.
const CROWD: usize = 180;

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "storm-beside-waiting",
        "180 clients have 180 waiting calls each; 50 connect, send nothing and leave, repeatedly",
        storm,
    ),
    Attack::new(
        "late-together",
        "180 clients have 180 waiting calls each, with one common timeout",
        || waiting(Client::tcp(), |n| 2.5 - n as f64 / 1000.0),
    ),
    Attack::new(
        "left-together",
        "a provider of 180 waiting calls from each of 180 clients leaves, and another one connects",
        || waiting(Client::tcp().leaves_after(1500).returns(), |_| 86_400.0),
    ),
    Attack::new(
        "publishers-to-deaf",
        "40 clients publish a message each every millisecond to 180 that read nothing",
        || publishers(""),
    ),
    Attack::new(
        "publishers-to-throttled",
        "the same to 180 that have all but one message a minute held back",
        || publishers(r#","throttle_rate":60000,"queue_length":1"#),
    ),
    Attack::new(
        "floods-to-webs",
        "20 clients flood a topic with short messages to 20 WebSockets that read",
        || {
            let reader = Client::web().says(&subscribe("/crowd", ""));
            let flood = Client::tcp()
                .after(100)
                .advertises("/crowd")
                .floods(&publish("/crowd", "{}"));
            [reader.times(20), flood.times(20)].concat()
        },
    ),
    Attack::new(
        "census",
        "66 clients register 11,880 names, 150 ask rosapi for a service's type at one instant, every second",
        census,
    ),
];

/// A provider that does not answer, and callers with timeouts of `patience` seconds. One connects each millisecond.
fn waiting(provider: Client, patience: impl Fn(usize) -> f64) -> Vec<Client> {
    let provider = provider.says(&on_service("advertise_service", "/crowd"));
    let callers = each(0..CROWD, |n| {
        let timeout = patience(n);
        let call = format!(r#"{{"op":"call_service","service":"/crowd","timeout":{timeout}}}"#);
        let caller = Client::tcp().after(100 + n as u64);
        caller.says_each(0..MOST, |_| call.clone())
    });
    [vec![provider], callers].concat()
}

fn storm() -> Vec<Client> {
    let goer = Client::tcp().after(1200).leaves_after(1).returns();
    [waiting(Client::tcp(), |_| 86_400.0), goer.times(50)].concat()
}

fn publishers(further: &str) -> Vec<Client> {
    let subscriber = Client::tcp().says(&subscribe("/crowd", further)).deaf();
    let message = format!("{}\n", publish("/crowd", "{}"));
    let publisher = Client::tcp()
        .after(300)
        .advertises("/crowd")
        .repeats_bytes(message.as_bytes())
        .drips(message.len(), std::time::Duration::from_millis(1));
    [subscriber.times(CROWD), publisher.times(40)].concat()
}

/// Clients with as many topics, services or actions as one may register.
fn census() -> Vec<Client> {
    let kinds = [
        ("advertise", "topic"),
        ("advertise_service", "service"),
        ("advertise_action", "action"),
    ];
    let mut clients = each(0..66, |k| {
        let (op, field) = kinds[k % 3];
        let name = |n| format!(r#"{{"op":"{op}","{field}":"/{field}/{k}/{n}","type":"a/b"}}"#);
        Client::tcp()
            .says(r#"{"op":"set_level","level":"none"}"#)
            .says_each(0..MOST, name)
    });
    let question = call("/rosapi/service_type", "1", r#"{"service":"/service/1/1"}"#);
    let asker = Client::tcp()
        .after(1_000)
        .repeats(&question)
        .drips(question.len() + 1, std::time::Duration::from_secs(1));
    clients.extend(asker.times(150));
    clients
}
