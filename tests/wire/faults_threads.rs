//! No more threads can start: the program continues with those that it has, and a program that cannot start prints why.
//!
//! **Invariant:** the limits are the process's own. They do not apply to the superuser, so tests of the superuser run
//! the program as another user.

use std::io::Read;
use std::process::{Command, Stdio};

use crate::common::{Client, Runtime, without_variables};
use crate::web_client::get;
use serde_json::json;

/// Switches to a user to whom the system's limits apply.
const AS_A_USER: &str =
    "[ \"$(id -u)\" = 0 ] && user='setpriv --reuid 54321 --regid 54321 --clear-groups --'";

/// That user may have no access to the program's folder.
const OPEN_PROGRAM: &str = "exec 9<\"$0\"";

#[track_caller]
fn read_bytes(client: &Client, bytes: usize) {
    client.stream().read_exact(&mut vec![0; bytes]).unwrap();
}

/// No thread is started from now on.
fn refuse_threads(runtime: &Runtime) {
    let script = format!(
        "{AS_A_USER}; exec $user prlimit --nproc=1:1 --pid {}",
        runtime.pid()
    );
    let set = Command::new("sh").args(["-c", &script]).status();
    assert!(set.expect("prlimit runs").success());
}

/// Megabytes to read, encode and write, answers to cancelled calls, and the page: all work outside the gateway's
/// thread.
#[test]
fn with_no_more_threads_everything_is_still_served() {
    let runtime = Runtime::under(&format!(
        "{AS_A_USER}; {OPEN_PROGRAM}; exec $user /proc/self/fd/9 \"$@\"; false"
    ));
    refuse_threads(&runtime);
    let blob = "x".repeat(1_000_000);
    let steps = json!({"op": "call_service", "service": "/arm_sim/integration_step", "args":
        {"function": "t", "x0": 0, "dt": 1e-3, "steps": 1_000_000, "integrator": "euler"}});
    for _ in 0..3 {
        let mut leaving = runtime.connect();
        leaving.send(&steps);
        read_bytes(&leaving, 100_000);
        drop(leaving);
        let mut watcher = Client::web(runtime.address);
        watcher.send(&json!({"op": "subscribe", "topic": "/blobs", "compression": "cbor"}));
        watcher.settle();
        let mut publisher = runtime.connect();
        publisher.send(&json!({"op": "advertise", "topic": "/blobs"}));
        publisher.send(&json!({"op": "publish", "topic": "/blobs", "msg": {"data": blob}}));
        publisher.settle();
        read_bytes(&watcher, 900_000);
        assert_eq!(get(runtime.address, "/").status, 200);
    }
    let mut patient = runtime.connect();
    patient.send(&steps);
    assert_eq!(patient.receive()["result"], true);
}

#[test]
fn a_program_that_gets_no_thread_at_launch_says_so() {
    let mut shell = Command::new("sh");
    // The threads of a user count together.
    let as_another = AS_A_USER.replace("54321", "54322");
    let script = format!(
        "{as_another}; {OPEN_PROGRAM}; exec prlimit --nproc=1:1 $user /proc/self/fd/9 \"$@\""
    );
    shell.args([
        "-c",
        &script,
        env!("CARGO_BIN_EXE_pendularm"),
        "--bind",
        "127.0.0.1:0",
    ]);
    let output = without_variables(shell)
        .env("ARM_SIM_LOG", "warn")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    let last = said.lines().last().unwrap_or_default();
    assert!(last.starts_with("pendularm: cannot "), "{said}");
    assert!(last.contains("Resource temporarily unavailable"), "{said}");
    assert!(!said.contains("panic"), "{said}");
}
