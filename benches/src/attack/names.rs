//! Attacks on the registry: names, providers, waiting calls, lists of names.

use super::Attack;
use super::script::{
    Client, LONG, MIB, MOST, call, each, filler, light, on_service, on_topic, publish, subscribe,
};

pub const ATTACKS: &[Attack] = &[
    Attack::new(
        "registrations",
        "200 clients subscribe under as many names of 1,000 bytes as they may",
        || {
            let name = |k, n| format!("/{k}/{n}/{}", filler(1_000));
            each(0..200, |k| {
                Client::tcp().says_each(0..MOST, |n| subscribe(&name(k, n), ""))
            })
        },
    ),
    Attack::new(
        "leaving-together",
        "200 clients with all the subscriptions that they may have leave at one instant",
        || {
            Client::tcp()
                .says(r#"{"op":"set_level","level":"none"}"#)
                .says_each(0..MOST, |n| subscribe(&format!("/{n}"), ""))
                .leaves_after(5_000)
                .times(200)
        },
    ),
    Attack::new(
        "day-long-calls",
        "21 clients provide a service, call it with 4 MiB for a day and read nothing",
        || {
            let rest = format!(r#""timeout":86400,"args":{{"data":"{}"}}"#, filler(LONG));
            each(0..21, |k| {
                let service = format!("/attack/day/{k}");
                let call = format!(r#"{{"op":"call_service","service":"{service}",{rest}}}"#);
                Client::tcp()
                    .says(&on_service("advertise_service", &service))
                    .repeats(&call)
                    .deaf()
            })
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
        "takeovers",
        "20 clients take a service from one another, 10 call it",
        || {
            let provide = on_service("advertise_service", "/attack/taken");
            [
                Client::tcp().floods(&provide).times(20),
                Client::tcp().floods(&light("/attack/taken")).times(10),
            ]
            .concat()
        },
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
        "churn",
        "20 clients register and withdraw topics, services and subscriptions; 200 subscribe to the topic",
        || {
            let churn = |k: usize| match k % 8 {
                0 => on_topic("advertise", "/attack/churn"),
                1 => publish("/attack/churn", "{}"),
                2 => on_topic("unadvertise", "/attack/churn"),
                3 => on_service("advertise_service", "/attack/churn"),
                4 => on_service("unadvertise_service", "/attack/churn"),
                5 => subscribe("/joint_states", ""),
                // The description is latched: each subscription gets it.
                6 => subscribe("/robot_description", ""),
                _ => on_topic(
                    "unsubscribe",
                    ["/joint_states", "/robot_description"][k / 8 % 2],
                ),
            };
            let subscriber = Client::tcp().says(&subscribe("/attack/churn", ""));
            let churner = Client::tcp().repeats_each(0..160, churn);
            [subscriber.times(200), churner.times(20)].concat()
        },
    ),
];

/// The id of a forwarded call, unchanged.
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
