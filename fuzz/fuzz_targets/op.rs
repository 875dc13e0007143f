//! Frames into operations: any text that the frame reader accepts.
//!
//! Asserted: every frame gives one operation or one error, and its unchanged `id`. Only a JSON object, and the start of
//! an answer with a later fault, gives an operation. Names and numbers are those of the frame, and bounded. So are
//! quotations in an error. A forwarded or echoed payload is one line of strict JSON in which only numbers that overflow
//! have changed.
//!
//! Input: the frames.

#![no_main]

use std::time::Duration;

use libfuzzer_sys::fuzz_target;
use pendularm::protocol::catalog::Topic;
use pendularm::protocol::limits::MAX_NAME;
use pendularm::protocol::messages::{self, ErrorForm, Level};
use pendularm::protocol::op::{
    self, MAX_QUEUE_LENGTH, MAX_THROTTLE, MAX_TIMEOUT, Op, OpError, ProviderOp,
};
use pendularm::protocol::wire::frame::FrameReader;
use pendularm::protocol::wire::json::Payload;
use pendularm::services::trajectory::read_setpoint;
use pendularm_fuzz::json::Json;
use pendularm_fuzz::limits::{READING, hold};
use serde_json::value::RawValue;

/// Longest error: a sentence and an excerpt of the frame.
const LONGEST_COMPLAINT: usize = 512;

fuzz_target!(|input: &[u8]| hold(input.len(), READING, || examine(input)));

fn examine(input: &[u8]) {
    let mut frames = FrameReader::new();
    frames.push(input);
    for frame in frames.by_ref() {
        match frame {
            Ok(frame) => judge(&frame.text),
            Err(error) => check_complaint(&error.to_string()),
        }
    }
    if let Some(error) = frames.finish() {
        check_complaint(&error.to_string());
    }
}

fn check_complaint(why: &str) {
    let line = check_line(&messages::status(Level::Error, why, None));
    assert_eq!(line.get("msg").and_then(Json::text), Some(why));
}

fn judge(frame: &str) {
    let json = Json::read(frame);
    let incoming = op::read(frame);
    let id = incoming.id.as_ref();
    let Some(json) = json else {
        // Only an answer to a call or a goal takes effect despite its fault: the call ends.
        let is_refused = incoming.op.is_err() && id.is_none();
        let ends_a_call = matches!(incoming.op, Ok(Op::BadAnswer { .. }));
        assert!(is_refused || ends_a_call, "{frame:?} is no JSON");
        return;
    };
    let echoed = id.and_then(|id| Json::read(id.get()));
    assert_eq!(echoed.as_ref(), json.get("id"), "{frame:?}");
    match incoming.op {
        Ok(op) => {
            let name = json.get("op").and_then(Json::text);
            assert!(name.is_some(), "{frame:?}");
            check(&op, &json, id);
        }
        Err(error) => {
            let why = error.to_string();
            assert!(
                why.len() < LONGEST_COMPLAINT && !why.contains(char::is_control),
                "{why:?}"
            );
            let line = match &error {
                OpError::Status(_) => messages::status(Level::Error, &why, id),
                OpError::Call { service, .. } => {
                    messages::failure(service, id, &why, ErrorForm::Object)
                }
                OpError::Goal { action, .. } => messages::action_result(action, id, &why, 0, false),
            };
            let line = check_line(&line);
            assert_eq!(line.get("id").is_some(), id.is_some(), "{frame:?}");
        }
    }
}

