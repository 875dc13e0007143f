//! WebSocket on the port: the same rosbridge as over TCP, message by message; who may open one; bytes that mean harm.
//!
//! **Invariant:** nothing comes over a WebSocket that was not asked for.

#![cfg(feature = "web")]
use std::io::{Read, Write};
use std::net::TcpStream;

use crate::common::{PATIENCE, Runtime};
use crate::web_client::{Answer, Socket, exchange, handshake, rest, try_handshake};
use pendularm_client::codec::Event;
use pendularm_client::websocket::{LAST, opcode};
use serde_json::{Value, json};

#[test]
fn a_call_is_answered_by_one_text_message() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let response = socket.call("/arm_sim/set_params", json!({"gravity": 3}));
    assert_eq!(response["values"]["gravity"], 3.0);
    assert_eq!(response["result"], true);
}

/// Clients of `rosbridge_suite` show `values` of a call that failed, and nothing else.
#[test]
fn a_call_that_failed_says_why_in_values_unless_the_client_asks_for_the_object() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let halfway = json!({"gravity": -1, "masses": [2, 2]});
    let calls = [
        ("/arm_sim/set_params", halfway.clone(), "gravity"),
        ("/ik/solve", json!({"x": 9, "y": 9}), "reach"),
        ("/ik/solve", json!("none"), "args"),
        ("/arm_sim/integration_step", json!({}), "function"),
        ("/no/such_service", json!({}), "no provider"),
    ];
    for (service, args, named) in calls.clone() {
        let response = socket.call(service, args);
        let (values, status) = (&response["values"], &response["status"]);
        assert_eq!((values, &response["result"]), (status, &json!(false)));
        assert!(status.as_str().unwrap().contains(named), "{response}");
    }
    socket.send(&json!({"op": "call_service", "service": "/ik/solve", "id": 1, "timeout": "soon"}));
    let response = socket.receive();
    assert_eq!(response["values"], response["status"]);
    assert!(response["values"].is_string(), "{response}");

    socket.send(&json!({"op": "set_level", "level": "none", "errors": "object"}));
    for (service, args, named) in calls {
        let response = socket.call(service, args);
        assert!(response["values"].is_object(), "{response}");
        assert!(response["status"].as_str().unwrap().contains(named));
    }
    let response = socket.call("/arm_sim/set_params", halfway.clone());
    assert_eq!(response["values"]["masses"], json!([2.0, 2.0]));

    let mut client = runtime.connect();
    assert!(client.call("/arm_sim/set_params", halfway.clone())["values"].is_object());
    client.send(&json!({"op": "set_level", "level": "info", "errors": "text"}));
    assert!(client.call("/arm_sim/set_params", halfway)["values"].is_string());
}

/// A provider's answer is its own, also where it is a failure.
#[test]
fn values_of_another_client_pass_as_they_are() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.send(&json!({"op": "advertise_service", "service": "/mine"}));
    socket.send(&json!({"op": "call_service", "service": "/mine", "id": "a"}));
    let call = socket.receive();
    socket.send(
        &json!({"op": "service_response", "service": "/mine", "id": call["id"],
                        "values": {"a": 1}, "result": false}),
    );
    let response = socket.receive();
    assert_eq!(
        (&response["id"], &response["values"]),
        (&json!("a"), &json!({"a": 1}))
    );
}

#[test]
fn text_and_binary_messages_both_are_frames() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let frame = r#"{"op":"call_service","service":"/arm_sim/pause","id":"a"}"#;
    socket.send_frame(LAST | opcode::BINARY, frame.as_bytes());
    assert_eq!(socket.receive()["id"], "a");
    socket.send_text(frame);
    assert_eq!(socket.receive()["id"], "a");
}

#[test]
fn a_message_in_fragments_is_one_frame_also_with_a_ping_between_them() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let frame = br#"{"op":"call_service","service":"/arm_sim/pause","id":1}"#;
    socket.send_frame(opcode::TEXT, &frame[..10]);
    socket.send_frame(LAST | opcode::PING, b"hello");
    socket.send_frame(opcode::CONTINUATION, &frame[10..11]);
    socket.send_frame(LAST | opcode::CONTINUATION, &frame[11..]);
    assert_eq!(socket.event(), Event::Pong(b"hello".to_vec()));
    assert_eq!(socket.receive()["id"], 1);
}

