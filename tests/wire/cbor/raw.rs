//! `cbor-raw`: messages as CDR, on the runtime's topics and on those whose type is known.

use super::decoder::Cbor;
use super::{binary, paused, subscribe};
use crate::common::Runtime;
use crate::web_client::Socket;
use pendularm_client::codec::Event;
use serde_json::json;

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

/// A trajectory whose times are spelled as in ROS 1, as `cbor`, as `cbor-raw` and as it was sent.
#[test]
fn the_times_of_a_trajectory_from_a_client_of_ros_1_arrive_in_every_form() {
    let (runtime, _) = paused();
    let sent = json!({"joint_names": ["joint1", "joint2"], "header": {"stamp": {"secs": 0, "nsecs": 0}},
        "points": [{"positions": [0.1, 0.2], "time_from_start": {"secs": 2, "nsecs": 5}}]});
    let forms = ["cbor", "cbor-raw", "none"].map(|compression| {
        let mut socket = Socket::open(runtime.address);
        subscribe(&mut socket, "/joint_trajectory", compression);
        socket.settle();
        socket
    });
    let mut talker = runtime.connect();
    talker.send(&json!({"op": "publish", "topic": "/joint_trajectory", "msg": sent}));
    let [mut cbor, mut raw, mut plain] = forms;
    let frame = binary(&mut cbor);
    let Cbor::Array(points) = frame.get("msg").get("points") else {
        panic!("{frame:?}");
    };
    let time = points[0].get("time_from_start");
    assert_eq!(time.get("sec"), &Cbor::Integer(2));
    assert_eq!(time.get("nanosec"), &Cbor::Integer(5));
    let frame = binary(&mut raw);
    let Cbor::Bytes(bytes) = frame.get("msg").get("bytes") else {
        panic!("{frame:?}");
    };
    assert!(bytes.ends_with(&[2, 0, 0, 0, 5, 0, 0, 0]), "{bytes:?}");
    assert_eq!(plain.receive()["msg"], sent);
}