fn check(op: &Op, json: &Json, id: Option<&Payload>) {
    match op {
        Op::PublishLines(_) => unreachable!("one frame is never read as lines"),
        Op::Publish { topic, msg } => {
            check_name(json, "topic", topic);
            let line = check_line(&messages::publish_raw(topic, msg));
            check_passed_on(json.get("msg"), line.get("msg"));
            assert_eq!(line.get("topic").and_then(Json::text), Some(&**topic));
            // The runtime's own subscribers read the message, and must not fail for any text.
            if *topic == *Topic::JointTrajectory.name() {
                check_setpoint(msg.raw());
            }
        }
        Op::CallService(call) => {
            check_name(json, "service", &call.service);
            let timeout = json.get("timeout").and_then(Json::number);
            // 0 or less means no timeout, which is the longest one.
            let timeout = timeout.map(|timeout| {
                if timeout > 0.0 {
                    duration(timeout, MAX_TIMEOUT)
                } else {
                    MAX_TIMEOUT
                }
            });
            assert_eq!(call.timeout, timeout);
            let line = check_line(&messages::call(&call.service, "1", &call.args));
            let none = matches!(json.get("args"), None | Some(Json::Null));
            if !none {
                check_passed_on(json.get("args"), line.get("args"));
            }
        }
        Op::Subscribe(one) => {
            check_name(json, "topic", &one.topic);
            let number = |name: &str| json.get(name).and_then(Json::number);
            let milliseconds = number("throttle_rate").unwrap_or_default();
            assert_eq!(one.throttle, duration(milliseconds / 1000.0, MAX_THROTTLE));
            // A number beyond every count has the effect of the largest.
            let length = number("queue_length").unwrap_or_default();
            let longest = MAX_QUEUE_LENGTH as f64;
            assert_eq!(one.queue_length as f64, length.min(longest));
            assert_ne!(one.encoding.fragment_size, Some(0));
            if let Some(size) = one.encoding.fragment_size {
                let asked = number("fragment_size").unwrap_or_default();
                assert!(size.is_power_of_two());
                assert!(size as f64 <= asked && asked < 2.0 * size as f64);
            }
        }
        Op::Advertise { topic, .. } | Op::Unadvertise { topic } | Op::Unsubscribe { topic } => {
            check_name(json, "topic", topic)
        }
        Op::SendActionGoal(goal) => check_name(json, "action", &goal.action),
        Op::CancelActionGoal { action } => check_name(json, "action", action),
        Op::Serve { kind, name, op } => {
            check_name(json, kind.noun(), name);
            match op {
                ProviderOp::Advertise { .. } | ProviderOp::Unadvertise => {}
                ProviderOp::Respond {
                    values,
                    result,
                    status,
                } => {
                    let status = status.as_deref().unwrap_or_default();
                    let line = check_line(&messages::response(name, id, values, *result, status));
                    // Absent and null mean an empty object.
                    let empty = Json::Object(Vec::new());
                    let given = json.get("values").filter(|given| **given != Json::Null);
                    check_passed_on(given.or(Some(&empty)), line.get("values"));
                    check_passed_on(json.get("id"), line.get("id"));
                }
                ProviderOp::Feedback { values } => {
                    let line = check_line(&messages::action_feedback(name, id, values));
                    check_passed_on(json.get("values"), line.get("values"));
                }
                ProviderOp::End {
                    values,
                    status,
                    result,
                } => {
                    assert!(*status <= 6, "a status of a goal");
                    let line = messages::action_result(name, id, values, *status, *result);
                    check_line(&line);
                }
            }
        }
        Op::BadAnswer { problem, .. } => {
            let why = problem.to_string();
            assert!(why.len() < LONGEST_COMPLAINT && !why.contains(char::is_control));
        }
        Op::Fragment(_) | Op::SetLevel { .. } | Op::Auth { .. } => {}
    }
}

fn check_setpoint(msg: &RawValue) {
    match read_setpoint::<2>(&Payload::from(msg)) {
        Ok(setpoint) => {
            let mut numbers = setpoint.position.iter().chain(&setpoint.velocity);
            assert!(numbers.all(|number| number.is_finite()));
        }
        Err(error) => assert!(error.to_string().len() < LONGEST_COMPLAINT),
    }
}

fn check_name(json: &Json, member: &str, name: &str) {
    assert!((1..=MAX_NAME).contains(&name.len()));
    assert_eq!(json.get(member).and_then(Json::text), Some(name));
}

/// This many seconds, at most `longest`.
fn duration(seconds: f64, longest: Duration) -> Duration {
    Duration::try_from_secs_f64(seconds).map_or(longest, |duration| duration.min(longest))
}

fn check_line(line: &[u8]) -> Json {
    let text = std::str::from_utf8(line).expect("UTF-8");
    let text = text.strip_suffix('\n').expect("a newline at its end");
    assert!(!text.contains('\n'), "{text:?}");
    let json = Json::read(text).expect("JSON");
    assert!(!json.overflows(), "{text:?}");
    json
}

/// Equal, except for numbers that overflow, which are now `null`.
fn check_passed_on(before: Option<&Json>, after: Option<&Json>) {
    let is_same = match (before, after) {
        (Some(before), Some(after)) => before.becomes(after, |before, after| before == after),
        (before, after) => before == after,
    };
    assert!(is_same, "{before:?} became {after:?}");
}
