//! The runtime's frames, byte for byte.
//!
//! **Invariant:** the whole output of every encoder is compared.

use bytes::Bytes;
use pendularm::protocol::messages::{
    Clock, DiagnosticArray, DiagnosticStatus, ErrorForm, Header, JointState, KeyValue, Level,
    Stamp, call, failure, message_text, publish, publish_raw, respelled, response, status,
};
use pendularm::protocol::wire::json::Payload;
use proptest::prelude::*;
use serde::Serialize;
use serde_json::json;
use serde_json::value::RawValue;

fn raw(text: &str) -> Payload {
    RawValue::from_string(text.to_owned())
        .expect("valid JSON")
        .into()
}

fn line(frame: &Bytes) -> &str {
    let text = std::str::from_utf8(frame).expect("UTF-8");
    let line = text.strip_suffix('\n').expect("a newline at the end");
    assert!(!line.contains('\n'), "one line: {line}");
    line
}

#[test]
fn messages_have_the_shapes_that_ros_gives_them() {
    let state = JointState {
        header: Header::world(1.25),
        name: &["joint1", "joint2"],
        position: &[0.5, -1.0],
        velocity: &[0.0, 1e-9],
        effort: &[12.0, 1e21],
    };
    let clock = Clock {
        clock: Stamp::from_seconds(2.0),
    };
    let status = DiagnosticStatus {
        level: 1,
        name: "arm_sim",
        message: "paused".to_owned(),
        hardware_id: "",
        values: vec![KeyValue {
            key: "energy",
            value: "1.5".to_owned(),
        }],
    };
    let diagnostics = DiagnosticArray {
        header: Header::world(0.0),
        status: vec![status],
    };
    for (frame, msg) in [
        (
            publish("/x", &state),
            concat!(
                r#"{"header":{"stamp":{"sec":1,"nanosec":250000000},"frame_id":"world"},"name":["joint1","joint2"],"#,
                r#""position":[0.5,-1.0],"velocity":[0.0,1e-9],"effort":[12.0,1e+21]}"#
            ),
        ),
        (publish("/x", &clock), r#"{"clock":{"sec":2,"nanosec":0}}"#),
        (
            publish("/x", &diagnostics),
            concat!(
                r#"{"header":{"stamp":{"sec":0,"nanosec":0},"frame_id":"world"},"status":[{"level":1,"#,
                r#""name":"arm_sim","message":"paused","hardware_id":"","values":[{"key":"energy","value":"1.5"}]}]}"#
            ),
        ),
    ] {
        let whole = format!(r#"{{"op":"publish","topic":"/x","msg":{msg}}}"#);
        assert_eq!(line(&frame), whole);
    }
}

#[test]
fn numbers_that_are_not_finite_are_null() {
    #[derive(Serialize)]
    struct Values {
        a: f64,
        b: [f64; 3],
    }
    let values = Values {
        a: f64::NAN,
        b: [f64::INFINITY, f64::NEG_INFINITY, f64::MAX],
    };
    assert_eq!(
        line(&publish("/x", &values)),
        r#"{"op":"publish","topic":"/x","msg":{"a":null,"b":[null,null,1.7976931348623157e+308]}}"#
    );
}

/// The memory that a frame holds.
fn memory(frame: Bytes) -> usize {
    frame.try_into_mut().expect("nobody else has it").capacity()
}

/// Messages that wait for slow clients are counted by their length, so they may not use more memory.
#[test]
fn many_or_large_waiting_frames_use_no_more_memory_than_their_text() {
    for length in [2, 40, 1000, 100_000] {
        let msg = raw(&format!("{{\"a\":\"{}\"}}", "x".repeat(length)));
        let frame = publish_raw("/chat", &msg);
        let text = frame.len();
        assert_eq!(memory(frame), text);
    }
    let large = "x".repeat(100_000);
    let frame = publish("/large", &large);
    let text = frame.len();
    assert_eq!(memory(frame), text);
    // Forwarded calls and answers are exact too.
    for passed in [raw("{}"), raw(&format!("[\"{}\"]", "x".repeat(10_000)))] {
        for frame in [
            call("/x", "1", &passed),
            response("/x", None, &passed, true, ""),
        ] {
            let text = frame.len();
            assert_eq!(memory(frame), text);
        }
    }
    // Another spelling is counted exactly too.
    let frame = respelled("/x", "x", &publish("/x", &[1, 2, 3]));
    assert!(memory(frame) <= publish("/x", &[1, 2, 3]).len());
}

#[test]
fn a_stamp_splits_seconds_carries_when_it_rounds_up_and_saturates() {
    const LAST: i32 = i32::MAX;
    for (seconds, sec, nanosec) in [
        (0.001, 0, 1_000_000),
        (1.999_999_999, 1, 999_999_999),
        // A third of a nanosecond below two seconds.
        (1.999_999_999_7, 2, 0),
        (2_147_483_647.5, LAST, 500_000_000),
        (2_147_483_648.0, LAST, 999_999_999),
        (1e300, LAST, 999_999_999),
        (f64::INFINITY, LAST, 999_999_999),
        (-0.0, 0, 0),
        (-1.0, 0, 0),
        (f64::NEG_INFINITY, 0, 0),
        (f64::NAN, 0, 0),
    ] {
        let stamp = Stamp { sec, nanosec };
        assert_eq!(Stamp::from_seconds(seconds), stamp, "{seconds}");
    }
    assert_eq!(Stamp::MAX, Stamp::from_seconds(1e300));
}

proptest! {
    /// A stamp is the nearest nanosecond: the error is half a nanosecond, plus the spacing of doubles of that size.
    #[test]
    fn a_stamp_is_the_time_to_the_nearest_nanosecond(seconds in 0.0..2e9_f64) {
        let stamp = Stamp::from_seconds(seconds);
        prop_assert!(stamp.nanosec < 1_000_000_000);
        let off = (f64::from(stamp.sec) - seconds) + f64::from(stamp.nanosec) * 1e-9;
        prop_assert!(off.abs() <= 0.5e-9 + seconds * f64::EPSILON, "{off}");
    }

    #[test]
    fn any_text_gives_one_line_of_valid_json(topic in any::<String>(), text in any::<String>()) {
        for frame in [
            publish(&topic, &text),
            status(Level::Info, &text, None),
            failure(&topic, None, &text, ErrorForm::Text),
            call(&topic, &text, &raw("{}")),
        ] {
            prop_assert!(serde_json::from_str::<serde_json::Value>(line(&frame)).is_ok());
        }
    }
}

/// A topic is known with and without its slash, and each subscriber reads its own spelling.
#[test]
fn a_message_can_be_sent_under_another_spelling_of_its_topic() {
    let frame = publish("/a\"b", &json!({"x": [1, null]}));
    assert_eq!(message_text("/a\"b", &frame), br#"{"x":[1,null]}"#);
    let other = publish("a\"b", &json!({"x": [1, null]}));
    assert_eq!(respelled("/a\"b", "a\"b", &frame), other);
    let same = respelled("/a\"b", "/a\"b", &frame);
    assert_eq!(same.as_ptr(), frame.as_ptr(), "the bytes are shared");
}
