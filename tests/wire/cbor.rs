//! `compression`: what subscribers over WebSocket get as CBOR and as CDR within CBOR.
//!
//! **Invariant:** binary messages are read here by a decoder of their own, written from the standards.

#![cfg(feature = "web")]
use crate::common::Runtime;
use crate::web_client::Socket;
use pendularm_client::codec::Event;
use serde_json::json;

/// A CBOR value.
#[derive(Debug, Clone, PartialEq)]
enum Cbor {
    Integer(i128),
    Float(f64),
    Text(String),
    Bytes(Vec<u8>),
    Array(Vec<Cbor>),
    Map(Vec<(String, Cbor)>),
    Floats(Vec<f64>),
    Simple(u8),
}

impl Cbor {
    fn read(bytes: &[u8]) -> Self {
        let mut rest = bytes;
        let value = Self::next(&mut rest);
        assert!(rest.is_empty(), "{} bytes behind the value", rest.len());
        value
    }

    fn take<'a>(rest: &mut &'a [u8], count: usize) -> &'a [u8] {
        let (taken, behind) = rest.split_at(count);
        *rest = behind;
        taken
    }

    fn next(rest: &mut &[u8]) -> Self {
        let first = Self::take(rest, 1)[0];
        let (major, short) = (first >> 5, first & 31);
        if major == 7 {
            return match short {
                27 => Self::Float(f64::from_be_bytes(Self::take(rest, 8).try_into().unwrap())),
                simple => Self::Simple(simple),
            };
        }
        let number = match short {
            0..=23 => u64::from(short),
            24..=27 => Self::take(rest, 1 << (short - 24))
                .iter()
                .fold(0, |number, byte| number << 8 | u64::from(*byte)),
            other => panic!("no length: {other}"),
        };
        let count = usize::try_from(number).unwrap();
        match major {
            0 => Self::Integer(number.into()),
            1 => Self::Integer(-1 - i128::from(number)),
            2 => Self::Bytes(Self::take(rest, count).to_vec()),
            3 => Self::Text(String::from_utf8(Self::take(rest, count).to_vec()).unwrap()),
            4 => Self::Array((0..count).map(|_| Self::next(rest)).collect()),
            5 => Self::Map(
                (0..count)
                    .map(|_| match Self::next(rest) {
                        Self::Text(key) => (key, Self::next(rest)),
                        other => panic!("not a key: {other:?}"),
                    })
                    .collect(),
            ),
            _ => match (number, Self::next(rest)) {
                (86, Self::Bytes(bytes)) => Self::Floats(
                    bytes
                        .chunks_exact(8)
                        .map(|chunk| f64::from_le_bytes(chunk.try_into().unwrap()))
                        .collect(),
                ),
                (tag, tagged) => panic!("tag {tag} of {tagged:?}"),
            },
        }
    }

    fn get(&self, key: &str) -> &Self {
        let Self::Map(members) = self else {
            panic!("no map: {self:?}");
        };
        let found = members.iter().find(|(one, _)| one == key);
        &found.unwrap_or_else(|| panic!("no {key} in {self:?}")).1
    }

    fn text(&self) -> &str {
        match self {
            Self::Text(text) => text,
            other => panic!("no text: {other:?}"),
        }
    }
}

/// The next binary message.
fn binary(socket: &mut Socket) -> Cbor {
    loop {
        match socket.event() {
            Event::Binary(bytes) => return Cbor::read(&bytes),
            Event::Pong(_) => {}
            other => panic!("not binary: {other:?}"),
        }
    }
}

fn subscribe(socket: &mut Socket, topic: &str, compression: &str) {
    socket.send(&json!({"op": "subscribe", "topic": topic, "compression": compression}));
}

