//! Messages as binary, byte for byte: CBOR (RFC 8949), typed arrays in it (RFC 8746), and CDR within it.
//!
//! **Invariant:** the expected bytes are written by hand from the standards. The runtime's own code does not read them
//! back.

use pendularm::protocol::ros::cbor;
use serde_json::value::{RawValue, to_raw_value};
use serde_json::{Value, json};

fn publish(topic: &str, type_name: Option<&str>, msg: &Value) -> Vec<u8> {
    let msg = to_raw_value(msg).unwrap();
    cbor::publish(topic, type_name, &msg, usize::MAX).expect("room")
}

fn publish_raw(topic: &str, type_name: &str, msg: &Value) -> Option<Vec<u8>> {
    let msg = to_raw_value(msg).unwrap();
    cbor::publish_raw(topic, type_name, &msg, usize::MAX)
}

/// A row: type, message, and the bytes of the message. They are hexadecimal; `"text"` is a CBOR text, `f(1.5)` for a
/// CBOR double, `l(1.5)` for the 8 bytes of a little-endian double, and `..` for any rest. A type after `raw ` is sent
/// as `cbor-raw`.
const ROWS: &str = include_str!("cbor.txt");

/// Text of at most 23 bytes.
fn text(text: &str) -> Vec<u8> {
    let length = u8::try_from(text.len()).unwrap();
    assert!(length < 24);
    let mut bytes = vec![0x60 + length];
    bytes.extend(text.as_bytes());
    bytes
}

/// The head of every frame of the topic `/t`: a map of three, whose last key is `msg`.
fn head() -> Vec<u8> {
    let texts = ["op", "publish", "topic", "/t", "msg"].map(text);
    [&[0xa3], texts.concat().as_slice()].concat()
}

fn spelled_out(word: &str) -> Vec<u8> {
    let inner = |start: &str, end: &str| word.strip_prefix(start)?.strip_suffix(end);
    if let Some(found) = inner("\"", "\"") {
        text(found)
    } else if let Some(number) = inner("f(", ")") {
        let number: f64 = number.parse().unwrap();
        [&[0xfb][..], &number.to_be_bytes()].concat()
    } else if let Some(number) = inner("l(", ")") {
        number.parse::<f64>().unwrap().to_le_bytes().to_vec()
    } else {
        vec![u8::from_str_radix(word, 16).unwrap()]
    }
}

#[test]
fn every_message_has_the_bytes_of_its_row() {
    for row in ROWS.lines().filter(|row| row.contains(" | ")) {
        let [type_name, msg, bytes] = row.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{row}");
        };
        let msg: Value = serde_json::from_str(msg).unwrap();
        let frame = match type_name.strip_prefix("raw ") {
            Some(type_name) => publish_raw("/t", type_name, &msg).expect("a known type"),
            None => publish("/t", Some(type_name).filter(|name| *name != "-"), &msg),
        };
        let found = frame.strip_prefix(&head()[..]).expect("the head");
        let (bytes, is_whole) = match bytes.strip_suffix(" ..") {
            Some(start) => (start, false),
            None => (bytes, true),
        };
        let expected: Vec<u8> = bytes.split(' ').flat_map(spelled_out).collect();
        let found = if is_whole {
            found
        } else {
            &found[..expected.len()]
        };
        assert_eq!(found, expected, "{row}");
    }
}

#[test]
fn long_text_has_its_length_in_the_bytes_behind_the_first_and_a_list_a_mark_at_its_end() {
    let behind_head = |msg: Value| publish("/t", None, &msg).split_off(head().len());
    let long = "x".repeat(300);
    let expected = [&[0x79, 0x01, 0x2c], long.as_bytes()].concat();
    assert_eq!(behind_head(json!(long)), expected);
    let expected = [&[0x9f][..], &[0x00; 24], &[0xff]].concat();
    assert_eq!(behind_head(json!(vec![0; 24])), expected);
}

/// A frame may wait for long, and only its bytes are counted.
#[test]
fn a_frame_has_no_spare_room() {
    for length in [1, 300, 100_000] {
        let frame = publish("/t", None, &json!({"data": "x".repeat(length)}));
        assert_eq!(frame.capacity(), frame.len());
        let msg = json!({"name": [], "position": vec![0.5; length]});
        let frame = publish_raw("/t", "sensor_msgs/msg/JointState", &msg).unwrap();
        assert_eq!(frame.capacity(), frame.len());
    }
}

