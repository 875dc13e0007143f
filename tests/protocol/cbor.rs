//! Messages as binary, byte for byte: CBOR (RFC 8949), typed arrays in it (RFC 8746), and CDR within it.
//!
//! **Invariant:** the expected bytes are written from the standards, by hand; nothing here is read back by our own code.

use pendularm::protocol::ros::cbor;
use pendularm::protocol::ros::tree::MessageTree;
use serde_json::{Value, json};

fn publish(topic: &str, type_name: Option<&str>, msg: &Value) -> Vec<u8> {
    let tree = MessageTree::from(msg);
    cbor::publish(topic, type_name, tree.root(), usize::MAX).expect("room")
}

fn publish_raw(topic: &str, type_name: &str, msg: &Value) -> Option<Vec<u8>> {
    let tree = MessageTree::from(msg);
    cbor::publish_raw(topic, type_name, tree.root(), usize::MAX)
}

/// The head of every frame of the topic `/t`: a map of three, whose last key is `msg`.
fn head() -> Vec<u8> {
    let mut head = vec![0xa3, 0x62];
    head.extend(b"op");
    head.push(0x67);
    head.extend(b"publish");
    head.push(0x65);
    head.extend(b"topic");
    head.push(0x62);
    head.extend(b"/t");
    head.push(0x63);
    head.extend(b"msg");
    head
}

/// The part of a frame behind its head.
#[track_caller]
fn behind_head(frame: &[u8]) -> Vec<u8> {
    frame.strip_prefix(&head()[..]).expect("the head").to_vec()
}

/// A message of no known type.
#[track_caller]
fn untyped(msg: Value) -> Vec<u8> {
    behind_head(&publish("/t", None, &msg))
}

#[track_caller]
fn typed(type_name: &str, msg: Value) -> Vec<u8> {
    behind_head(&publish("/t", Some(type_name), &msg))
}

/// Text of at most 23 bytes.
fn text(text: &str) -> Vec<u8> {
    let length = u8::try_from(text.len()).unwrap();
    assert!(length < 24);
    let mut bytes = vec![0x60 + length];
    bytes.extend(text.as_bytes());
    bytes
}

fn float(value: f64) -> Vec<u8> {
    let mut bytes = vec![0xfb];
    bytes.extend(value.to_be_bytes());
    bytes
}

#[test]
fn whole_numbers_take_as_few_bytes_as_may_be() {
    // RFC 8949, appendix A, and the numbers at which one more byte is needed.
    for (number, bytes) in [
        (json!(0), &[0x00][..]),
        (json!(23), &[0x17]),
        (json!(24), &[0x18, 0x18]),
        (json!(255), &[0x18, 0xff]),
        (json!(256), &[0x19, 0x01, 0x00]),
        (json!(65_535), &[0x19, 0xff, 0xff]),
        (json!(65_536), &[0x1a, 0, 1, 0, 0]),
        (json!(4_294_967_295_u64), &[0x1a, 0xff, 0xff, 0xff, 0xff]),
        (json!(4_294_967_296_u64), &[0x1b, 0, 0, 0, 1, 0, 0, 0, 0]),
        (
            json!(u64::MAX),
            &[0x1b, 255, 255, 255, 255, 255, 255, 255, 255],
        ),
        (json!(-1), &[0x20]),
        (json!(-24), &[0x37]),
        (json!(-25), &[0x38, 0x18]),
        (json!(-1000), &[0x39, 0x03, 0xe7]),
        (
            json!(i64::MIN),
            &[0x3b, 0x7f, 255, 255, 255, 255, 255, 255, 255],
        ),
    ] {
        assert_eq!(untyped(number.clone()), bytes, "{number}");
    }
}

#[test]
fn other_values_are_what_the_standard_calls_them() {
    assert_eq!(untyped(json!(null)), [0xf6]);
    assert_eq!(untyped(json!(false)), [0xf4]);
    assert_eq!(untyped(json!(true)), [0xf5]);
    assert_eq!(untyped(json!(1.1)), float(1.1));
    assert_eq!(untyped(json!("")), [0x60]);
    assert_eq!(untyped(json!("ü")), [0x62, 0xc3, 0xbc]);
    assert_eq!(
        untyped(json!([1, [2, 3], []])),
        [0x83, 0x01, 0x82, 0x02, 0x03, 0x80]
    );
    let object = [&[0xa2][..], &text("a"), &[0x01], &text("b"), &[0xa0]].concat();
    assert_eq!(untyped(json!({"a": 1, "b": {}})), object);
}