/// Decimal fractions on which a reader that rounds twice is off by the last bit: what is encoded is what Rust's own parser reads.
#[test]
fn a_double_of_a_client_arrives_to_the_last_bit() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let mut client = runtime.connect();
    subscribe(&mut socket, "/x", "cbor");
    socket.settle();
    client.send(&json!({"op": "advertise", "topic": "/x"}));
    for text in [
        "31.245270191439438",
        "121.48791951161945",
        "100.78399658203125",
        "0.30000000000000004",
        "5e-324",
        "1.7976931348623157e308",
        "2.2250738585072011e-308",
    ] {
        let frame =
            format!("{{\"op\":\"publish\",\"topic\":\"/x\",\"msg\":{{\"data\":{text}}}}}\n");
        client.send_bytes(frame.as_bytes());
        let expected: f64 = text.parse().unwrap();
        match binary(&mut socket).get("msg").get("data") {
            Cbor::Float(value) => assert_eq!(value.to_bits(), expected.to_bits(), "{text}"),
            other => panic!("no double: {other:?}"),
        }
    }
}

/// `sensor_msgs/msg/JointState` as CDR has it, read back; names and the four arrays must have come to the last byte.
fn read_joint_state(bytes: &[u8]) -> (i32, String, Vec<String>, [Vec<f64>; 3]) {
    assert_eq!(bytes[..4], [0, 1, 0, 0], "little-endian CDR");
    let body = &bytes[4..];
    let mut at = 0;
    let word = |at: &mut usize| {
        *at = at.next_multiple_of(4);
        *at += 4;
        u32::from_le_bytes(body[*at - 4..*at].try_into().unwrap())
    };
    let text = |at: &mut usize| {
        let length = word(at) as usize;
        *at += length;
        assert_eq!(body[*at - 1], 0, "a text ends in a NUL");
        String::from_utf8(body[*at - length..*at - 1].to_vec()).unwrap()
    };
    let sec = word(&mut at) as i32;
    word(&mut at);
    let frame_id = text(&mut at);
    let count = word(&mut at);
    let names = (0..count).map(|_| text(&mut at)).collect();
    let arrays = [(); 3].map(|()| {
        let count = word(&mut at) as usize;
        if count > 0 {
            at = at.next_multiple_of(8);
        }
        at += 8 * count;
        body[at - 8 * count..at]
            .chunks_exact(8)
            .map(|chunk| f64::from_le_bytes(chunk.try_into().unwrap()))
            .collect()
    });
    assert_eq!(at, body.len());
    (sec, frame_id, names, arrays)
}

/// The arm in its starting pose, paused, so that every encoding tells the same state.
fn paused() -> (Runtime, Socket) {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.call("/arm_sim/pause", json!({"data": true}));
    socket.call("/arm_sim/reset", json!({}));
    (runtime, socket)
}

#[test]
fn a_message_in_cbor_has_its_numbers_in_typed_arrays() {
    let (_runtime, mut socket) = paused();
    subscribe(&mut socket, "joint_states", "cbor");
    let frame = binary(&mut socket);
    assert_eq!(frame.get("op").text(), "publish");
    assert_eq!(frame.get("topic").text(), "joint_states");
    let msg = frame.get("msg");
    assert_eq!(msg.get("position"), &Cbor::Floats(vec![0.0, 0.0]));
    assert_eq!(msg.get("header").get("stamp").get("sec"), &Cbor::Integer(0));
    assert_eq!(msg.get("header").get("frame_id").text(), "world");
    let names = ["joint1", "joint2"].map(|name| Cbor::Text(name.to_owned()));
    assert_eq!(msg.get("name"), &Cbor::Array(names.to_vec()));
}

#[test]
fn a_message_in_cbor_raw_is_cdr_in_cbor() {
    let (_runtime, mut socket) = paused();
    subscribe(&mut socket, "/joint_states", "cbor-raw");
    let frame = binary(&mut socket);
    let msg = frame.get("msg");
    assert_eq!(
        (msg.get("secs"), msg.get("nsecs")),
        (&Cbor::Integer(0), &Cbor::Integer(0))
    );
    let Cbor::Bytes(bytes) = msg.get("bytes") else {
        panic!("{msg:?}");
    };
    let (sec, frame_id, names, arrays) = read_joint_state(bytes);
    assert_eq!((sec, frame_id.as_str()), (0, "world"));
    assert_eq!(names, ["joint1", "joint2"]);
    assert_eq!(arrays, [(); 3].map(|()| vec![0.0, 0.0]));
}

