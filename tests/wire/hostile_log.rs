//! Log injection at the level `trace`. For every text of a client, each line of standard error is one record of the
//! runtime, without control characters. No text becomes a file's name or a format.
//!
//! **Invariant:** the program logs into a pipe that is read to its end, so no line is missed.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Command, Stdio};
use std::thread;

use crate::common::{Client, Logged, end, program, signal};
use crate::folder::Folder;
use pendularm::logging::{LINE_BYTES, QUEUE_LINES};
use serde_json::{Value, json};

/// Texts that are harmful if they are written unescaped, or read as anything but text.
const HOSTILE: [&str; 14] = [
    "a\n2026-01-01T00:00:00Z ERROR forged: b",
    "a\r\n2026-01-01T00:00:00Z ERROR forged: b",
    "a\rforged",
    "\u{1b}[2J\u{1b}]0;forged\u{7}",
    "\u{9b}31m\u{85}forged",
    "\u{202e}degrof\u{2066}\u{2069}",
    "\u{2028}forged\u{2029}\u{feff}",
    "\u{0}forged",
    "\u{8}\u{8}\u{8}\u{7f}",
    "%s%n%x%99999999d {} {0} {:?} {{ }} ${forged} $(forged) `forged`",
    "../../../../forged.txt",
    "/dev/stderr",
    "<img src=x onerror=forged()>",
    "\\u001b[2J\\n\\x1b\\",
];

/// The program, logging everything in this format, and its folder.
fn talkative(name: &str, format: &str) -> (Logged, Folder) {
    let folder = Folder::new(name);
    let mut command = program();
    command.current_dir(&*folder).args(["--log-format", format]);
    (Logged::at("trace", command, Stdio::null()), folder)
}

/// Ends the program normally, and returns its log.
fn end_of(runtime: Logged) -> String {
    runtime.end().join("\n") + "\n"
}

/// Whether a terminal interprets a character.
fn acts(one: char) -> bool {
    one.is_control()
        || matches!(one, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}')
}

const LEVELS: [&str; 5] = ["ERROR", "WARN", "INFO", "DEBUG", "TRACE"];

/// Each line is a record of printable characters: a time, a level, a module of the runtime and a message, as text or as
/// one JSON object.
fn assert_records(format: &str, log: &str) {
    assert!(log.ends_with('\n') && log.lines().count() > 3, "{log:?}");
    for line in log.split_terminator('\n') {
        let [time, level, target, message] = match format {
            "text" => {
                let mut words = line.split_whitespace();
                [(); 4].map(|()| words.next().unwrap_or_default().to_owned())
            }
            _ => {
                let object: Value =
                    serde_json::from_str(line).unwrap_or_else(|why| panic!("{why}: {line:?}"));
                let text = |name: &str| object[name].as_str().unwrap_or_default().to_owned();
                ["timestamp", "level", "target", "message"].map(text)
            }
        };
        let is_time = time.len() > 20 && time.ends_with('Z') && !time.starts_with("2026-01-01T00");
        assert!(is_time && LEVELS.contains(&&*level), "{line:?}");
        let is_target = format != "text" || target.ends_with(':');
        assert!(target.starts_with("pendularm") && is_target, "{line:?}");
        assert!(!message.is_empty() && !line.contains(acts), "{line:?}");
        assert!(line.len() <= LINE_BYTES, "{} bytes: {line:?}", line.len());
    }
}

/// Every op, with the text in every member that takes one, as a member's name, and as a value of another type.
fn ops(text: &str) -> Vec<Value> {
    let services = [
        "/arm_sim/set_params",
        "/arm_sim/set_integrator",
        "/arm_sim/integration_step",
        "/ik/solve",
        "/ik_action/send_goal",
        "/ik_action/cancel_goal",
        "/ik_trial/start",
        "/study/stability",
        "/study/rollout",
        "/rosapi/topic_type",
        "/rosapi/message_details",
        "/rosapi/node_details",
        "/rosapi/get_param",
        "/rosapi/set_param",
        "/rosapi/delete_param",
        text,
    ];
    let args = json!({"name": text, "value": text, "method": text, "function": text, "topic": text, "type": text,
        "node": text, "goal_id": text, "gravity": text, "x": text, "integrator": text, "x0": 0, "dt": 1, "steps": 1, text: text});
    let mut ops: Vec<Value> = services
        .iter()
        .map(|service| json!({"op": "call_service", "service": service, "args": args, "id": text}))
        .collect();
    for op in [
        "advertise",
        "subscribe",
        "publish",
        "unsubscribe",
        "unadvertise",
        "advertise_service",
        "unadvertise_service",
        "service_response",
        "set_level",
        "auth",
        "fragment",
        "send_action_goal",
        "cancel_action_goal",
        text,
    ] {
        ops.push(json!({"op": op, "topic": text, "service": text, "type": text, "id": text, "msg": {text: text},
            "values": {text: text}, "result": true, "status": text, "level": text, "token": text, "action": text,
            "action_type": text, "data": text, "num": 0, "total": 1, "compression": "none", text: text}));
        ops.push(json!({"op": op, "topic": [text], "service": {text: 1}, "id": {text: [text]}, "level": [text]}));
    }
    ops.push(json!({"op": "publish", "topic": "/joint_trajectory", "id": text, "msg": {"joint_names": [text, text],
        "points": [{"positions": [text]}], "header": {"frame_id": text}}}));
    ops
}

