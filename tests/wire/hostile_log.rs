//! Log injection at the level `trace`. For every text of a client, each line of standard error is one record of the
//! runtime, without control characters.
//!
//! **Invariant:** the program logs into a pipe that is read to its end, so no line is missed.

use std::net::SocketAddr;
use std::process::Stdio;
use std::thread;

use crate::command::Going;
use crate::common::{Client, Logged, end, program};
use pendularm::logging::{LINE_BYTES, QUEUE_LINES};
use serde_json::{Value, json};

/// Texts that are harmful if they are written unescaped, or read as anything but text.
const HOSTILE: [&str; 11] = [
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
    "\\u001b[2J\\n\\x1b\\",
];

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

/// The runtime quotes the head of a refused request there. The test checks that the quoted text arrives.
#[test]
fn no_text_of_a_client_writes_a_line_of_the_log() {
    for format in ["text", "json"] {
        let mut command = program();
        command.args(["--log-format", format]);
        let mut runtime = Logged::at("trace", command, Stdio::null());
        let address = runtime.address;
        for text in HOSTILE {
            let mut client = Client::to(address);
            for (op, member) in [
                (text, "id"),
                ("subscribe", "topic"),
                ("call_service", "service"),
            ] {
                client.send(&json!({"op": op, member: text}));
            }
            // Its refusal is logged with the name.
            let answer = json!({"op": "service_response", "service": text, "id": text, "values": {}, "result": true});
            client.send(&answer);
            client.send_bytes(format!("{text}\n").as_bytes());
            client.settle();
            #[cfg(feature = "web")]
            send_heads(address, text);
        }
        #[cfg(feature = "web")]
        {
            use crate::web_client::exchange;
            let long = "\u{202e}".repeat(LINE_BYTES);
            let quoted = format!("GET / HTTP/1.1\r\nHost: caf\u{e9}.{long}\r\n\r\n");
            exchange(address, quoted.as_bytes());
            // The end gives the log little time: lines that a busy machine has not written by then are missing.
            let line = runtime.await_line("caf\u{e9}.");
            assert!(line.contains("request refused"), "{line}");
        }
        let log = runtime.end().join("\n") + "\n";
        assert_records(format, &log);
        let names = log.contains("\"level\":\"DEBUG\"") && log.contains("\"connection\":");
        assert_eq!(names, format == "json");
    }
}

/// Requests with a text in each place, and a WebSocket that closes with it.
#[cfg(feature = "web")]
fn send_heads(address: SocketAddr, text: &str) {
    use crate::web_client::exchange;
    use pendularm_client::websocket::handshake;

    let host = address.to_string();
    for head in [
        format!("GET / HTTP/1.1\r\nHost: {text}\r\n\r\n"),
        format!("GET /{text} HTTP/1.1\r\nHost: {host}\r\n\r\n"),
        handshake(&host, "/", &format!("Origin: {text}\r\n")),
        format!("{text} / HTTP/1.1\r\nHost: {text}\r\n\r\n"),
    ] {
        // A text with a line end may leave the request unfinished.
        let answer = exchange(address, (head + "\r\n\r\n").as_bytes());
        assert!(!answer.is_empty());
    }
    let mut socket = Client::web(address);
    socket.close(1000, text);
    assert!(socket.is_closed());
}

/// The pipe holds 64 KiB, and the queue its lines. Each new client makes a line.
#[test]
fn an_unread_log_blocks_no_client_and_lost_lines_are_counted() {
    const CLIENTS: usize = 2 * QUEUE_LINES + 64 * 1024 / 50;
    for format in ["text", "json"] {
        let options = "--bind 127.0.0.1:0 --log debug --clients 4096 --log-format";
        let mut command = program();
        let mut child = Going::of(command.args(options.split(' ')).arg(format));
        let line = child.line();
        let address: SocketAddr = line.split(' ').next_back().unwrap().trim().parse().unwrap();
        for _ in 0..CLIENTS {
            std::net::TcpStream::connect(address).unwrap();
        }
        Client::to(address).settle();
        let log = thread::spawn({
            let stderr = child.0.stderr.take().unwrap();
            move || std::io::read_to_string(stderr).unwrap()
        });
        // The thread of the log continues, and has time for its last lines.
        thread::sleep(std::time::Duration::from_secs(1));
        child.terminate();
        assert!(end(&mut child.0).0.success());
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