#[test]
fn every_topic_of_the_runtime_that_speaks_by_itself_can_be_had_as_cbor_raw() {
    let (_runtime, mut socket) = paused();
    for topic in [
        "/joint_states",
        "/clock",
        "/diagnostics",
        "/tf",
        "/tf_static",
        "/robot_description",
        "/robot_description_semantic",
        "/tf2_web_republisher/frames",
    ] {
        subscribe(&mut socket, topic, "cbor-raw");
        let frame = binary(&mut socket);
        assert_eq!(frame.get("topic").text(), topic);
        let Cbor::Bytes(bytes) = frame.get("msg").get("bytes") else {
            panic!("{frame:?}");
        };
        assert!(bytes.len() > 8 && bytes.starts_with(&[0, 1, 0, 0]));
        socket.send(&json!({"op": "unsubscribe", "topic": topic}));
        // Frames on their way still come.
        socket.send(&json!({"op": "call_service", "service": "/rosapi/nodes"}));
        while matches!(socket.event(), Event::Binary(_)) {}
    }
}

#[test]
fn of_several_subscriptions_the_densest_encoding_counts_and_the_next_when_it_is_gone() {
    let (_runtime, mut socket) = paused();
    let subscribe = |compression: &str| json!({"op": "subscribe", "topic": "/clock", "id": compression, "compression": compression});
    socket.send(&subscribe("none"));
    assert_eq!(socket.receive()["topic"], "/clock");
    socket.send(&subscribe("cbor"));
    let awaited = |socket: &mut Socket, wanted: &dyn Fn(&Event) -> bool| {
        for _ in 0..200 {
            if wanted(&socket.event()) {
                return;
            }
        }
        panic!("it does not come");
    };
    let raw = |message: &Event| matches!(message, Event::Binary(bytes) if matches!(Cbor::read(bytes).get("msg"), Cbor::Map(members) if members.len() == 3));
    awaited(&mut socket, &|message| {
        matches!(message, Event::Binary(_)) && !raw(message)
    });
    socket.send(&subscribe("cbor-raw"));
    awaited(&mut socket, &raw);
    socket.send(&json!({"op": "unsubscribe", "topic": "/clock", "id": "cbor-raw"}));
    awaited(&mut socket, &|message| {
        matches!(message, Event::Binary(_)) && !raw(message)
    });
    socket.send(&json!({"op": "unsubscribe", "topic": "/clock", "id": "cbor"}));
    awaited(&mut socket, &|message| matches!(message, Event::Text(_)));
}

#[test]
fn messages_of_clients_go_as_cbor_whatever_is_in_them() {
    let runtime = Runtime::start();
    let (mut talker, mut listener) = (Socket::open(runtime.address), Socket::open(runtime.address));
    subscribe(&mut listener, "/chat", "cbor");
    listener.settle();
    talker.send(&json!({"op": "advertise", "topic": "/chat"}));
    talker.send_text(
        r#"{"op":"publish","topic":"/chat","msg":{"a":[1,-2,300,70000,5000000000,1.5],"b":{"c":null,"d":true},"e":NaN}}"#,
    );
    let frame = binary(&mut listener);
    let numbers = [1, -2, 300, 70_000, 5_000_000_000].map(Cbor::Integer);
    let mut numbers = numbers.to_vec();
    numbers.push(Cbor::Float(1.5));
    assert_eq!(frame.get("msg").get("a"), &Cbor::Array(numbers));
    assert_eq!(frame.get("msg").get("b").get("c"), &Cbor::Simple(22));
    assert_eq!(frame.get("msg").get("b").get("d"), &Cbor::Simple(21));
    assert_eq!(frame.get("msg").get("e"), &Cbor::Simple(22));
}