#[test]
fn long_text_and_long_lists_have_their_length_in_the_bytes_behind_the_first() {
    let long = "x".repeat(300);
    let expected = [&[0x79, 0x01, 0x2c], long.as_bytes()].concat();
    assert_eq!(untyped(json!(long)), expected);
    let expected = [&[0x98, 24][..], &[0x00; 24]].concat();
    assert_eq!(untyped(json!(vec![0; 24])), expected);
}

/// Tag 86, a string of 8 bytes per number, little-endian.
#[test]
fn an_array_of_float64_is_a_typed_array_in_which_null_is_nan() {
    let point = json!({"positions": [1.5, null], "velocities": []});
    let mut expected = vec![0xa2];
    expected.extend(text("positions"));
    expected.extend([0xd8, 86, 0x50]);
    expected.extend(1.5_f64.to_le_bytes());
    expected.extend(f64::NAN.to_le_bytes());
    expected.extend(text("velocities"));
    expected.extend([0xd8, 86, 0x40]);
    assert_eq!(
        typed("trajectory_msgs/msg/JointTrajectoryPoint", point),
        expected
    );
}

/// Tag 78, a string of 4 bytes per number, little-endian; a value that an `int32` can't hold is 0.
#[test]
fn an_array_of_int32_is_a_typed_array_too() {
    let definition = json!({"fieldarraylen": [-1, 258, 3_000_000_000_u64, "x"]});
    let mut expected = vec![0xa1];
    expected.extend(text("fieldarraylen"));
    expected.extend([0xd8, 78, 0x50]);
    expected.extend([255, 255, 255, 255, 2, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(typed("rosapi_msgs/TypeDef", definition), expected);
}

#[test]
fn a_message_has_the_fields_of_its_type_in_the_types_order_and_no_others() {
    let target = json!({"phi": null, "other": 1, "x": 2, "y": 0.5});
    let mut expected = vec![0xa3];
    expected.extend(text("x"));
    // A float64 that JSON writes without a fraction is one all the same.
    expected.extend(float(2.0));
    expected.extend(text("y"));
    expected.extend(float(0.5));
    expected.extend(text("phi"));
    expected.extend(float(f64::NAN));
    assert_eq!(typed("pendularm_interfaces/msg/Target", target), expected);
}

#[test]
fn messages_within_messages_are_written_by_their_own_types() {
    let mut time = vec![0xa1];
    time.extend(text("sec"));
    time.push(0x07);
    let mut header = vec![0xa1];
    header.extend(text("stamp"));
    header.extend(&time);
    let mut expected = vec![0xa2];
    expected.extend(text("header"));
    expected.extend(&header);
    expected.extend(text("status"));
    expected.push(0x82);
    for name in ["a", "b"] {
        expected.push(0xa1);
        expected.extend(text("name"));
        expected.extend(text(name));
    }
    let array = json!({"status": [{"name": "a"}, {"name": "b"}], "header": {"stamp": {"sec": 7}}});
    assert_eq!(typed("diagnostic_msgs/DiagnosticArray", array), expected);
}

#[test]
fn what_does_not_fit_its_type_is_written_as_it_is() {
    assert_eq!(typed("std_msgs/String", json!([1])), [0x81, 0x01]);
    let mut expected = vec![0xa1];
    expected.extend(text("data"));
    expected.push(0x05);
    assert_eq!(typed("std_msgs/String", json!({"data": 5})), expected);
    let mut expected = vec![0xa1];
    expected.extend(text("position"));
    expected.extend(text("none"));
    let state = json!({"position": "none"});
    assert_eq!(typed("sensor_msgs/JointState", state), expected);
    let mut expected = vec![0xa1];
    expected.extend(text("x"));
    expected.push(0xf5);
    assert_eq!(typed("geometry_msgs/Vector3", json!({"x": true})), expected);
    // A type that nobody here knows.
    assert_eq!(
        typed("demo/X", json!({"x": null})),
        [0xa1, 0x61, b'x', 0xf6]
    );
}

/// `cbor-raw`: the time in whole seconds and nanoseconds, then the message's CDR bytes.
fn raw(secs: &[u8], nsecs: &[u8], cdr: &[u8]) -> Vec<u8> {
    let mut expected = vec![0xa3];
    expected.extend(text("secs"));
    expected.extend(secs);
    expected.extend(text("nsecs"));
    expected.extend(nsecs);
    expected.extend(text("bytes"));
    expected.push(0x40 + u8::try_from(cdr.len()).unwrap());
    expected.extend(cdr);
    expected
}

#[test]
fn cbor_raw_is_the_messages_time_and_its_cdr() {
    let clock = json!({"clock": {"sec": 3, "nanosec": 256}});
    let frame = publish_raw("/t", "rosgraph_msgs/Clock", &clock).expect("a known type");
    let cdr = [0, 1, 0, 0, 3, 0, 0, 0, 0, 1, 0, 0];
    assert_eq!(behind_head(&frame), raw(&[0x03], &[0x19, 0x01, 0x00], &cdr));
}

#[test]
fn cbor_raw_of_a_message_without_a_time_says_0() {
    let frame = publish_raw("/t", "std_msgs/String", &json!({"data": "hi"})).expect("a known type");
    let cdr = [0, 1, 0, 0, 3, 0, 0, 0, b'h', b'i', 0];
    assert_eq!(behind_head(&frame), raw(&[0x00], &[0x00], &cdr));
}

#[test]
fn cbor_raw_finds_the_time_wherever_a_message_of_ours_has_it() {
    let time = json!({"sec": 1, "nanosec": 2});
    for (type_name, msg) in [
        ("std_msgs/Header", json!({"stamp": time})),
        ("sensor_msgs/JointState", json!({"header": {"stamp": time}})),
        (
            "tf2_msgs/TFMessage",
            json!({"transforms": [{"header": {"stamp": time}}]}),
        ),
    ] {
        let frame = publish_raw("/t", type_name, &msg).expect("a known type");
        let start = raw(&[0x01], &[0x02], &[]);
        // Up to the length of the bytes.
        let start = start.split_last().unwrap().1;
        assert!(behind_head(&frame).starts_with(start), "{type_name}");
    }
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

/// In three bytes of JSON, `{},`, there may be a message of eighty: the frame is longer than anybody takes.
#[test]
fn a_frame_that_would_be_longer_than_it_may_be_is_not_made() {
    let transforms = json!({"transforms": vec![json!({}); 100]});
    let type_name = "tf2_msgs/msg/TFMessage";
    let long = publish_raw("/t", type_name, &transforms).unwrap();
    assert!(long.len() > 8_000, "{}", long.len());
    let tree = MessageTree::from(&transforms);
    for (missing, made) in [(0, Some(&long)), (1, None), (long.len(), None)] {
        let most = long.len() - missing;
        let raw = cbor::publish_raw("/t", type_name, tree.root(), most);
        assert_eq!(raw.as_ref(), made, "{missing}");
    }
    let short = publish("/t", None, &transforms);
    for (missing, made) in [(0, Some(&short)), (1, None)] {
        let most = short.len() - missing;
        let untyped = cbor::publish("/t", None, tree.root(), most);
        assert_eq!(untyped.as_ref(), made, "{missing}");
    }
}

/// One message in both spellings, of stamps and of durations, at any depth: the same bytes.
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
    // Where both are there, the names of ROS 2 count, and CBOR keeps both.
    let both = json!({"sec": 1, "nanosec": 2, "secs": 3, "nsecs": 4});
    let raw = |msg: &Value| publish_raw("/t", "builtin_interfaces/msg/Time", msg);
    assert_eq!(raw(&both), raw(&json!({"sec": 1, "nanosec": 2})));
    let parts = ["nanosec", "nsecs", "sec", "secs"].map(text);
    let [nanosec, nsecs, sec, secs] = parts.each_ref().map(Vec::as_slice);
    let expected = [&[0xa4], nanosec, &[2], nsecs, &[4], sec, &[1], secs, &[3]].concat();
    assert_eq!(typed("builtin_interfaces/msg/Time", both), expected);
}
