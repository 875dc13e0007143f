//! The client on the README's first screen does what the README says, against the built program.
//!
//! **Invariant:** the client's lines are taken from the README as they stand there; only the port is another.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Instant;

use crate::common::{PATIENCE, Runtime};

/// The first Python block of the README.
fn client() -> String {
    let readme = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    let readme = fs::read_to_string(readme).unwrap();
    let block = readme.split("```python\n").nth(1).unwrap();
    block.split("```").next().unwrap().to_owned()
}

#[test]
fn the_readmes_client_is_six_lines_of_the_standard_library_and_on_the_first_screen() {
    let client = client();
    assert_eq!(client.lines().count(), 6);
    assert_eq!(client.lines().next(), Some("import json, socket"));
    let readme =
        fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md")).unwrap();
    let screen: String = readme.lines().take(25).collect();
    assert!(screen.contains("make run") && screen.contains("make test"));
    assert!(screen.contains(client.lines().last().unwrap()));
}

/// The setpoint is (0.3, -0.5); the default gains bring every setpoint to within 0.02 rad per joint.
#[test]
fn the_readmes_client_moves_the_arm_to_its_setpoint() {
    if Command::new("python3").arg("--version").output().is_err() {
        // A builder need not have Python; the project's own checks install it.
        assert!(std::env::var_os("CI").is_none(), "python3 is missing");
        return;
    }
    let runtime = Runtime::start();
    let client = client().replace("9095", &runtime.address.port().to_string());
    let mut python = Command::new("python3")
        .args(["-u", "-c", &client])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let deadline = Instant::now() + PATIENCE;
    let (seen, lines) = channel();
    let output = BufReader::new(python.stdout.take().unwrap());
    let reader = std::thread::spawn(move || {
        output
            .lines()
            .map_while(Result::ok)
            .try_for_each(|line| seen.send(line))
    });
    // Python shows a message as it writes any dict: {..., 'position': [0.3, -0.5], ...}.
    let position = |line: &str| -> Option<Vec<f64>> {
        let numbers = line.split_once("'position': [")?.1.split_once(']')?.0;
        Some(
            numbers
                .split(", ")
                .map(|number| number.parse().unwrap())
                .collect(),
        )
    };
    let arrived = std::iter::from_fn(|| {
        let left = deadline.saturating_duration_since(Instant::now());
        lines.recv_timeout(left).ok()
    })
    .filter_map(|line| position(&line))
    .any(|q| (q[0] - 0.3).abs() < 0.02 && (q[1] + 0.5).abs() < 0.02);
    drop(lines);
    let _ = python.kill();
    let _ = python.wait();
    let _ = reader.join();
    assert!(arrived, "the arm did not get there");
}