#[test]
fn topics_go_both_ways_between_tcp_and_websocket() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let mut client = runtime.connect();
    socket.send(&json!({"op": "subscribe", "topic": "/chat"}));
    socket.send(&json!({"op": "advertise", "topic": "/reply"}));
    socket.settle();
    client.subscribe("/reply");
    client.send(&json!({"op": "advertise", "topic": "/chat"}));
    client.send(&json!({"op": "publish", "topic": "/chat", "msg": {"data": "hello"}}));
    let expected = json!({"op": "publish", "topic": "/chat", "msg": {"data": "hello"}});
    assert_eq!(socket.receive(), expected);
    socket.send(&json!({"op": "publish", "topic": "/reply", "msg": {"data": [1, 2]}}));
    assert_eq!(client.message("/reply"), json!({"data": [1, 2]}));
}

/// Line ends within a message are white space; a frame over TCP must stay on its line.
#[test]
fn a_pretty_printed_message_is_one_frame_and_passes_on_as_one_line() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let mut client = runtime.connect();
    client.subscribe("/chat");
    socket.send(&json!({"op": "advertise", "topic": "/chat"}));
    let msg = json!({"text": "one \"two\"", "list": [1, {"deep": "{\n}"}]});
    let frame = json!({"op": "publish", "topic": "/chat", "msg": msg});
    let pretty = serde_json::to_string_pretty(&frame).unwrap();
    assert!(pretty.lines().count() > 5);
    socket.send_text(&pretty);
    assert_eq!(client.message("/chat"), msg);
}

#[test]
fn a_line_end_within_a_string_is_malformed_and_nothing_inside_is_executed() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.send(&json!({"op": "set_level", "level": "error"}));
    let inner =
        "{\"op\":\"call_service\",\"service\":\"/arm_sim/set_params\",\"args\":{\"gravity\":1}}";
    socket.send_text(&format!("{{\"op\":\"x\",\"a\":\"\n{inner}\n\"}}"));
    socket.send_text(&format!("not an object\n{inner}\n"));
    socket.send_text(&format!("[\n{inner}\n]"));
    for _ in 0..3 {
        let status = socket.receive();
        assert_eq!(
            (&status["op"], &status["level"]),
            (&json!("status"), &json!("error"))
        );
    }
    let response = socket.call("/arm_sim/set_params", json!({}));
    assert_eq!(response["values"]["gravity"], 9.81);
}

#[test]
fn no_status_comes_before_the_client_has_asked_for_such() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.send(&json!({"op": "subscribe", "topic": "/chat", "id": 1}));
    socket.send(&json!({"op": "nonsense"}));
    socket.send(&json!({"op": "publish", "topic": "/joint_states", "msg": {}}));
    socket.send(&json!({"op": "publish", "topic": "/joint_trajectory", "msg": {}}));
    socket.send(&json!({"op": "set_level", "level": "loud"}));
    socket.send(&json!({"op": "subscribe", "topic": 7}));
    socket.send(&json!({"op": "advertise_service", "service": "/mine"}));
    socket.send_text("not JSON");
    socket.send_text("");
    socket.settle();
}

#[test]
fn statuses_come_from_the_level_on_that_the_client_has_set() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let subscribe = json!({"op": "subscribe", "topic": "/chat", "id": "s"});
    let bad = json!({"op": "publish", "topic": "/joint_trajectory", "msg": {}, "id": "b"});
    socket.send(&json!({"op": "set_level", "level": "info"}));
    socket.send(&subscribe);
    let status = socket.receive();
    let level = (&status["op"], &status["level"], &status["id"]);
    assert_eq!(level, (&json!("status"), &json!("info"), &json!("s")));
    for level in ["warning", "error"] {
        socket.send(&json!({"op": "set_level", "level": level}));
        socket.send(&subscribe);
        socket.send(&bad);
        let status = socket.receive();
        assert_eq!(
            (&status["level"], &status["id"]),
            (&json!("error"), &json!("b"))
        );
    }
    socket.send(&json!({"op": "set_level", "level": "none"}));
    socket.send(&subscribe);
    socket.send(&bad);
    socket.settle();
}

