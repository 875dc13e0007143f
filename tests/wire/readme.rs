//! The clients on the README's first screen move the arm, against the built program.
//!
//! **Invariant:** the clients' lines are those of the README; only the port is another.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Instant;

use crate::common::{PATIENCE, Runtime};

fn readme() -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap()
}

/// The first block of that language in the README.
fn client(language: &str) -> String {
    let readme = readme();
    let block = readme.split(&format!("```{language}\n")).nth(1).unwrap();
    block.split("```").next().unwrap().to_owned()
}

#[test]
fn the_readmes_clients_have_six_lines_and_are_on_the_first_screen() {
    let screen: String = readme().lines().take(32).collect();
    assert!(screen.contains("make run") && screen.contains("make test"));
    for language in ["python", "js"] {
        let client = client(language);
        assert_eq!(client.lines().count(), 6, "{language}");
        assert!(screen.contains(client.lines().last().unwrap()));
    }
    assert_eq!(client("python").lines().next(), Some("import json, socket"));
}

/// Runs a client of the README until it has printed the setpoint, (0.3, -0.5), as the arm's position. The default gains
/// bring every setpoint to within 0.02 rad per joint.
fn assert_moves_the_arm(language: &str, program: &str, arguments: &[&str]) {
    if Command::new(program).arg("--version").output().is_err() {
        // A user may not have it. The project's own checks install it.
        assert!(std::env::var_os("CI").is_none(), "{program} is missing");
        return;
    }
    let runtime = Runtime::start();
    let client = client(language).replace("9095", &runtime.address.port().to_string());
    let mut child = Command::new(program)
        .args(arguments)
        .arg(&client)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let deadline = Instant::now() + PATIENCE;
    let (seen, lines) = channel();
    let output = BufReader::new(child.stdout.take().unwrap());
    let reader = std::thread::spawn(move || {
        output
            .lines()
            .map_while(Result::ok)
            .try_for_each(|line| seen.send(line))
    });
    // `'position': [0.3, -0.5]` in Python, `position: [ 0.3, -0.5 ]` in Node.
    let position = |line: &str| -> Option<Vec<f64>> {
        let numbers = line.split_once("position")?.1.split_once('[')?.1;
        let numbers = numbers.split_once(']')?.0.split(',');
        numbers.map(|number| number.trim().parse().ok()).collect()
    };
    let arrived = std::iter::from_fn(|| {
        let left = deadline.saturating_duration_since(Instant::now());
        lines.recv_timeout(left).ok()
    })
    .filter_map(|line| position(&line))
    .any(|q| q.len() == 2 && (q[0] - 0.3).abs() < 0.02 && (q[1] + 0.5).abs() < 0.02);
    drop(lines);
    let _ = child.kill();
    let _ = child.wait();
    let _ = reader.join();
    assert!(arrived, "the arm did not get there");
}

#[test]
fn the_readmes_client_in_python_moves_the_arm() {
    assert_moves_the_arm("python", "python3", &["-u", "-c"]);
}

#[test]
fn the_readmes_client_in_javascript_moves_the_arm() {
    // Node 22 has `WebSocket` without the flag.
    assert_moves_the_arm("js", "node", &["--experimental-websocket", "--eval"]);
}
