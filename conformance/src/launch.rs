//! A server that the suite starts itself, in a process group of its own, and the rules about its start and end.

use std::io;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::bench::Found;
use crate::peer::Peer;
use crate::run::Run;
use crate::values::must;
use crate::{CATEGORIES, Got, REMARKS, Row, Rule};

/// The longest time from the start to an open port. A command may build first.
const STARTING: Duration = Duration::from_secs(120);
/// The longest time from SIGTERM to the end.
const ENDING: Duration = Duration::from_secs(5);
/// The longest wait for a server that must refuse its settings.
const REFUSING: Duration = Duration::from_secs(10);

/// A command for the shell that serves at an address.
#[derive(Debug, Clone)]
pub struct Launch {
    /// The command.
    pub command: String,
    /// Where it serves.
    pub address: String,
    /// Ends every wait once it is true.
    pub ending: Arc<AtomicBool>,
}

/// A started server. Dropping it ends its process group.
#[derive(Debug)]
pub struct Started {
    child: Child,
    address: String,
}

impl Launch {
    fn listens(&self) -> bool {
        Peer::connect(&self.address, &Arc::default()).is_ok()
    }

    fn spawn(&self, links: Option<&str>) -> Result<Started, String> {
        must(!self.listens(), || format!("something listens at {} already", self.address))?;
        let mut command = shell(&self.command);
        match links {
            Some(links) => command.env("ARM_SIM_LINKS", links),
            None => command.env_remove("ARM_SIM_LINKS"),
        };
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
        let child = child.map_err(|error| format!("{}: {error}", self.command))?;
        Ok(Started { child, address: self.address.clone() })
    }

    /// Starts the server with this value of `ARM_SIM_LINKS`, and waits for its port.
    ///
    /// # Errors
    /// If something listens there already, or if the port is not open in time.
    pub fn start(&self, links: Option<&str>) -> Result<Started, String> {
        let mut started = self.spawn(links)?;
        let began = Instant::now();
        while !self.listens() {
            if let Some(status) = started.status() {
                return Err(format!("{:?} ended before it opened {}: {status}", self.command, self.address));
            }
            must(!self.ending.load(Ordering::Relaxed), || "interrupted".to_owned())?;
            must(began.elapsed() < STARTING, || {
                format!("{:?} did not open {} within {} s", self.command, self.address, STARTING.as_secs())
            })?;
            std::thread::sleep(Duration::from_millis(20));
        }
        Ok(started)
    }

    /// Tries the rules about the start and the end. The server must not run.
    #[must_use]
    pub fn rows(&self, is_selected: impl Fn(&Rule) -> bool) -> Vec<Row> {
        let tried = RULES.iter().zip(CHECKS).filter(|(rule, _)| is_selected(rule));
        tried.map_while(|(rule, check)| (!self.ending.load(Ordering::Relaxed)).then(|| Row::of(*rule, check(self)))).collect()
    }
}

impl Started {
    fn status(&mut self) -> Option<ExitStatus> {
        self.child.try_wait().ok().flatten()
    }

    fn ends_within(&mut self, limit: Duration) -> Option<ExitStatus> {
        let began = Instant::now();
        loop {
            if let Some(status) = self.status() {
                return Some(status);
            }
            if began.elapsed() > limit {
                return None;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits until nothing listens at the address. False if that takes too long.
    fn closes_within(&self, limit: Duration) -> bool {
        let began = Instant::now();
        while Peer::connect(&self.address, &Arc::default()).is_ok() {
            if began.elapsed() > limit {
                return false;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        true
    }

    /// Ends the server as a user does, then by force. Passes if it ended in time.
    ///
    /// # Errors
    /// If it had to be ended by force.
    pub fn stop(mut self) -> Got {
        let began = Instant::now();
        signal(&mut self.child, false).map_err(|error| error.to_string())?;
        must(self.ends_within(ENDING).is_some(), || format!("it still ran {} s after SIGTERM", ENDING.as_secs()))?;
        // The shell may end before the server that it started.
        must(self.closes_within(ENDING), || "its port is still open".to_owned())?;
        Ok(format!("after {:.2} s", began.elapsed().as_secs_f64()))
    }
}

impl Drop for Started {
    fn drop(&mut self) {
        // The group may have members after the end of its first process.
        let _ = signal(&mut self.child, true);
        let _ = self.child.wait();
        self.closes_within(ENDING);
    }
}

#[cfg(unix)]
fn shell(command: &str) -> Command {
    use std::os::unix::process::CommandExt;
    let mut shell = Command::new("sh");
    shell.args(["-c", command]).process_group(0);
    shell
}

#[cfg(unix)]
fn signal(child: &mut Child, by_force: bool) -> io::Result<()> {
    use rustix::process::{Pid, Signal, kill_process_group};
    let signal = if by_force { Signal::KILL } else { Signal::TERM };
    kill_process_group(Pid::from_child(child), signal).map_err(io::Error::from)
}

#[cfg(not(unix))]
fn shell(command: &str) -> Command {
    let mut shell = Command::new("cmd");
    shell.args(["/C", command]);
    shell
}

#[cfg(not(unix))]
fn signal(child: &mut Child, _: bool) -> io::Result<()> {
    child.kill()
}

const fn rule(id: &'static str, says: &'static str, expected: &'static str, rests_on: &'static str) -> Rule {
    let category = if rests_on.is_empty() { REMARKS } else { CATEGORIES[2] };
    Rule { id, category, links: None, says, expected, rests_on, check: |_| Err("needs --start".to_owned()) }
}

const VARIABLE: &str = r#"should read the ARM_SIM_LINKS environment variable ("2" or "3", defaulting to a 2-link arm when it's unset)"#;

/// The rules, which need `--start`.
pub const RULES: [Rule; 5] = [
    rule("launch-1", "ARM_SIM_LINKS selects the number of links", "an arm with 2 links for 2, with 3 links for 3", VARIABLE),
    rule("launch-2", "Without ARM_SIM_LINKS the arm has 2 links", "2 links", VARIABLE),
    rule("launch-3", "A bad value of ARM_SIM_LINKS is refused", "an exit status that is not 0 within 10 s for seven", ""),
    rule("launch-4", "SIGTERM ends the server", "its end within 5 s, with a client connected", ""),
    rule("launch-5", "The server starts again at once on the same port", "an open port after an end with a client connected", ""),
];

const CHECKS: [fn(&Launch) -> Got; 5] = [
    |launch| {
        for links in ["2", "3"] {
            has_links(launch, Some(links), links)?;
        }
        Ok("2 and 3 links".to_owned())
    },
    |launch| has_links(launch, None, "2"),
    |launch| {
        let mut started = launch.spawn(Some("seven"))?;
        let status = started.ends_within(REFUSING).ok_or("it still ran after 10 s")?;
        must(!status.success(), || status.to_string())?;
        Ok(status.to_string())
    },
    |launch| {
        let started = launch.start(None)?;
        let _client = Peer::connect(&launch.address, &Arc::default())?;
        started.stop()
    },
    |launch| {
        let started = launch.start(None)?;
        let _client = Peer::connect(&launch.address, &Arc::default())?;
        drop(started);
        launch.start(None).map(|_| "an open port".to_owned())
    },
];

fn has_links(launch: &Launch, value: Option<&str>, expected: &str) -> Got {
    let _started = launch.start(value)?;
    let found = Found::at(&launch.address, &Arc::new(Run::default()))?.links.to_string();
    must(found == expected, || format!("{found} links instead of {expected}"))?;
    Ok(format!("{found} links"))
}
