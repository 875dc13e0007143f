//! Forwarded series of messages: only messages for which the general reader and writer give the same bytes.
//!
//! **Invariant:** every expectation comes from the general reader and writer, frame by frame.

use pendularm::protocol::limits::MAX_NAME;
use pendularm::protocol::messages;
use pendularm::protocol::op::{self, Op};
use pendularm::protocol::wire::frame::FrameReader;
use pendularm::protocol::wire::lines::first_message;
use pendularm::protocol::wire::series::{MAX_SERIES, Series};
use proptest::prelude::*;

use crate::json::json_of;

fn line(topic: &str, msg: &str) -> String {
    format!("{{\"op\":\"publish\",\"topic\":\"{topic}\",\"msg\":{msg}}}\n")
}

/// The series at the beginning of a stream, and the rest of the stream.
fn series(stream: &[u8]) -> Option<Series> {
    let mut reader = FrameReader::new();
    reader.push(stream);
    reader.series()
}

/// A stream as the general reader and writer take it: the topic of its last message, and all its messages.
fn general(stream: &[u8]) -> Option<(String, Vec<u8>)> {
    let mut reader = FrameReader::new();
    reader.push(stream);
    let (mut last, mut written) = (None, Vec::new());
    for frame in reader {
        let Ok(Op::Publish { topic, msg, .. }) = op::read(&frame.ok()?.text).op else {
            return None;
        };
        written.extend_from_slice(&messages::publish_raw(&topic, &msg));
        last = Some(topic);
    }
    Some((last?, written))
}

#[test]
fn unusual_lines_are_left_to_the_general_reader() {
    for msg in [
        "{\"a\":1e999}",
        "{\"a\":NaN}",
        "{\"a\":\"\\n\"}",
        "{\"a\":\"µ\"}",
        "{\"a\":01}",
        "{\"a\":1.}",
        "{\"a\":.5}",
        "{\"a\":+1}",
        "{\"a\":-}",
        "{\"a\":tru}",
        "{\"a\":[1,]}",
        "{\"a\":1,}",
        "{,}",
        "{\"a\"}",
        "{\"a\":}",
        "{1:2}",
        "{\"a\":1 2}",
        "{\"a\":[1}",
        "{\"a\":[1}}",
        "{\"a\":1]",
        "{\"a\":{\"b\":1]}",
        "[1]",
        "7",
        "{\"a\":1},\"id\":\"x\"",
        "{\"a\":\"\u{1}\"}",
    ] {
        assert_eq!(series(line("/x", msg).as_bytes()), None, "{msg}");
    }
    let long = format!("{{\"a\":{}}}", "9".repeat(400));
    assert_eq!(series(line("/x", &long).as_bytes()), None, "overflows");
    let deep = format!("{{\"a\":{}{}}}", "[".repeat(100), "]".repeat(100));
    assert_eq!(series(line("/x", &deep).as_bytes()), None, "unusually deep");
    for topic in [
        "x",
        "",
        "/x\\u0041",
        "/µ",
        "/joint_states",
        "/joint_trajectory",
    ] {
        assert_eq!(series(line(topic, "{}").as_bytes()), None, "{topic}");
    }
    let name = format!("/{}", "x".repeat(MAX_NAME));
    assert_eq!(
        series(line(&name, "{}").as_bytes()),
        None,
        "too long a name"
    );
    assert!(series(line(&name[..MAX_NAME], "{}").as_bytes()).is_some());
    let unended = line("/x", "{}");
    assert_eq!(
        series(unended.trim_end().as_bytes()),
        None,
        "no newline yet"
    );
}

