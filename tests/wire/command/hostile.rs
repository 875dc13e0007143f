//! The commands against a hostile server: they end in time, with a message, and hold little of its data.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::Going;
use crate::common;

/// A server that answers requests for types, topics and parameters, and does `then` at the first other frame after the
/// opening of a command.
fn server(then: impl Fn(&mut TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        for line in BufReader::new(stream.try_clone().unwrap()).lines() {
            let Ok(line) = line else { return };
            let said: Value = serde_json::from_str(&line).unwrap();
            if said["op"] == "auth" {
                continue;
            }
            let service = said["service"].as_str().unwrap_or_default();
            if !service.starts_with("/rosapi/") {
                return then(&mut stream);
            }
            let value = json!("one\u{1b}[2J\nother").to_string();
            let values = json!({"type": "std_msgs/msg/String", "topics": ["/t"], "successful": true,
                "reason": "", "value": value});
            let answer = json!({"op": "service_response", "id": said["id"], "values": values, "result": true});
            stream.write_all(format!("{answer}\n").as_bytes()).unwrap();
        }
    });
    address
}

/// A command that contacts that server.
fn start(arguments: &[&str], address: &str) -> Going {
    start_by(common::program(), arguments, address)
}

fn start_by(mut program: Command, arguments: &[&str], address: &str) -> Going {
    Going::of(program.args(arguments).args(["--connect", address]))
}

/// Repeats the same bytes until the client stops reading.
fn drip(bytes: &'static [u8]) -> impl Fn(&mut TcpStream) + Send {
    move |stream| {
        while stream.write_all(bytes).is_ok() {
            thread::sleep(Duration::from_millis(20));
        }
    }
}

const ECHO: [&str; 3] = ["topic", "echo", "/t"];
const CALL: [&str; 3] = ["service", "call", "/t"];
const GOAL: [&str; 3] = ["action", "send_goal", "/t"];
const FOREIGN: &[u8] = b"{\"op\":\"publish\",\"topic\":\"/other\",\"msg\":{}}\n";

#[test]
fn an_unexpected_frame_extends_no_timeout() {
    for command in [ECHO, CALL, GOAL] {
        for bytes in [FOREIGN, b" "] {
            let arguments = [&command[..], &["--timeout", "0.3"]].concat();
            let (status, out, complaint) = start(&arguments, &server(drip(bytes))).end();
            assert_eq!((status, out.as_str()), (Some(3), ""), "{command:?}");
            let expected = "pendularm: no answer or message within 0.3 s\n";
            assert_eq!(complaint, expected, "{command:?}");
        }
    }
}

#[test]
fn a_server_that_closes_or_gives_no_answer_ends_a_command_with_status_3() {
    for (says, closes, timeout, why) in [
        (&b""[..], true, "60", "closed"),
        (
            b"HTTP/1.1 400 Bad Request\r\n",
            false,
            "60",
            "cannot read a frame",
        ),
        (b"{\"op\":", true, "60", "within a frame"),
        (b"[1, 2]\n", false, "60", "cannot read a frame"),
        (
            b"{\"op\":\"service_response\",\"id\":7}\n",
            false,
            "0.2",
            "within 0.2 s",
        ),
    ] {
        let address = server(move |stream| {
            stream.write_all(says).unwrap();
            if !closes {
                hold(stream);
            }
        });
        let arguments = [&CALL[..], &["--timeout", timeout]].concat();
        let (status, out, complaint) = start(&arguments, &address).end();
        assert_eq!((status, out.as_str()), (Some(3), ""), "{why}");
        assert!(complaint.contains(why), "{complaint}");
    }
}

#[test]
fn a_command_says_within_5_s_what_answers_instead_of_a_rosbridge_server() {
    let found: [(&[u8], &str); 9] = [
        (
            b"HTTP/1.1 400 Bad Request\r\nConnection: close\r\n",
            "HTTP/1.1 400",
        ),
        (b"SSH-2.0-OpenSSH_9.2\r\n", "SSH-2.0"),
        (b"SSH-2.0-", "SSH-2.0"),
        (b"\x15\x03\x01\x00\x02\x02\x0a", "TLS"),
        (b"\x16\x03\x03\x00\x7a\x02", "TLS"),
        (b"220 mail ESMTP\r\n", "220 mail"),
        (b"-ERR unknown command\r\n", "-ERR"),
        (b"\r\n[1, 2]\n", "answers \"\""),
        (b"", "silent for 5 s"),
    ];
    let commands = found.map(|(says, expected)| {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        thread::spawn(move || {
            let (mut stream, _) = listener.accept().unwrap();
            stream.write_all(says).unwrap();
            hold(&mut stream);
        });
        (
            Instant::now(),
            start(&["topic", "list"], &address),
            expected,
        )
    });
    for (began, command, expected) in commands {
        let (status, out, complaint) = command.end();
        assert_eq!((status, out.as_str()), (Some(3), ""), "{expected}");
        assert!(
            complaint.contains("this is no rosbridge server"),
            "{complaint}"
        );
        assert!(complaint.contains(expected), "{complaint}");
        assert!(began.elapsed() < Duration::from_secs(9), "{expected}");
    }
}

