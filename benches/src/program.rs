//! The program as the system sees it: memory, descriptors, threads, time; and what it says on standard error.
//!
//! **Invariant:** it is stopped by its own process id, whatever becomes of the soak.

use std::fs;
use std::io::{BufRead, BufReader};
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use pendularm_client::ending;

/// Lines of the log that are kept; the rest are counted.
const MAX_LINES: usize = 50;

/// The program, running.
pub struct Program {
    child: Child,
    /// Address that it listens on.
    pub address: SocketAddr,
    log: Arc<Mutex<Log>>,
}

/// Its lines on standard error.
#[derive(Debug, Default, Clone)]
pub struct Log {
    /// The first lines.
    pub lines: Vec<String>,
    /// All lines.
    pub count: u64,
    /// Lines that speak of a panic.
    pub panics: u64,
}

/// A process as the system sees it.
#[derive(Debug, Clone, Copy)]
pub struct Vitals {
    /// Resident memory \[kB\].
    pub resident: f64,
    /// Open descriptors.
    pub descriptors: usize,
    /// Threads.
    pub threads: usize,
    /// Processor time used so far \[s\].
    pub cpu: f64,
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
        let log: Arc<Mutex<Log>> = Arc::default();
        if let Some(stderr) = child.stderr.take() {
            let log = Arc::clone(&log);
            std::thread::spawn(move || {
                for line in BufReader::new(stderr).lines().map_while(Result::ok) {
                    if let Ok(mut log) = log.lock() {
                        log.note(line);
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

    /// Starts another server, which listens at `address` within a minute.
    pub fn at(mut command: Command, address: SocketAddr) -> Result<Self, String> {
        let child = command
            .spawn()
            .map_err(|error| format!("{command:?}: {error}"))?;
        let program = Self {
            child,
            address,
            log: Arc::default(),
        };
        for _ in 0..6_000 {
            if TcpStream::connect(address).is_ok() {
                return Ok(program);
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Err(format!("{command:?} does not listen at {address}"))
    }

    /// Its process id.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Its lines so far.
    pub fn log(&self) -> Log {
        self.log.lock().map(|log| log.clone()).unwrap_or_default()
    }

    /// Asks it to end, and says how long that took and with which exit status.
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

impl Log {
    fn note(&mut self, line: String) {
        self.count += 1;
        self.panics += u64::from(line.contains("panic"));
        if self.lines.len() < MAX_LINES || line.contains("panic") {
            self.lines.push(line);
        }
    }
}

/// For how long threads of a process were able to run and had no processor \[s\]: the first one, which serves clients,
/// and the arm's. 0 where the system does not say.
pub fn queued(pid: u32) -> Queues {
    let mut tasks = Vec::new();
    for entry in fs::read_dir(format!("/proc/{pid}/task"))
        .into_iter()
        .flatten()
        .flatten()
    {
        let name = fs::read_to_string(entry.path().join("comm")).unwrap_or_default();
        if entry.file_name().to_string_lossy() == pid.to_string() || name.starts_with("actix-rt") {
            tasks.push(entry.path().join("schedstat"));
        }
    }
    tasks.push("/proc/thread-self/schedstat".into());
    Queues { tasks }
}

/// The time that virtual processors were held up for others \[s\]; to a thread on one it counts as its own.
fn stolen() -> f64 {
    let text = fs::read_to_string("/proc/stat").unwrap_or_default();
    let ticks = text
        .lines()
        .next()
        .and_then(|all| all.split_whitespace().nth(8));
    // A tick is a hundredth of a second here, whatever the kernel's own is.
    ticks
        .and_then(|ticks| ticks.parse::<f64>().ok())
        .unwrap_or_default()
        / 100.0
}

/// Threads whose waiting is looked at: two of the program, and the one that looks.
pub struct Queues {
    tasks: Vec<std::path::PathBuf>,
}

impl Queues {
    /// The time that all of them together have waited for a processor so far, or had one that another machine used
    /// instead. Then the time that the program's two have had one \[s\].
    pub fn look(&self) -> (f64, f64) {
        let (mut waited, mut ran) = (stolen(), 0.0);
        for (index, task) in self.tasks.iter().enumerate() {
            let text = fs::read_to_string(task).unwrap_or_default();
            let mut numbers = text
                .split_whitespace()
                .filter_map(|text| text.parse::<f64>().ok());
            let (running, waiting) = (numbers.next(), numbers.next());
            waited += waiting.unwrap_or_default() / 1e9;
            if index + 1 < self.tasks.len() {
                ran += running.unwrap_or_default() / 1e9;
            }
        }
        (waited, ran)
    }
}

/// The process with this id as the system sees it; none once it is gone.
pub fn vitals(pid: u32) -> Option<Vitals> {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let field = |name: &str| -> Option<f64> {
        let line = status.lines().find_map(|line| line.strip_prefix(name))?;
        line.split_whitespace().next()?.parse().ok()
    };
    let descriptors = fs::read_dir(format!("/proc/{pid}/fd")).ok()?.count();
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // Behind the name, which is in parentheses: user and system time are the twelfth and thirteenth, in hundredths.
    let after = stat.rsplit_once(')')?.1;
    let ticks: f64 = after
        .split_whitespace()
        .skip(11)
        .take(2)
        .filter_map(|text| text.parse::<f64>().ok())
        .sum();
    let resident = field("VmRSS:")?;
    // The allocator has as many of its own as it likes.
    let tasks = fs::read_dir(format!("/proc/{pid}/task")).ok()?.flatten();
    let name = |task: fs::DirEntry| fs::read_to_string(task.path().join("comm")).ok();
    let threads = tasks
        .filter_map(name)
        .filter(|name| !name.starts_with("jemalloc"))
        .count();
    Some(Vitals {
        resident,
        descriptors,
        threads,
        cpu: ticks / 100.0,
    })
}