#[test]
fn a_series_ends_where_something_else_comes_and_the_stream_goes_on_there() {
    let (x, y) = (line("/x", "{\"n\":1}"), line("/y", "{}"));
    let pause = "{\"op\":\"call_service\",\"service\":\"/arm_sim/pause\"}\n";
    let mut reader = FrameReader::new();
    reader.push(format!("\r\n {x}{x}{y}{pause}{x}{}", &x[..20]).as_bytes());
    assert_eq!(reader.series().unwrap().frames, x.repeat(2));
    assert_eq!(reader.series().unwrap().frames, y);
    assert_eq!(reader.series(), None);
    assert_eq!(reader.next().unwrap().unwrap().text, pause.trim_end());
    assert_eq!(reader.series().unwrap().frames, x);
    assert_eq!((reader.series(), reader.next()), (None, None));
    // A frame that has begun is read to its end by the general reader.
    reader.push(format!("{}{x}", &x[20..]).as_bytes());
    assert_eq!(reader.series(), None);
    assert_eq!(reader.next().unwrap().unwrap().text, x.trim_end());
    assert_eq!(reader.series().unwrap().frames, x);
}

/// The reader does not search its end, which would take milliseconds of the gateway for each subscriber.
#[test]
fn a_line_longer_than_a_series_is_one_message() {
    let with_newline = line("/x", &format!("\"\n{}\"", "x".repeat(MAX_SERIES)));
    assert_eq!(first_message(with_newline.as_bytes()), with_newline.len());
    let series = line("/x", "{}").repeat(2);
    assert_eq!(first_message(series.as_bytes()), series.len() / 2);
}

#[test]
fn a_series_is_bounded() {
    let x = line("/x", "{\"data\":\"0123456789\"}");
    let stream = x.repeat(4 * MAX_SERIES / x.len());
    let mut reader = FrameReader::new();
    reader.push(stream.as_bytes());
    let mut all = Vec::new();
    while let Some(series) = reader.series() {
        assert!(series.frames.len() <= MAX_SERIES);
        all.extend_from_slice(&series.frames);
    }
    assert_eq!(all, stream.into_bytes());
    let long = format!("{{\"data\":\"{}\"}}", "x".repeat(MAX_SERIES));
    assert_eq!(series(line("/x", &long).as_bytes()), None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    /// A message is in a series only if the general reader and writer give the same bytes. A change
    /// sets or inserts any byte, half of the time one with a meaning in JSON.
    #[test]
    fn a_series_gives_the_same_result_as_the_general_reader(
        msg in json(),
        count in 1_usize..4,
        changes in prop::collection::vec((any::<prop::sample::Index>(), byte(), any::<bool>()), 0..3),
    ) {
        let mut stream = line("/load/x", &msg).repeat(count).into_bytes();
        if changes.is_empty() {
            prop_assert!(series(&stream).is_some_and(|series| series.frames == stream));
        }
        for (index, byte, is_inserted) in &changes {
            let at = index.index(stream.len());
            stream.splice(at..at + usize::from(!is_inserted), [*byte]);
        }
        if let Some(series) = series(&stream) {
            // White space before a frame is skipped.
            let stream = stream.trim_ascii_start();
            prop_assert!(stream.starts_with(&series.frames));
            let whole = general(&series.frames);
            prop_assert_eq!(whole, Some((series.topic.to_string(), series.frames.to_vec())));
        }
    }
}

fn byte() -> impl Strategy<Value = u8> {
    let matter = b"{}[]\",:.-+eE0129 \t\r\n\\tfnNI\x7f\x80\xff\x00";
    prop_oneof![any::<u8>(), prop::sample::select(matter.to_vec())]
}

/// An object of plain JSON.
fn json() -> impl Strategy<Value = String> {
    let leaf = prop_oneof![
        prop::sample::select(vec!["null", "0", "-0.5"]).prop_map(str::to_owned),
        Just("true".to_owned()),
        Just("false".to_owned()),
        any::<i64>().prop_map(|number| number.to_string()),
        (-1e3..1e3).prop_map(|number: f64| format!("{number:.9}")),
        "[ !#-\\[\\]-~]{0,40}".prop_map(|text| format!("\"{text}\"")),
    ];
    json_of(leaf, "\"key[0-9]\"").prop_map(|value| format!("{{ \"a\" :{value}}}"))
}