/// The messages take half as long again together as each may; each takes so little of that that a machine may be busy.
#[test]
fn each_message_has_the_whole_time_to_come() {
    let address = server(|stream| {
        for _ in 0..5 {
            thread::sleep(Duration::from_millis(1500));
            let message = b"{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":1}\n";
            stream.write_all(message).unwrap();
        }
    });
    let arguments = [&ECHO[..], &["--timeout", "5", "-n", "5"]].concat();
    let (status, out, complaint) = start(&arguments, &address).end();
    assert_eq!((status, complaint.as_str()), (Some(0), ""));
    assert_eq!(out, "1\n---\n".repeat(5));
}

#[test]
fn the_text_of_a_parameter_acts_on_no_terminal() {
    let command = ["param", "get", "/arm_sim", "robot_description"];
    let (status, out, _) = start(&command, &server(|_| {})).end();
    assert_eq!((status, out.as_str()), (Some(0), "one\\u{1b}[2J\nother\n"));
}

/// Keeps the connection until the command closes it.
fn hold(stream: &mut TcpStream) {
    let _ = io::copy(stream, &mut io::sink());
}

/// Publishes this message on the topic, once.
fn say(msg: String) -> impl Fn(&mut TcpStream) + Send {
    move |stream| {
        // A client at its limit does not read the rest.
        let _ = writeln!(
            stream,
            "{{\"op\":\"publish\",\"topic\":\"/t\",\"msg\":{msg}}}"
        );
        hold(stream);
    }
}

/// A command that may use this many kilobytes of memory.
#[cfg(target_os = "linux")]
fn start_within(kilobytes: u32, arguments: &[&str], address: &str) -> Going {
    let limited = common::shell(&format!("ulimit -v {kilobytes}"));
    start_by(limited, arguments, address)
}

/// As a tree the values of 4 MB would take 260 MB.
#[cfg(target_os = "linux")]
#[test]
fn values_that_say_nothing_to_a_command_are_not_spread_out() {
    for member in ["id", "status"] {
        let address = server(move |stream| {
            let value = "[[[1]]],".repeat(500_000);
            let foreign = format!("{{\"op\":\"service_response\",\"{member}\":[{value}1]}}\n");
            // The command has asked for the type before.
            let answer = "{\"op\":\"service_response\",\"id\":2,\"values\":{},\"result\":true}\n";
            let _ = stream.write_all((foreign + answer).as_bytes());
            hold(stream);
        });
        let (status, out, complaint) = start_within(200_000, &CALL, &address).end();
        assert_eq!((status, complaint.as_str()), (Some(0), ""), "{member}");
        assert_eq!(out, "{}\n", "{member}");
    }
}

/// Any client may send such a message: of 2 MB, in YAML of 250 MB.
#[cfg(target_os = "linux")]
#[test]
fn yaml_is_printed_before_all_of_it_is_written() {
    let (depth, count) = (120, 1_000_000);
    let msg = "[".repeat(depth) + &"1,".repeat(count) + "1" + &"]".repeat(depth);
    let address = server(say(msg));
    let arguments = [&ECHO[..], &["--once"]].concat();
    let mut child = start_within(200_000, &arguments, &address);
    let lines = child.1.by_ref().lines();
    let last = lines.map(Result::unwrap).enumerate().last();
    assert_eq!(last, Some((count + 1, "---".to_owned())));
    assert_eq!(child.end().0, Some(0));
}

#[test]
fn a_frame_that_no_runtime_sends_is_read_no_further() {
    for command in [ECHO, CALL] {
        let address = server(move |stream| {
            let chunk = [b' '; 1 << 16];
            while stream.write_all(&chunk).is_ok() {}
        });
        let (status, out, complaint) = start(&command, &address).end();
        assert_eq!((status, out.as_str()), (Some(3), ""));
        let expected = "pendularm: the connection ended: a frame is longer than 83886080 bytes\n";
        assert_eq!(complaint, expected);
    }
}