#[test]
fn over_tcp_statuses_come_until_the_client_sets_another_level() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.subscribe("/chat");
    client.send(&json!({"op": "set_level", "level": "error"}));
    client.send(&json!({"op": "subscribe", "topic": "/chat"}));
    client.send(&json!({"op": "nonsense", "id": 5}));
    assert_eq!(client.receive()["id"], 5);
    client.send(&json!({"op": "set_level", "level": "none"}));
    client.send(&json!({"op": "nonsense"}));
    client.send(&json!({"op": "set_level", "level": "nonsense"}));
    client.send_bytes(b"[]\n");
    client.settle();
    assert_eq!(client.kept, Vec::<Value>::new());
    client.send(&json!({"op": "set_level", "level": "warning"}));
    client.send(&json!({"op": "set_level", "level": 3, "id": 6}));
    let status = client.receive();
    assert_eq!(status["id"], 6);
    assert!(
        status["msg"]
            .as_str()
            .unwrap()
            .contains("info, warning, error or none")
    );
}

#[test]
fn a_client_may_provide_a_service_over_websocket() {
    let runtime = Runtime::start();
    let mut provider = Socket::open(runtime.address);
    provider.send(&json!({"op": "advertise_service", "service": "/double"}));
    provider.settle();
    let mut client = runtime.connect();
    client.send(&json!({"op": "call_service", "service": "/double", "args": {"n": 4}, "id": 9}));
    let call = provider.receive();
    assert_eq!(call["args"]["n"], 4);
    provider.send(&json!({
        "op": "service_response", "service": "/double", "id": call["id"], "values": {"n": 8}, "result": true
    }));
    let response = client.receive_where("an answer", |frame| frame["id"] == 9);
    assert_eq!(response["values"]["n"], 8);
}

#[test]
fn an_answer_of_many_megabytes_is_one_message() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let args = json!({"function": "sin(t)", "x0": 0.1, "dt": 0.001, "steps": 100_000, "integrator": "rk4"});
    let response = socket.call("/arm_sim/integration_step", args);
    assert_eq!(
        response["values"]["positions"].as_array().unwrap().len(),
        100_001
    );
    socket.settle();
}

#[test]
fn a_message_of_4_mib_is_taken_and_a_longer_one_closes_with_1009() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    let frame = |length: usize| {
        let shell = r#"{"op":"call_service","service":"/arm_sim/pause","id":1,"pad":""}"#;
        shell.replace("\"\"", &format!("\"{}\"", "x".repeat(length - shell.len())))
    };
    let limit = 4 * 1024 * 1024;
    socket.send_text(&frame(limit));
    assert_eq!(socket.receive()["id"], 1);
    socket.send_text(&frame(limit + 1));
    assert_eq!(socket.close_code(), Some(1009));
    let mut other = Socket::open(runtime.address);
    other.send_frame(opcode::TEXT, &vec![b' '; limit]);
    other.send_frame(LAST | opcode::CONTINUATION, b"  ");
    assert_eq!(other.close_code(), Some(1009));
}

#[test]
fn text_that_is_not_utf_8_closes_with_1007_and_binary_is_a_malformed_frame() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.send(&json!({"op": "set_level", "level": "error"}));
    socket.send_frame(LAST | opcode::BINARY, b"{\"op\":\"\xff\"}");
    assert_eq!(socket.receive()["level"], "error");
    socket.send_frame(LAST | opcode::TEXT, b"{\"op\":\"\xff\"}");
    assert_eq!(socket.close_code(), Some(1007));
}

/// Frames as no client of the protocol sends them: first byte (final, reserved bits, opcode), second (masked, length), rest.
#[test]
fn frames_against_the_protocol_close_with_1002() {
    let runtime = Runtime::start();
    for bytes in [
        &b"\x81\x02{}"[..],                         // not masked
        &b"\xc1\x82\0\0\0\0{}"[..],                 // a reserved bit
        &b"\x83\x82\0\0\0\0{}"[..],                 // a reserved opcode
        &b"\x80\x82\0\0\0\0{}"[..],                 // goes on with nothing
        &b"\x09\x80\0\0\0\0"[..],                   // a ping in fragments
        &b"\x89\xfe\x00\x7e\0\0\0\0"[..],           // a ping of 126 bytes
        &b"\x01\x81\0\0\0\0{\x81\x81\0\0\0\0}"[..], // a second message within a first
    ] {
        let mut socket = Socket::open(runtime.address);
        socket.send_bytes(bytes);
        if bytes.starts_with(b"\x89\xfe") {
            socket.send_bytes(&[0; 126]);
        }
        assert_eq!(socket.close_code(), Some(1002), "{bytes:x?}");
        assert!(socket.is_closed());
    }
    Socket::open(runtime.address).settle();
}

