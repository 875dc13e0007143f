//! Faults in operation: signals, limits of the shell, standard streams that accept nothing, and floods of warnings.
//!
//! **Invariant:** each ends normally or has no effect on clients; the limits are the process's own.

use std::fs::{self, File};
use std::io::Write;
use std::net::TcpStream;
use std::process::Stdio;
use std::thread;
use std::time::{Duration, Instant};

use crate::common::{Client, Logged, PATIENCE, Runtime, program, shell, signal};
use crate::folder::Folder;
use serde_json::json;

#[cfg(all(feature = "record", target_os = "linux"))]
#[test]
fn every_signal_that_ends_a_process_by_default_ends_the_program_in_order_and_its_record_is_whole() {
    for name in [
        "HUP", "QUIT", "USR1", "USR2", "ALRM", "VTALRM", "PROF", "XCPU", "IO", "PWR", "STKFLT",
    ] {
        let folder = Folder::new(&format!("signal-{name}"));
        let path = folder.join("run.mcap");
        let mut runtime = Runtime::hearing_all(&["--record", path.to_str().unwrap()]);
        let mut client = runtime.connect();
        client.subscribe("/joint_states");
        client.message("/joint_states");
        signal(runtime.pid(), name);
        assert!(runtime.end().0.success(), "{name}");
        assert!(client.is_closed());
        let (_, ending) = crate::record::passages(&path);
        assert_eq!(ending, pendularm::record::RecordEnding::Whole, "{name}");
    }
}

/// `nohup` ignores SIGHUP, and a shell ignores SIGINT for its jobs in the background.
#[cfg(target_os = "linux")]
#[test]
fn a_signal_that_was_ignored_at_the_start_stays_ignored_but_for_requests_to_end() {
    for request in ["INT", "TERM"] {
        let mut runtime = Runtime::under("trap '' HUP QUIT USR1 INT TERM");
        let mut client = runtime.connect();
        for name in ["HUP", "QUIT", "USR1"] {
            signal(runtime.pid(), name);
            client.settle();
        }
        signal(runtime.pid(), request);
        assert!(runtime.end().0.success());
    }
}

#[test]
fn signals_of_failed_writes_and_harmless_signals_affect_no_client() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    for name in ["PIPE", "XFSZ", "CHLD", "WINCH", "URG", "CONT"] {
        signal(runtime.pid(), name);
        client.settle();
    }
    runtime.stop();
}

/// Beyond the limit of file sizes a write fails like one to a full disk.
#[cfg(feature = "record")]
#[test]
fn a_record_beyond_the_limit_of_file_sizes_ends_with_an_error_and_clients_are_served() {
    let folder = Folder::new("limited-record");
    let path = folder.join("run.mcap");
    let arguments = ["--record", path.to_str().unwrap()];
    let runtime = Runtime::under_with("ulimit -f 160", &arguments);
    let mut client = runtime.connect();
    client.ask("/arm_sim/pause", json!({"data": true}));
    let time = client.ask("/rosapi/get_time", json!({}))["time"].take();
    client.subscribe("/rosout");
    let told = client.message("/rosout");
    assert_eq!(
        (&told["level"], &told["name"]),
        (&json!(40), &json!("recorder")),
        "{told}"
    );
    let is_now = |part: &str| told["stamp"][part] == time[part];
    assert!(is_now("sec") && is_now("nanosec"), "{told} at {time}");
    let text = told["msg"].as_str().unwrap();
    assert!(
        text.contains("the record ends") && text.contains("File too large"),
        "{text}"
    );
    client.settle();
    runtime.stop();
    let mut recording = pendularm::record::Recording::new(File::open(&path).unwrap());
    assert!(
        recording.next_passage().unwrap().is_some(),
        "it is readable up to there"
    );
}

#[test]
fn a_log_beyond_the_limit_of_file_sizes_affects_no_client() {
    let folder = Folder::new("limited-log");
    let path = folder.join("log");
    let prelude = format!("ulimit -f 1 && exec 2>'{}'", path.display());
    let runtime = Runtime::under_with(&prelude, &["--log", "trace"]);
    for _ in 0..20 {
        runtime.connect().settle();
    }
    // The log is written by a thread of its own, which a busy machine may delay.
    let begun = Instant::now();
    while ![512, 1024].contains(&fs::metadata(&path).unwrap().len()) {
        assert!(begun.elapsed() < PATIENCE, "the log is not at its limit");
        thread::sleep(Duration::from_millis(10));
    }
    runtime.stop();
}