#[test]
fn cbor_raw_of_a_type_that_is_not_known_is_refused_and_of_a_known_one_delivered() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.send(&json!({"op": "set_level", "level": "error"}));
    socket.send(
        &json!({"op": "subscribe", "topic": "/x", "compression": "cbor-raw", "type": "demo/X"}),
    );
    let status = socket.receive();
    assert!(
        status["msg"].as_str().unwrap().starts_with("compression"),
        "{status}"
    );
    socket.send(
        &json!({"op": "subscribe", "topic": "/y", "compression": "cbor-raw",
        "type": "std_msgs/String"}),
    );
    socket.send(&json!({"op": "advertise", "topic": "/y", "type": "std_msgs/String"}));
    socket.send(&json!({"op": "publish", "topic": "/y", "msg": {"data": "hi"}}));
    let frame = binary(&mut socket);
    let expected = [&[0, 1, 0, 0, 3, 0, 0, 0][..], b"hi\0"].concat();
    assert_eq!(frame.get("msg").get("bytes"), &Cbor::Bytes(expected));
}

/// `/x` is advertised by another client in such a way, subscribed to as JSON with such a type, if any, and then as
/// cbor-raw of a known type: the next message comes in that form.
#[test]
fn a_type_that_is_known_counts_whoever_gave_none_or_another_before() {
    let string = Some("std_msgs/msg/String");
    for (advertised, as_json) in [
        (None, None),
        (Some("demo/X"), None),
        (None, Some("demo/X")),
        (string, Some("demo/X")),
    ] {
        let runtime = Runtime::start();
        let (mut talker, mut socket) = (runtime.connect(), Socket::open(runtime.address));
        let typed = |op: &str, id: &str, type_name: Option<&str>| {
            let mut frame = json!({"op": op, "id": id, "topic": "/x"});
            if let Some(type_name) = type_name {
                frame["type"] = json!(type_name);
            }
            frame
        };
        talker.send(&typed("advertise", "1", advertised));
        talker.settle();
        socket.send(&typed("subscribe", "a", as_json));
        socket.send(&json!({"op": "set_level", "level": "info"}));
        socket.send(
            &json!({"op": "subscribe", "id": "b", "topic": "/x", "type": string, "compression": "cbor-raw"}),
        );
        let status = socket.receive();
        assert_eq!(status["level"], "info", "{advertised:?}: {status}");
        talker.send(&json!({"op": "publish", "topic": "/x", "msg": {"data": "hi"}}));
        let expected = [&[0, 1, 0, 0, 3, 0, 0, 0][..], b"hi\0"].concat();
        let frame = binary(&mut socket);
        assert_eq!(frame.get("msg").get("bytes"), &Cbor::Bytes(expected));
        let told = talker.ask("/rosapi/topic_type", json!({"topic": "/x"}));
        let first = advertised.or(as_json).or(string);
        assert_eq!(
            told["type"],
            json!(first),
            "as the first to name one had it"
        );
    }
}

#[test]
fn a_type_that_is_advertised_later_is_the_topics() {
    let runtime = Runtime::start();
    let (mut talker, mut socket) = (runtime.connect(), Socket::open(runtime.address));
    talker.send(&json!({"op": "advertise", "topic": "/x"}));
    talker.send(&json!({"op": "advertise", "topic": "/x", "type": "std_msgs/msg/String"}));
    talker.settle();
    subscribe(&mut socket, "/x", "cbor-raw");
    socket.settle();
    talker.send(&json!({"op": "publish", "topic": "/x", "msg": {"data": "hi"}}));
    assert!(matches!(
        binary(&mut socket).get("msg").get("bytes"),
        Cbor::Bytes(_)
    ));
}

#[test]
fn over_raw_tcp_binary_is_refused_and_png_comes_as_it_is() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for (compression, word) in [
        ("cbor", "WebSocket"),
        ("cbor-raw", "WebSocket"),
        ("zip", "compression"),
    ] {
        client.send(&json!({"op": "subscribe", "topic": "/clock", "compression": compression}));
        let status = client.status();
        assert_eq!(status["level"], "error");
        assert!(status["msg"].as_str().unwrap().contains(word), "{status}");
    }
    for compression in ["none", "png"] {
        // Somebody new each time: nothing comes before the subscription is answered.
        let mut client = runtime.connect();
        client.send(&json!({"op": "subscribe", "topic": "/clock", "compression": compression}));
        assert_eq!(client.status()["level"], "info");
        client.message("/clock");
        assert!(client.kept.is_empty(), "{:?}", client.kept);
    }
}