/// The runtime's own messages carry clients' texts too.
#[test]
fn no_text_over_tcp_writes_a_line_of_the_log_or_a_file_and_each_comes_back_as_it_was() {
    for format in ["text", "json"] {
        let (runtime, folder) = talkative(&format!("hostile_log_{format}"), format);
        let mut listener = Client::to(runtime.address);
        for topic in ["/rosout", "/diagnostics"] {
            listener.subscribe(topic);
        }
        for text in HOSTILE {
            let mut client = Client::to(runtime.address);
            for op in ops(text) {
                client.send(&op);
            }
            client.send(&json!({"op": "set_level", "level": "info"}));
            client.send(&json!({"op": "subscribe", "topic": text, "id": text}));
            client.send(&json!({"op": "advertise", "topic": text}));
            client.send(&json!({"op": "publish", "topic": text, "msg": {"last": text}}));
            let last = client.receive_where("message", |frame| frame["msg"]["last"] == text);
            assert_eq!(last["topic"], text);
            for frame in &client.kept {
                let id = &frame["id"];
                assert!(
                    id.is_null() || id == text || id == &json!({text: [text]}),
                    "{frame}"
                );
            }
            // Text that is no JSON, on its own line and as the first one.
            client.send_bytes(format!("{text}\n").as_bytes());
            client.settle();
            Client::to(runtime.address).send_bytes(format!("{text} {text}\n\n").as_bytes());
        }
        let mut client = Client::to(runtime.address);
        client.send(&json!({"op": "\u{202e}".repeat(LINE_BYTES)}));
        client.settle();
        // `message` fails on a frame that is not JSON on one line.
        let status = listener.message("/diagnostics");
        for frame in listener.kept.iter().chain([&status]) {
            assert!(!frame.to_string().contains("forged"), "{frame}");
        }
        let entries: Vec<_> = fs::read_dir(&*folder).unwrap().collect();
        assert!(entries.is_empty(), "{entries:?}");
        let log = end_of(runtime);
        assert_records(format, &log);
        let names = log.contains("\"level\":\"DEBUG\"") && log.contains("\"connection\":");
        assert_eq!(names, format == "json");
    }
}

/// The pipe holds 64 KiB, and the queue its lines. Each new client makes a line.
#[test]
fn an_unread_log_blocks_no_client_and_lost_lines_are_counted() {
    const CLIENTS: usize = 2 * QUEUE_LINES + 64 * 1024 / 50;
    for format in ["text", "json"] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_pendularm"))
            .args([
                "--bind",
                "127.0.0.1:0",
                "--log",
                "debug",
                "--clients",
                "4096",
            ])
            .args(["--log-format", format])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        stdout.read_line(&mut line).unwrap();
        let address: SocketAddr = line.split(' ').next_back().unwrap().trim().parse().unwrap();
        for _ in 0..CLIENTS {
            std::net::TcpStream::connect(address).unwrap();
        }
        Client::to(address).settle();
        let log = thread::spawn({
            let stderr = child.stderr.take().unwrap();
            move || std::io::read_to_string(stderr).unwrap()
        });
        // The thread of the log continues, and has time for its last lines.
        thread::sleep(std::time::Duration::from_secs(1));
        signal(child.id(), "TERM");
        assert!(end(&mut child).0.success());
        let log = log.join().unwrap();
        assert_records(format, &log);
        let lost = log.lines().filter_map(|line| {
            let (before, _) = line.split_once(" log lines were dropped")?;
            let count = before.rsplit(|one: char| !one.is_ascii_digit()).next()?;
            count.parse::<usize>().ok()
        });
        let (lost, came) = (lost.sum::<usize>(), log.matches("client connected").count());
        assert!(lost > 0 && came >= QUEUE_LINES, "{lost} lost, {came} came");
        assert!(lost + came > CLIENTS, "{lost} lost, {came} came");
    }
}

/// The runtime quotes the request there. The test checks that the quoted text arrives.
#[cfg(feature = "web")]
#[test]
fn no_head_of_a_request_and_no_close_of_a_websocket_writes_a_line_of_the_log() {
    use crate::web_client::{exchange, handshake};

    let (mut runtime, _) = talkative("hostile_log_web", "text");
    let address = runtime.address;
    for text in HOSTILE {
        for head in [
            format!("GET / HTTP/1.1\r\nHost: {text}\r\n\r\n"),
            format!("GET /{text} HTTP/1.1\r\nHost: {address}\r\n\r\n"),
            format!(
                "GET /report/{text}.txt?token={text} HTTP/1.1\r\nHost: {address}\r\nCookie: {text}={text}\r\n\r\n"
            ),
            format!(
                "GET / HTTP/1.1\r\n{}Origin: {text}\r\n\r\n",
                handshake(address)
            ),
            format!("GET / HTTP/1.1\r\n{text}: {text}\r\n\r\n"),
            format!("GET / {text}\r\n\r\n"),
            format!("{text} / HTTP/1.1\r\nHost: {text}\r\n\r\n"),
        ] {
            // A text with a line end may leave the request unfinished.
            let answer = exchange(address, (head + "\r\n\r\n").as_bytes());
            assert!(!answer.is_empty());
        }
        let mut socket = Client::web(address);
        socket.send(&json!({"op": text, "id": text}));
        socket.close(1000, text);
        assert!(socket.is_closed());
    }
    let repeated = "GET / HTTP/1.1\r\nHost: caf\u{e9}.\u{202e}example\r\n\r\n";
    exchange(address, repeated.as_bytes());
    // The end gives the log little time: lines that a busy machine has not written by then are
    // missing.
    runtime.await_line("caf\u{e9}.");
    let log = end_of(runtime);
    assert_records("text", &log);
    assert!(
        log.contains("request refused") && log.contains("caf\u{e9}."),
        "{log}"
    );
}
