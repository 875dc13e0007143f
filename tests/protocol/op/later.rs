//! The operations that came to rosbridge later: actions, pieces of long messages, and encodings; read and written.
//!
//! **Invariant:** a message about bad input is compared whole: it is what its sender has to go by.

use bytes::Bytes;
use pendularm::protocol::limits::MAX_NAME;
use pendularm::protocol::messages::trajectory::joint_trajectory;
use pendularm::protocol::messages::{
    action_feedback, action_result, message_text, publish, respelled,
};
use pendularm::protocol::op::{
    ActionGoal, Arguments, Compression, Encoding, MAX_ARGS, Op, OpError, read,
};
use pendularm::protocol::wire::fragments::Piece;
use pendularm::protocol::wire::payload::Payload;
use serde_json::json;
use serde_json::value::RawValue;

#[track_caller]
fn op(frame: &str) -> Op {
    match read(frame).op {
        Ok(op) => op,
        Err(error) => panic!("{frame}: {error}"),
    }
}

#[track_caller]
fn problem(frame: &str) -> String {
    match read(frame).op {
        Err(OpError::Status(problem) | OpError::Goal { problem, .. }) => problem.to_string(),
        other => panic!("{frame}: {other:?}"),
    }
}

#[track_caller]
fn goal(more: &str) -> ActionGoal {
    match op(&format!(
        r#"{{"op":"send_action_goal","action":"/ik_action"{more}}}"#
    )) {
        Op::SendActionGoal(goal) => goal,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_goal_has_an_action_and_perhaps_a_type_arguments_and_feedback() {
    let least = goal("");
    assert_eq!(least.action, "/ik_action");
    assert_eq!(least.type_name, None);
    assert_eq!(least.args.payload().get(), "{}");
    assert!(!least.feedback);
    let most = goal(r#","action_type":"a/b","args":[1],"feedback":true"#);
    assert_eq!(most.type_name.as_deref(), Some("a/b"));
    assert!(matches!(most.args, Arguments::Positional(raw) if raw.get() == "[1]"));
    assert!(most.feedback);
    assert!(!goal(r#","feedback":false"#).feedback);
}

#[test]
fn a_goal_whose_members_are_of_another_type_is_refused_by_their_names() {
    for (more, message) in [
        (
            r#""action":"""#,
            r#"send_action_goal: action must be a non-empty string, got """#,
        ),
        (r#""x":1"#, "send_action_goal: action is required"),
        (
            r#""action":"a","action_type":5"#,
            "send_action_goal: action_type must be a string, got 5",
        ),
        (
            r#""action":"a","feedback":1"#,
            "send_action_goal: feedback must be true or false, got 1",
        ),
    ] {
        let frame = format!(r#"{{"op":"send_action_goal",{more}}}"#);
        assert_eq!(problem(&frame), message);
    }
}

#[test]
fn a_cancellation_names_its_action() {
    let cancel = op(r#"{"op":"cancel_action_goal","action":"/ik_action"}"#);
    assert!(matches!(cancel, Op::CancelActionGoal { action } if action == "/ik_action"));
    assert_eq!(
        problem(r#"{"op":"cancel_action_goal"}"#),
        "cancel_action_goal: action is required"
    );
}

#[test]
fn a_fragment_is_a_piece_with_its_number_and_how_many_there_are() {
    let fragment = op(r#"{"op":"fragment","id":7,"data":"a\"b","num":1,"total":3}"#);
    let Op::Fragment(piece) = fragment else {
        panic!("{fragment:?}");
    };
    assert_eq!(
        piece,
        Piece {
            id: "7".to_owned(),
            data: "a\"b".to_owned(),
            num: 1,
            total: 3,
        }
    );
}

#[test]
fn a_fragment_without_a_member_or_with_a_bad_one_is_refused_by_its_name() {
    let long = "x".repeat(MAX_NAME);
    for (more, message) in [
        (
            r#""data":"x","num":0,"total":1"#.to_owned(),
            "fragment: id is required".to_owned(),
        ),
        (
            r#""id":1,"num":0,"total":1"#.to_owned(),
            "fragment: data is required".to_owned(),
        ),
        (
            r#""id":1,"data":5,"num":0,"total":1"#.to_owned(),
            "fragment: data must be a string, got 5".to_owned(),
        ),
        (
            r#""id":1,"data":"x","total":1"#.to_owned(),
            "fragment: num is required".to_owned(),
        ),
        (
            r#""id":1,"data":"x","num":-1,"total":1"#.to_owned(),
            "fragment: num must be an integer, at least 0, got -1".to_owned(),
        ),
        (
            r#""id":1,"data":"x","num":0,"total":1.5"#.to_owned(),
            "fragment: total must be an integer, at least 0, got 1.5".to_owned(),
        ),
        (
            // The quotes count: an id is any JSON value.
            format!(r#""id":"{long}","data":"x","num":0,"total":1"#),
            format!(
                "fragment: id must be at most {MAX_NAME} bytes long, got {}",
                MAX_NAME + 2
            ),
        ),
    ] {
        let frame = format!(r#"{{"op":"fragment",{more}}}"#);
        assert_eq!(problem(&frame), message);
    }
}

#[track_caller]
fn encoding(more: &str) -> Encoding {
    match op(&format!(r#"{{"op":"subscribe","topic":"/x"{more}}}"#)) {
        Op::Subscribe(subscribe) => subscribe.encoding,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_subscription_comes_as_json_in_one_piece_unless_it_says_otherwise() {
    assert_eq!(encoding(""), Encoding::default());
    for (name, compression) in [
        ("none", Compression::None),
        ("png", Compression::None),
        ("cbor", Compression::Cbor),
        ("cbor-raw", Compression::CborRaw),
    ] {
        let found = encoding(&format!(r#","compression":"{name}""#));
        assert_eq!(found.compression, compression, "{name}");
        assert_eq!(found.fragment_size, None);
    }
    assert_eq!(encoding(r#","fragment_size":1"#).fragment_size, Some(1));
    assert_eq!(encoding(r#","fragment_size":null"#).fragment_size, None);
    for binary in ["cbor", "cbor-raw"] {
        let found = encoding(&format!(r#","compression":"{binary}","fragment_size":100"#));
        assert_eq!(found.fragment_size, None, "{binary} is not cut up");
    }
}

#[test]
fn another_compression_and_pieces_of_no_bytes_are_refused() {
    for (more, message) in [
        (
            r#""compression":"zip""#,
            r#"subscribe: compression must be none, png, cbor or cbor-raw, got "zip""#,
        ),
        (
            r#""fragment_size":0"#,
            "subscribe: fragment_size must be an integer, at least 1, got 0",
        ),
        (
            r#""fragment_size":"5""#,
            r#"subscribe: fragment_size must be an integer, at least 1, got "5""#,
        ),
    ] {
        let frame = format!(r#"{{"op":"subscribe","topic":"/x",{more}}}"#);
        assert_eq!(problem(&frame), message);
    }
}

#[test]
fn of_two_encodings_the_denser_and_the_smaller_pieces_count() {
    let one = |compression, fragment_size| Encoding {
        compression,
        fragment_size,
        ros1_stamps: false,
    };
    for (first, second, both) in [
        (
            one(Compression::None, Some(12)),
            one(Compression::None, Some(9)),
            one(Compression::None, Some(9)),
        ),
        (
            one(Compression::None, None),
            one(Compression::None, Some(9)),
            one(Compression::None, Some(9)),
        ),
        (
            one(Compression::CborRaw, None),
            one(Compression::Cbor, None),
            one(Compression::CborRaw, None),
        ),
        // Binary frames are not cut up: those who ask for them share them, whatever size they give besides.
        (
            one(Compression::None, Some(9)),
            one(Compression::Cbor, Some(5)),
            one(Compression::Cbor, None),
        ),
    ] {
        assert_eq!(first.merged(second), both);
        assert_eq!(second.merged(first), both);
    }
}

fn raw(text: &str) -> Payload {
    RawValue::from_string(text.to_owned())
        .expect("valid JSON")
        .into()
}

#[test]
fn progress_and_end_of_a_goal_carry_the_senders_id() {
    let id = raw("[1]");
    assert_eq!(
        action_feedback("/ik_action", Some(&id), &json!({"a": 1})),
        Bytes::from(
            "{\"op\":\"action_feedback\",\"action\":\"/ik_action\",\"id\":[1],\"values\":{\"a\":1}}\n"
        )
    );
    assert_eq!(
        action_result("/ik_action", None, &json!("why"), 6, false),
        Bytes::from(
            "{\"op\":\"action_result\",\"action\":\"/ik_action\",\"values\":\"why\",\"status\":6,\"result\":false}\n"
        )
    );
}

/// A topic is known with and without its slash, and each subscriber reads its own spelling.
#[test]
fn a_message_can_be_told_under_another_spelling_of_its_topic() {
    let frame = publish("/a\"b", &json!({"x": [1, null]}));
    assert_eq!(message_text("/a\"b", &frame), br#"{"x":[1,null]}"#);
    let other = publish("a\"b", &json!({"x": [1, null]}));
    assert_eq!(respelled("/a\"b", "a\"b", &frame), other);
    let same = respelled("/a\"b", "/a\"b", &frame);
    assert_eq!(same.as_ptr(), frame.as_ptr(), "the bytes are shared");
}

/// It is kept while the goal is pursued, and comes back with every feedback.
#[test]
fn the_id_of_a_goal_is_bounded() {
    let frame = |length: usize| {
        let id = "x".repeat(length - 2);
        format!(r#"{{"op":"send_action_goal","action":"/ik_action","feedback":true,"id":"{id}"}}"#)
    };
    assert!(read(&frame(MAX_NAME)).op.is_ok());
    assert_eq!(
        problem(&frame(MAX_NAME + 1)),
        "send_action_goal: id must be at most 1024 bytes long, got 1025"
    );
}

/// A node's own thread reads them; a worker or another client takes longer ones.
#[test]
fn long_arguments_are_for_workers_and_other_clients() {
    let pad = "1,".repeat(MAX_ARGS / 2);
    let args = |service: &str, args: &str| {
        let frame = format!(r#"{{"op":"call_service","service":"{service}","args":{args}}}"#);
        match read(&frame).op {
            Ok(Op::CallService(call)) => Ok(call.args.payload().get().to_owned()),
            Err(error) => Err(error.to_string()),
            other => panic!("{other:?}"),
        }
    };
    let long = format!(r#"{{"masses":[1,2],"pad":[{pad}1],"masses":[3,4]}}"#);
    assert_eq!(
        args("/arm_sim/set_params", &long).unwrap(),
        r#"{"masses":[3,4]}"#
    );
    for service in ["/arm_sim/integration_step", "/somebody_elses"] {
        assert_eq!(args(service, &long).unwrap(), long);
    }
    for refused in [format!("[{pad}1]"), format!(r#"{{"masses":[{pad}1]}}"#)] {
        let why = args("/arm_sim/set_params", &refused).unwrap_err();
        assert!(
            why.starts_with("call_service: args must be at most 16384 bytes long"),
            "{why}"
        );
    }
    let goal = format!(r#"{{"op":"send_action_goal","action":"/ik_action","args":[{pad}1]}}"#);
    assert!(problem(&goal).starts_with("send_action_goal: args must be at most"));
}

/// Only the last point counts, and only that goes to the arm; where it stands is not lost.
#[test]
fn of_a_long_trajectory_the_arm_hears_the_last_point() {
    let publish = |points: &str| {
        let msg = format!(r#"{{"joint_names":["joint2","joint1"],"points":[{points}]}}"#);
        read(&format!(
            r#"{{"op":"publish","topic":"joint_trajectory","msg":{msg}}}"#
        ))
        .op
    };
    let points = r#"{"positions":[3,4]},"#.repeat(500);
    for last in ["[1,2]", "[1,null]", "[1]", "5"] {
        let all = format!(r#"{points}{{"positions":{last}}}"#);
        let Ok(Op::Publish {
            msg,
            heard: Some(heard),
            ..
        }) = publish(&all)
        else {
            panic!("{last}");
        };
        assert!(heard.get().len() < 1200 && msg.get().len() > 10_000);
        let setpoint = |msg: &Payload| joint_trajectory(msg.raw(), &["joint1", "joint2"]);
        assert_eq!(setpoint(&heard), setpoint(&msg), "{last}");
    }
    let why = publish(&format!("{}1", "0,".repeat(MAX_ARGS)))
        .unwrap_err()
        .to_string();
    assert!(
        why.starts_with("publish: msg must be at most 16384 bytes"),
        "{why}"
    );
}
