//! No open files are left: new clients get a message, served clients continue, and no thread spins.
//!
//! **Invariant:** the shell that starts the process sets its limits; the machine is not changed.

use std::process::Stdio;
use std::time::Instant;

use crate::common::{Client, Logged, Runtime, is_served_at_last, refusal_of, shell, stat};

/// Sets the program's soft limit of open files, under a hard one of 40.
fn set_soft_limit(runtime: &Runtime, files: usize) {
    let limit = format!("--nofile={files}:40");
    let set = std::process::Command::new("prlimit")
        .args(["--pid", &runtime.pid().to_string(), &limit])
        .status()
        .expect("prlimit runs");
    assert!(set.success());
}

/// Seconds of processor time that the program has used.
fn processor_seconds(runtime: &Runtime) -> f64 {
    let (_, fields) = stat(format!("/proc/{}/stat", runtime.pid()));
    // The 14th and 15th: ticks of 10 ms, the program's own and the system's.
    (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()) / 100.0
}

/// Clients that the program is asked to serve, all but the kept places.
const CLIENTS: usize = 1024 - 16;

/// The usual soft limit of 1,024 is not enough for 1,024 clients: it is raised.
#[test]
fn a_thousand_clients_are_served_and_the_next_gets_the_reason() {
    // The client's side of the connections also needs two files each.
    let ours = rlimit::increase_nofile_limit(4 * CLIENTS as u64).unwrap();
    assert!(ours > 3 * CLIENTS as u64, "the test needs files too");
    let runtime = Runtime::under_with("ulimit -S -n 256", &["--clients", "1024"]);
    let mut clients: Vec<Client> = (0..CLIENTS).map(|_| runtime.connect()).collect();
    for client in &mut clients {
        client.settle();
    }
    for _ in 0..3 {
        let told = refusal_of(&mut runtime.connect());
        assert!(told.contains("1024"), "{told}");
    }
}

/// With few open files fewer clients are served, and a warning is logged. Without a file no client can be accepted: the
/// program waits without using the processor, and continues once a file is free.
#[test]
fn running_out_of_files_affects_no_client_and_uses_no_processor() {
    Logged::start(shell("ulimit -n 40"), Stdio::null()).await_line("open files is low");
    let runtime = Runtime::under("ulimit -n 40");
    let mut served: Vec<Client> = (0..7).map(|_| runtime.connect()).collect();
    served[0].subscribe("/joint_states");
    for client in &mut served {
        client.settle();
    }
    // The limit falls below the number of open files: no further file can be opened.
    set_soft_limit(&runtime, 8);
    let mut waiting: Vec<Client> = (0..60).map(|_| runtime.connect()).collect();
    let before = processor_seconds(&runtime);
    let began = Instant::now();
    for _ in 0..90 {
        served[0].message("/joint_states");
        served[1].settle();
    }
    let (used, took) = (processor_seconds(&runtime) - before, began.elapsed());
    // A spinning thread uses all of it. The subscriber and the calls use a small part.
    assert!(used < 0.5 * took.as_secs_f64(), "{used} s in {took:?}");
    set_soft_limit(&runtime, 40);
    for client in &mut waiting {
        assert!(refusal_of(client).contains("serves 8 clients"));
    }
    for client in &mut served {
        client.settle();
    }
    served.pop();
    assert!(is_served_at_last(runtime.address));
}