#[test]
fn a_close_is_answered_with_the_same_code_and_the_stream_ends() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.settle();
    socket.close(1000, "done");
    assert_eq!(socket.close_code(), Some(1000));
    assert!(socket.is_closed());
}

#[test]
fn what_a_client_registered_goes_with_it_also_without_a_close() {
    let runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.send(&json!({"op": "advertise_service", "service": "/mine"}));
    socket.settle();
    drop(socket);
    let mut client = runtime.connect();
    let deadline = std::time::Instant::now() + PATIENCE;
    loop {
        let args = json!({"op": "call_service", "service": "/mine", "timeout": 0.05});
        client.send(&args);
        let response = client.receive();
        if response["status"] == "no provider for service /mine" {
            break;
        }
        assert!(std::time::Instant::now() < deadline, "{response}");
    }
}

#[cfg(unix)]
#[test]
fn the_runtimes_end_closes_with_1001_and_in_time() {
    let mut runtime = Runtime::start();
    let mut socket = Socket::open(runtime.address);
    socket.settle();
    let pid = runtime.pid().to_string();
    let killed = std::process::Command::new("kill")
        .args(["-TERM", &pid])
        .status();
    assert!(killed.unwrap().success());
    assert_eq!(socket.close_code(), Some(1001));
    let status = runtime.end().0;
    assert_eq!(status.code(), Some(0));
}

#[test]
fn a_handshake_needs_no_origin_or_our_own_or_one_of_this_machine() {
    let runtime = Runtime::start();
    let (address, port) = (runtime.address, runtime.address.port());
    assert_eq!(try_handshake(address, "/", &handshake(address)).0, 101);
    for origin in [
        format!("http://{address}"),
        format!("HTTP://{address}"),
        format!("http://localhost:{port}"),
        "http://localhost:3000".to_owned(),
        "http://localhost".to_owned(),
        "http://127.0.0.1:8080".to_owned(),
        "http://[::1]:5173".to_owned(),
    ] {
        let headers = handshake(address) + &format!("Origin: {origin}\r\n");
        assert_eq!(try_handshake(address, "/", &headers).0, 101, "{origin}");
    }
}

#[test]
fn a_foreign_origin_is_a_403_that_names_the_option() {
    let runtime = Runtime::start();
    let address = runtime.address;
    for origin in [
        "https://evil.example",
        "http://evil.example",
        "http://localhost.evil.example",
        "http://127.0.0.1.evil.example:80",
        "https://localhost",
        "https://127.0.0.1:8080",
        "null",
        "file://",
        "",
        "http://",
        "http://localhost:99999",
        "http://user@localhost",
        "chrome-extension://abcdef",
        "localhost",
        "http://0.0.0.0:80",
        "http://localhost\r\nOrigin: http://localhost",
    ] {
        let headers = handshake(address) + &format!("Origin: {origin}\r\n");
        let (status, body) = try_handshake(address, "/", &headers);
        assert_eq!(status, 403, "{origin}");
        assert!(body.contains("--allow-origin"), "{body}");
    }
    let host = handshake(address).replace(&format!("Host: {address}"), "Host: evil.example");
    let (status, body) = try_handshake(address, "/", &host);
    assert_eq!(status, 403);
    assert!(body.contains("--allow-host"), "{body}");
}

#[test]
fn an_allowed_origin_may_open_a_websocket() {
    let runtime = Runtime::with(&["--allow-origin", "https://Class.example,null"]);
    let address = runtime.address;
    for (origin, status) in [
        ("https://class.example", 101),
        ("null", 101),
        ("http://class.example", 403),
        ("https://class.example:8443", 403),
        ("file://", 403),
    ] {
        let headers = handshake(address) + &format!("Origin: {origin}\r\n");
        assert_eq!(try_handshake(address, "/", &headers).0, status, "{origin}");
    }
}