/// Three bytes of JSON, `{},`, may be a message of eighty bytes, so the frame is too long for every subscriber.
#[test]
fn a_frame_that_would_be_longer_than_it_may_be_is_not_made() {
    let transforms = json!({"transforms": vec![json!({}); 100]});
    let type_name = "tf2_msgs/msg/TFMessage";
    let long = publish_raw("/t", type_name, &transforms).unwrap();
    assert!(long.len() > 8_000, "{}", long.len());
    let msg = to_raw_value(&transforms).unwrap();
    for (missing, made) in [(0, Some(&long)), (1, None), (long.len(), None)] {
        let most = long.len() - missing;
        let raw = cbor::publish_raw("/t", type_name, &msg, most);
        assert_eq!(raw.as_ref(), made, "{missing}");
    }
    let short = publish("/t", None, &transforms);
    for (missing, made) in [(0, Some(&short)), (1, None)] {
        let most = short.len() - missing;
        let untyped = cbor::publish("/t", None, &msg, most);
        assert_eq!(untyped.as_ref(), made, "{missing}");
    }
}

/// One message with both spellings of stamps and durations, at any depth, gives the same bytes.
#[test]
fn stamps_and_durations_are_read_under_their_names_of_ros_1_too() {
    let spelled = |sec: &str, nanosec: &str| {
        let time = |s: i64, ns: u64| json!({sec: s, nanosec: ns});
        let point = json!({"positions": [1.0], "time_from_start": time(-3, 4)});
        let header = json!({"stamp": time(1, 2), "frame_id": "f"});
        [
            (
                "trajectory_msgs/JointTrajectory",
                json!({"header": header, "points": [point, point]}),
            ),
            ("sensor_msgs/msg/JointState", json!({"header": header})),
            (
                "tf2_msgs/TFMessage",
                json!({"transforms": [{"header": header}]}),
            ),
            ("rosgraph_msgs/msg/Clock", json!({"clock": time(7, 8)})),
            ("builtin_interfaces/msg/Duration", json!({nanosec: 9})),
            (
                "std_msgs/msg/Header",
                json!({"stamp": {sec: 5}, "frame_id": "f"}),
            ),
        ]
    };
    for ((type_name, ros2), (_, ros1)) in spelled("sec", "nanosec")
        .into_iter()
        .zip(spelled("secs", "nsecs"))
    {
        let raw = publish_raw("/t", type_name, &ros2);
        assert_eq!(publish_raw("/t", type_name, &ros1), raw, "{type_name}");
        assert!(raw.is_some(), "{type_name}");
        let cbor = publish("/t", Some(type_name), &ros2);
        assert_eq!(publish("/t", Some(type_name), &ros1), cbor, "{type_name}");
    }
}

/// A message in JSON text, as CBOR of a known type, as CBOR of no known type, and as CDR.
fn encodings(type_name: &str, text: &str) -> [Option<Vec<u8>>; 3] {
    let msg: &RawValue = serde_json::from_str(text).unwrap();
    [
        cbor::publish("/t", Some(type_name), msg, usize::MAX),
        cbor::publish("/t", None, msg, usize::MAX),
        cbor::publish_raw("/t", type_name, msg, usize::MAX),
    ]
}

#[test]
fn a_string_with_half_of_a_surrogate_pair_has_no_encoding() {
    let half = encodings("std_msgs/String", r#"{"data":"\ud800"}"#);
    assert_eq!(half, [None, None, None]);
    let whole = encodings("std_msgs/String", r#"{"data":"\ud83d\ude00"}"#);
    assert!(whole.iter().all(Option::is_some));
}

#[test]
fn of_a_repeated_name_the_last_member_counts() {
    let [once, _, once_raw] = encodings("std_msgs/String", r#"{"data":"b"}"#);
    let [twice, _, twice_raw] = encodings("std_msgs/String", r#"{"data":"a","data":"b"}"#);
    assert_eq!((twice, twice_raw), (once, once_raw));
}

/// A frame has at most 128 levels, and its message one fewer.
#[test]
fn a_message_may_be_nested_as_deep_as_a_frame() {
    let nested = "[".repeat(127) + &"]".repeat(127);
    let [_, frame, _] = encodings("std_msgs/String", &nested);
    let expected = [head(), vec![0x9f; 127], vec![0xff; 127]].concat();
    assert_eq!(frame, Some(expected));
}
