//! Aimed at the registry: names, providers, calls that wait, lists of what there is.

use super::Attack;
use super::script::{Client, call, each, filler, light, on_service, on_topic, publish, subscribe};

const MIB: usize = 1024 * 1024;

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "registrations",
        "8 clients register as many names of 1,000 bytes as they may",
        registrations,
    ),
    Attack::new("registrations-200", "200 clients do so", || {
        each(0..200, |k| {
            Client::tcp().says_each(0..300, |n| {
                subscribe(&format!("/{k}/{n}/{}", filler(1_000)), "")
            })
        })
    }),
    Attack::new(
        "leaving-together",
        "200 clients with all the subscriptions that they may have leave at one instant",
        || {
            Client::tcp()
                .says(r#"{"op":"set_level","level":"none"}"#)
                .says_each(0..350, |n| subscribe(&format!("/{n}"), ""))
                .leaves_after(5_000)
                .times(200)
        },
    ),
    Attack::new(
        "day-long-calls",
        "21 clients provide a service, call it with 4 MiB for a day and read nothing",
        || {
            let args = format!(r#"{{"data":"{}"}}"#, filler(4 * MIB - 1024));
            each(0..21, |k| {
                let service = format!("/attack/day/{k}");
                Client::tcp()
                    .says(&on_service("advertise_service", &service))
                    .repeats(&day_long(&service, &args))
                    .deaf()
            })
        },
    ),
    Attack::new(
        "waiting-calls",
        "100 clients have 256 calls wait for a provider that never answers",
        || {
            let args = format!(r#"{{"data":"{}"}}"#, filler(4096));
            let call = day_long("/attack/never", &args);
            let caller = Client::tcp()
                .says_each(0..256, |_| call.clone())
                .after(200)
                .times(100);
            [
                Client::tcp()
                    .says(&on_service("advertise_service", "/attack/never"))
                    .times(1),
                caller,
            ]
            .concat()
        },
    ),
    Attack::new(
        "vanishing-providers",
        "20 providers vanish as soon as they are called, and return",
        || {
            let provide = Client::tcp()
                .says(&on_service("advertise_service", "/attack/vanishing"))
                .deaf()
                .leaves_after(10)
                .returns();
            [
                provide.times(20),
                Client::tcp().floods(&light("/attack/vanishing")).times(10),
            ]
            .concat()
        },
    ),
    Attack::new(
        "huge-answers",
        "a provider answers each call of 10 clients with 3 MiB",
        || {
            fn reply(line: &str) -> Option<Vec<u8>> {
                Some(answer(
                    "/attack/huge",
                    id_of(line)?,
                    &format!(r#"{{"data":"{}"}}"#, filler(3 * MIB)),
                ))
            }
            let provider = Client::tcp()
                .says(&on_service("advertise_service", "/attack/huge"))
                .replies(reply)
                .times(1);
            let pause = std::time::Duration::from_millis(50);
            let caller = Client::tcp()
                .repeats(&light("/attack/huge"))
                .drips(200, pause)
                .after(200)
                .times(10);
            [provider, caller].concat()
        },
    ),
    Attack::new(
        "mirrors",
        "20 providers answer calls of themselves with two more",
        mirrors,
    ),
    Attack::new(
        "wrong-answers",
        "10 clients answer calls that nobody made, with ids of 64 KiB",
        || {
            let id = format!("\"{}\"", filler(64 * 1024));
            let frame = answer("/attack/nobody", &id, "{}");
            let short = answer("/attack/nobody", "1", "{}").repeat(500);
            Client::tcp()
                .says(&light("/arm_sim/pause"))
                .repeats_bytes(&frame)
                .repeats_bytes(&short)
                .times(10)
        },
    ),
    Attack::new(
        "takeovers",
        "20 clients take a service from one another, 10 call it",
        takeovers,
    ),
    Attack::new(
        "lists",
        "4 clients advertise 1,024 topics each, 4 ask for all topics and types",
        lists,
    ),
    Attack::new(
        "details",
        "10 clients ask rosapi for types, nodes and parameters",
        details,
    ),
    Attack::new(
        "parameters",
        "10 clients set, read and delete parameters",
        parameters,
    )
    .moves(),
    Attack::new(
        "spellings",
        "10 clients call and subscribe under many spellings of names",
        spellings,
    ),
    Attack::new(
        "subscription-storm",
        "20 clients subscribe and unsubscribe, over and over",
        || {
            let storm = |k: usize| {
                let topic = ["/joint_states", "/clock", "/attack/storm", "/tf"][k / 2 % 4];
                if k.is_multiple_of(2) {
                    subscribe(topic, "")
                } else {
                    on_topic("unsubscribe", topic)
                }
            };
            Client::tcp().repeats_each(0..200, storm).times(20)
        },
    ),
    Attack::new(
        "latched",
        "20 clients subscribe to the description again and again, 64 subscriptions each",
        latched,
    ),
    Attack::new(
        "topic-churn",
        "20 clients advertise and unadvertise a topic that 200 subscribe to",
        || {
            let churn = |k: usize| match k % 3 {
                0 => on_topic("advertise", "/attack/churn"),
                1 => publish("/attack/churn", "{}"),
                _ => on_topic("unadvertise", "/attack/churn"),
            };
            [
                Client::tcp()
                    .says(&subscribe("/attack/churn", ""))
                    .times(200),
                Client::tcp().repeats_each(0..300, churn).times(20),
            ]
            .concat()
        },
    ),
    Attack::new(
        "service-churn",
        "20 clients provide and withdraw services, over and over",
        || {
            each(0..20, |k| {
                let churn = |n: usize| {
                    on_service(
                        ["advertise_service", "unadvertise_service"][n % 2],
                        &format!("/attack/{k}/{}", n / 2),
                    )
                };
                Client::tcp().repeats_each(0..500, churn)
            })
        },
    ),
    Attack::new(
        "subscription-ids",
        "10 clients subscribe 1,000 times to one topic that 2 clients flood",
        || {
            let one = |k: usize| {
                subscribe(
                    "/attack/ids",
                    &format!(r#","id":"{k}","throttle_rate":{k},"queue_length":{k}"#),
                )
            };
            let flood = Client::tcp()
                .advertises("/attack/ids")
                .floods(&publish("/attack/ids", r#"{"data":1}"#))
                .after(300)
                .times(2);
            [Client::tcp().says_each(1..1_000, one).times(10), flood].concat()
        },
    ),
];

fn registrations_of(k: usize) -> Client {
    let name = |n: usize| format!("/{k}/{n}/{}", filler(1_000));
    Client::tcp()
        .says_each(0..350, |n| subscribe(&name(n), ""))
        .says_each(0..1_024, |n| on_topic("advertise", &name(n)))
        .says_each(0..256, |n| on_service("advertise_service", &name(n)))
}

fn registrations() -> Vec<Client> {
    each(0..8, registrations_of)
}

/// Fewer names each: all of them together are much more than there is room for.
fn day_long(service: &str, args: &str) -> String {
    format!(r#"{{"op":"call_service","service":"{service}","id":1,"timeout":86400,"args":{args}}}"#)
}

/// The id of a forwarded call, as it stands.
fn id_of(line: &str) -> Option<&str> {
    let from = line.find(r#""id":"#)? + 5;
    let rest = &line[from..];
    line.contains(r#""op":"call_service""#)
        .then(|| &rest[..rest.find([',', '}']).unwrap_or(rest.len())])
}

fn answer(service: &str, id: &str, values: &str) -> Vec<u8> {
    let head = format!(r#""op":"service_response","service":"{service}","id":{id}"#);
    format!("{{{head},\"result\":true,\"values\":{values}}}\n").into_bytes()
}

fn mirrors() -> Vec<Client> {
    fn reply(line: &str) -> Option<Vec<u8>> {
        let id = id_of(line)?;
        let from = line.find("/attack/mirror/")?;
        let service = &line[from..from + line[from..].find('"')?];
        let again = light(service);
        Some(
            [
                answer(service, id, "{}"),
                format!("{again}\n{again}\n").into_bytes(),
            ]
            .concat(),
        )
    }
    each(0..20, |k| {
        let service = format!("/attack/mirror/{k}");
        Client::tcp()
            .says(&on_service("advertise_service", &service))
            .says(&light(&service))
            .replies(reply)
    })
}

fn takeovers() -> Vec<Client> {
    let provide = on_service("advertise_service", "/attack/taken");
    [
        Client::tcp().floods(&provide).times(20),
        Client::tcp().floods(&light("/attack/taken")).times(10),
    ]
    .concat()
}

fn lists() -> Vec<Client> {
    let advertise = each(0..4, |k| {
        let frame = move |n| {
            format!(
                r#"{{"op":"advertise","topic":"/attack/list/{k}/{n}","type":"std_msgs/msg/Header"}}"#
            )
        };
        Client::tcp().says_each(0..1_024, frame)
    });
    [
        advertise,
        Client::tcp()
            .floods(&light("/rosapi/topics_and_raw_types"))
            .after(300)
            .times(4),
    ]
    .concat()
}

fn details() -> Vec<Client> {
    let ask = [
        call("/rosapi/node_details", "1", r#"{"node":"/gateway"}"#),
        call(
            "/rosapi/message_details",
            "1",
            r#"{"type":"diagnostic_msgs/msg/DiagnosticArray"}"#,
        ),
        call(
            "/rosapi/topics_for_type",
            "1",
            r#"{"type":"std_msgs/msg/Header"}"#,
        ),
        call("/rosapi/get_param", "1", r#"{"name":"robot_description"}"#),
        light("/rosapi/interfaces"),
        light("/rosapi/services"),
    ];
    Client::tcp()
        .repeats_each(0..ask.len(), |k| ask[k].clone())
        .times(10)
}

fn parameters() -> Vec<Client> {
    let ask = [
        call(
            "/rosapi/set_param",
            "1",
            r#"{"name":"gravity","value":"9.8"}"#,
        ),
        call("/rosapi/get_param", "1", r#"{"name":"masses"}"#),
        call("/rosapi/delete_param", "1", r#"{"name":"kp"}"#),
        call(
            "/rosapi/set_param",
            "1",
            &format!(r#"{{"name":"kp","value":"[{}1]"}}"#, "1,".repeat(10_000)),
        ),
    ];
    Client::tcp()
        .repeats_each(0..ask.len(), |k| ask[k].clone())
        .times(10)
}

fn spellings() -> Vec<Client> {
    let spelling = |k: usize| match k % 5 {
        0 => light("arm_sim/pause"),
        1 => light("//arm_sim//pause/"),
        2 => light(r"\u002farm_sim\u002fp\u0061use"),
        3 => subscribe(&format!("joint_states{}", "/".repeat(k)), ""),
        _ => light(&format!("/{}", filler(1_023))),
    };
    Client::tcp().repeats_each(0..500, spelling).times(10)
}

fn latched() -> Vec<Client> {
    let again = |k: usize| {
        let topic = ["/robot_description", "/tf_static"][k % 2];
        let id = k % 64;
        format!(
            "{}\n{}",
            format_args!(r#"{{"op":"unsubscribe","topic":"{topic}","id":"{id}"}}"#),
            subscribe(topic, &format!(r#","id":"{id}""#))
        )
    };
    Client::tcp().repeats_each(0..256, again).times(20)
}