/// A program has no origin, and could use the raw port as well: the switch is about pages.
#[test]
fn with_a_strict_origin_only_our_own_page_and_those_named_may() {
    let arguments = ["--strict-origin", "--allow-origin", "https://class.example"];
    let runtime = Runtime::with(&arguments);
    let (address, port) = (runtime.address, runtime.address.port());
    for (origin, status) in [
        (format!("http://{address}"), 101),
        ("https://class.example".to_owned(), 101),
        ("http://localhost:3000".to_owned(), 403),
        // Ours by another name than the one that was asked for.
        (format!("http://localhost:{port}"), 403),
    ] {
        let headers = handshake(address) + &format!("Origin: {origin}\r\n");
        assert_eq!(try_handshake(address, "/", &headers).0, status, "{origin}");
    }
    assert_eq!(try_handshake(address, "/", &handshake(address)).0, 101);
}

#[test]
fn a_handshake_that_is_not_as_it_has_to_be_is_refused() {
    let runtime = Runtime::start();
    let address = runtime.address;
    let good = handshake(address);
    for (from, to, status, word) in [
        ("Version: 13", "Version: 8", 426, "version 13"),
        ("Sec-WebSocket-Version: 13\r\n", "", 426, "version 13"),
        (
            "dGhlIHNhbXBsZSBub25jZQ==",
            "short",
            400,
            "Sec-WebSocket-Key",
        ),
        (
            "dGhlIHNhbXBsZSBub25jZQ==",
            "dGhlIHNhbXBsZSBub25jZQ!!",
            400,
            "Sec-WebSocket-Key",
        ),
        (
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n",
            "",
            400,
            "Sec-WebSocket-Key",
        ),
        (
            "Connection: Upgrade",
            "Connection: close",
            400,
            "Connection: Upgrade",
        ),
        (
            "Upgrade: websocket",
            "Upgrade: h2c",
            400,
            "Upgrade: websocket",
        ),
    ] {
        let (got, body) = try_handshake(address, "/", &good.replace(from, to));
        assert_eq!(got, status, "{to}");
        assert!(body.contains(word), "{body}");
    }
    assert_eq!(try_handshake(address, "/other", &good).0, 404);
    let old = format!("GET / HTTP/1.0\r\n{good}\r\n");
    assert_eq!(
        Answer::parse(&exchange(address, old.as_bytes())).status,
        400
    );
}

#[test]
fn the_handshake_is_answered_as_the_rfc_has_it_and_frames_may_follow_at_once() {
    let runtime = Runtime::start();
    let mut stream = TcpStream::connect(runtime.address).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let mut bytes = format!("GET / HTTP/1.1\r\n{}\r\n", handshake(runtime.address)).into_bytes();
    let frame = br#"{"op":"call_service","service":"/arm_sim/pause","id":1}"#;
    bytes.extend_from_slice(&[0x81, 0x80 | u8::try_from(frame.len()).unwrap(), 0, 0, 0, 0]);
    bytes.extend_from_slice(frame);
    stream.write_all(&bytes).unwrap();
    // The frame of the answer is short, so its end shows that it is there.
    let mut answered = Vec::new();
    while !answered.ends_with(b"\"status\":\"\"}") {
        let mut byte = [0];
        stream.read_exact(&mut byte).unwrap();
        answered.push(byte[0]);
    }
    // A close without a reason.
    stream.write_all(b"\x88\x80\0\0\0\0").unwrap();
    answered.extend(rest(&mut stream));
    let answer = Answer::parse(&answered);
    // The key of RFC 6455, section 1.3.
    assert_eq!(answer.status, 101);
    assert_eq!(
        answer.header("sec-websocket-accept"),
        Some("s3pPLMBiTxaQ9kYGzzhZRbK+xOo=")
    );
    assert_eq!(answer.header("sec-websocket-extensions"), None);
    let text = String::from_utf8_lossy(&answer.body);
    assert!(
        text.contains("\"id\":1,\"values\":{\"data\":false}"),
        "{text}"
    );
    assert!(answer.body.ends_with(b"\x88\x00"));
}
