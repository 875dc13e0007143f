//! The program's process: memory, descriptors, threads, processor and simulation time, and its lines on standard error.
//!
//! **Invariant:** it is stopped by its own process id at every end of the run.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use pendularm_client::blocking::Client;
use pendularm_client::ending;

/// Lines of the log that are kept, beside those of panics.
const MAX_LINES: usize = 50;

/// The program, running.
pub struct Program {
    child: Child,
    /// Address that it listens on.
    pub address: SocketAddr,
    /// The first lines on standard error, and those of panics.
    log: Arc<Mutex<Vec<String>>>,
}

/// The state of a process.
#[derive(Debug, Clone, Copy)]
pub struct Vitals {
    /// Resident memory \[MB\].
    pub resident: f64,
    /// Open descriptors.
    pub descriptors: usize,
    /// Threads.
    pub threads: usize,
}

impl Program {
    /// Starts a server on a free port, which says `listening on ADDRESS`.
    pub fn start(path: &str, arguments: &[&str]) -> Result<Self, String> {
        let mut command = Command::new(path);
        for (variable, _) in std::env::vars().filter(|(name, _)| name.starts_with("ARM_SIM_")) {
            command.env_remove(variable);
        }
        let mut child = command
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| format!("{path} does not start: {error}"))?;
        let mut line = String::new();
        if let Some(stdout) = child.stdout.take() {
            let _ = BufReader::new(stdout).read_line(&mut line);
        }
        let address = line
            .trim()
            .strip_prefix("listening on ")
            .and_then(|text| text.parse().ok());
        let log: Arc<Mutex<Vec<String>>> = Arc::default();
        if let Some(stderr) = child.stderr.take() {
            let log = Arc::clone(&log);
            std::thread::spawn(move || {
                for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                    let mut log = log.lock().expect("nobody panics with it");
                    if log.len() < MAX_LINES || line.contains("panic") {
                        log.push(line);
                    }
                }
            });
        }
        let Some(address) = address else {
            let _ = child.kill();
            let _ = child.wait();
            return Err(format!("{path} says {line:?} instead of where it listens"));
        };
        Ok(Self {
            child,
            address,
            log,
        })
    }

    /// Its process id.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Its first lines on standard error so far, and those of panics.
    pub fn log(&self) -> Vec<String> {
        self.log.lock().expect("nobody panics with it").clone()
    }

    /// Ends it by a signal, and returns the time and the exit status.
    pub fn end(mut self) -> Result<(Duration, Option<i32>), String> {
        let pid = self.pid().to_string();
        Command::new("kill")
            .args(["-TERM", &pid])
            .status()
            .map_err(|error| format!("kill: {error}"))?;
        match ending::wait(&mut self.child, Duration::from_secs(10)) {
            Ok(Some((status, took))) => Ok((took, status.code())),
            Ok(None) => Err("it is still there 10 s after SIGTERM".to_owned()),
            Err(error) => Err(format!("the program's end: {error}")),
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The state of the process with this id. None if it has ended.
pub fn vitals(pid: u32) -> Option<Vitals> {
    let descriptors = fs::read_dir(format!("/proc/{pid}/fd")).ok()?.count();
    let threads = fs::read_dir(format!("/proc/{pid}/task")).ok()?.count();
    Some(Vitals {
        resident: status_field(pid, "VmRSS:")?,
        descriptors,
        threads,
    })
}

/// The most memory that a process has had resident \[MB\]; none once it is gone.
pub fn peak(pid: u32) -> Option<f64> {
    status_field(pid, "VmHWM:")
}

/// A field of `/proc/<pid>/status`, there in kB \[MB\].
fn status_field(pid: u32, name: &str) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    Some(line.split_whitespace().next()?.parse::<f64>().ok()? / 1024.0)
}

/// The next simulation time on `/clock`, to which the client has subscribed \[s\].
///
/// # Panics
/// If none arrives.
pub fn simulation_time(client: &mut Client) -> f64 {
    let clock = &client.message("/clock")["clock"];
    let number = |key: &str| clock[key].as_f64().expect("a number");
    number("sec") + 1e-9 * number("nanosec")
}

/// Processor time of all threads of a process so far, as the scheduler counts it \[ns\].
///
/// # Panics
/// If the process is gone.
pub fn processor(pid: u32) -> u64 {
    threads(pid).iter().map(|thread| thread.processor).sum()
}

/// The work of a thread so far.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ThreadWork {
    /// The thread.
    pub id: String,
    /// Its name.
    pub name: String,
    /// Processor time \[ns\].
    pub processor: u64,
    /// Voluntary switches: each ends with a wake-up.
    pub wake_ups: u64,
    /// Involuntary switches, to another thread.
    pub preemptions: u64,
}

/// The work of each thread of a process so far.
///
/// # Panics
/// If the process is gone.
pub fn threads(pid: u32) -> Vec<ThreadWork> {
    let threads = fs::read_dir(format!("/proc/{pid}/task")).expect("the server runs");
    let read = |path: std::path::PathBuf| {
        let status = fs::read_to_string(path.join("status")).ok()?;
        let field = |name: &str| {
            let mut lines = status.lines();
            lines.find_map(|line| Some(line.strip_prefix(name)?.trim().to_owned()))
        };
        let schedstat = fs::read_to_string(path.join("schedstat")).ok()?;
        Some(ThreadWork {
            id: path.file_name()?.to_str()?.to_owned(),
            name: field("Name:")?,
            processor: schedstat.split_whitespace().next()?.parse().ok()?,
            wake_ups: field("voluntary_ctxt_switches:")?.parse().ok()?,
            preemptions: field("nonvoluntary_ctxt_switches:")?.parse().ok()?,
        })
    };
    threads
        .filter_map(|thread| read(thread.ok()?.path()))
        .collect()
}

/// The work of each thread since `before`, which a new thread is not in.
pub fn threads_since(pid: u32, before: &[ThreadWork]) -> Vec<ThreadWork> {
    let mut now = threads(pid);
    for thread in &mut now {
        if let Some(before) = before.iter().find(|one| one.id == thread.id) {
            thread.processor -= before.processor;
            thread.wake_ups -= before.wake_ups;
            thread.preemptions -= before.preemptions;
        }
    }
    now
}

/// Resident memory of a process \[MB\].
///
/// # Panics
/// If the process is gone.
pub fn resident(pid: u32) -> f64 {
    status_field(pid, "VmRSS:").expect("the server runs")
}