#[cfg(target_os = "linux")]
#[test]
fn clients_are_served_even_if_standard_output_fails() {
    let full_pipe = || {
        let (reader, mut writer) = std::io::pipe().unwrap();
        rustix::io::ioctl_fionbio(&writer, true).unwrap();
        while writer.write(&[0; 4096]).is_ok() {}
        rustix::io::ioctl_fionbio(&writer, false).unwrap();
        (Some(reader), Stdio::from(writer))
    };
    let closed_pipe = || (None, Stdio::from(std::io::pipe().unwrap().1));
    let full_disk = || {
        (
            None,
            Stdio::from(File::options().write(true).open("/dev/full").unwrap()),
        )
    };
    let folder = Folder::new("limited-output");
    let limited = format!("ulimit -f 0 && exec >'{}/out'", folder.display());
    let nothing = || (None, Stdio::null());
    for ((reader, stdout), command, says) in [
        (full_pipe(), program(), None),
        (closed_pipe(), program(), Some("Broken pipe")),
        (full_disk(), program(), Some("No space left")),
        (nothing(), shell(&limited), Some("File too large")),
        (nothing(), shell("exec >&-"), None),
    ] {
        let mut runtime = Logged::start(command, stdout);
        Client::to(runtime.address).settle();
        if let Some(says) = says {
            runtime.await_line(says);
        }
        runtime.end();
        drop(reader);
    }
}

/// A request waits for its turn unread and unwritten, so only the system knows that its client has left.
#[cfg(target_os = "linux")]
#[test]
fn nothing_is_stepped_for_clients_that_left_before_a_reset_that_was_answered() {
    let runtime = Runtime::start();
    let mut client = runtime.connect();
    client.call("/arm_sim/pause", json!({"data": true}));
    for (calls, steps) in [(200, 500), (1, 1_000_000), (2, 2500), (200, 1), (40, 999)] {
        let call =
            json!({"op": "call_service", "service": "/arm_sim/step", "args": {"steps": steps}});
        let frames = format!("{call}\n").repeat(calls);
        let leave = |_| {
            let mut stream = TcpStream::connect(runtime.address).unwrap();
            stream.write_all(frames.as_bytes()).unwrap();
            stream
        };
        drop((0..8).map(leave).collect::<Vec<_>>());
        client.call("/arm_sim/reset", json!({}));
        for step in 1..=30 {
            let stepped = client.call("/arm_sim/step", json!({"steps": 1}));
            let time = stepped["values"]["time"].as_f64().unwrap();
            assert_eq!((time * 1e3).round(), f64::from(step), "{calls} of {steps}");
            thread::sleep(Duration::from_millis(2));
        }
    }
}

/// The number of events in lines: one each, or the number in the line.
fn events(lines: &[String]) -> usize {
    let count = |line: &String| match line.split_once("(first of ") {
        Some((_, rest)) => rest.split(' ').next().unwrap().parse().unwrap(),
        None => 1,
    };
    lines.iter().map(count).sum()
}

/// `tests/actors/log_repeats.rs` has the times.
#[test]
fn a_repeated_warning_is_logged_and_published_once_a_second_with_a_count() {
    const TIMES: usize = 100;
    let runtime = Logged::start(program(), Stdio::null());
    let (mut client, mut listener) = (Client::to(runtime.address), Client::to(runtime.address));
    listener.subscribe("/rosout");
    client.ask("/arm_sim/pause", json!({"data": true}));
    client.ask("/arm_sim/set_params", json!({"gravity": 1e300}));
    client.ask("/arm_sim/set_integrator", json!({"timestep": 1e10}));
    let began = Instant::now();
    let step = json!({"op": "call_service", "service": "/arm_sim/step", "args": {"steps": 1}});
    let reset = json!({"op": "call_service", "service": "/arm_sim/reset"});
    client.send_bytes(format!("{reset}\n{step}\n").repeat(TIMES).as_bytes());
    let mut published = Vec::new();
    while events(&published) < TIMES {
        let message = listener.message("/rosout");
        assert_eq!(
            (&message["level"], &message["name"]),
            (&json!(30), &json!("arm_sim"))
        );
        let is_source = message["file"].as_str().unwrap().ends_with(".rs");
        assert!(is_source, "{message}");
        published.push(message["msg"].as_str().unwrap().to_owned());
    }
    let mut log = runtime.end();
    let seconds = began.elapsed().as_secs() as usize + 2;
    log.retain(|line| line.contains(" WARN "));
    let is_expected = |line: &String| line.contains(" pendularm::") && line.contains("diverged");
    assert!(log.iter().all(is_expected), "{log:?}");
    for lines in [log, published] {
        assert!(
            lines.len() <= seconds && events(&lines) == TIMES,
            "{lines:?}"
        );
    }
}
