//! Signals, awaited on a separate thread, so no other thread delays them.
//!
//! An orderly end answers waiting calls, and needs every thread. If a busy thread does not respond in time, the last
//! resort ends the process.
//!
//! **Invariant:** after a signal the process lives for at most [`MAX_SHUTDOWN_TIME`].

use std::future::poll_fn;
use std::io;
use std::sync::mpsc;
use std::task::{Context, Poll};
use std::thread;
use std::time::Duration;

#[cfg(unix)]
use rustix::process::Signal;
use tokio::runtime::{Builder, Runtime};
#[cfg(unix)]
use tokio::signal::unix::{SignalKind, signal};
#[cfg(windows)]
use tokio::signal::windows;
use tokio::sync::oneshot;

/// Longest time of an orderly end: one second, minus the time for the log and the end of the process.
pub const MAX_SHUTDOWN_TIME: Duration = Duration::from_millis(850);

/// The name of the request that has arrived; otherwise the task is woken when one arrives.
type Arrivals = Box<dyn FnMut(&mut Context<'_>) -> Poll<&'static str> + Send>;

/// The requests to end that this process receives from now on. It needs a Tokio runtime.
pub(crate) struct EndRequests(Vec<Arrivals>);

impl EndRequests {
    /// # Errors
    /// If the operating system refuses a signal handler.
    pub(crate) fn listen() -> io::Result<Self> {
        arrivals().map(Self)
    }

    /// Waits for the next request, and returns its name.
    pub(crate) async fn next(&mut self) -> &'static str {
        poll_fn(|cx| {
            let mut all = self.0.iter_mut().map(|poll| poll(cx));
            all.find(Poll::is_ready).unwrap_or(Poll::Pending)
        })
        .await
    }
}

/// Requests to end. They apply even if they were ignored at the start, as in a shell's background jobs.
#[cfg(unix)]
const REQUESTS: [(&str, Signal); 2] = [("SIGINT", Signal::INT), ("SIGTERM", Signal::TERM)];
/// Further signals that end a process by default. They end the program in order, unless they were ignored at the
/// start, as with `nohup`. SIGABRT is not among them, because it asks for a core dump.
#[cfg(unix)]
const FATAL: &[(&str, Signal)] = &[
    ("SIGHUP", Signal::HUP),
    ("SIGQUIT", Signal::QUIT),
    ("SIGUSR1", Signal::USR1),
    ("SIGUSR2", Signal::USR2),
    ("SIGALRM", Signal::ALARM),
    ("SIGVTALRM", Signal::VTALARM),
    ("SIGPROF", Signal::PROF),
    ("SIGXCPU", Signal::XCPU),
    #[cfg(target_os = "linux")]
    ("SIGIO", Signal::IO),
    #[cfg(target_os = "linux")]
    ("SIGPWR", Signal::POWER),
    #[cfg(target_os = "linux")]
    ("SIGSTKFLT", Signal::STKFLT),
];

/// From now on a write beyond the limit of file sizes (`ulimit -f`) fails like a write to a full disk. By default
/// SIGXFSZ kills the process.
///
/// # Errors
/// If the operating system refuses the signal handler.
#[cfg(unix)]
pub fn survive_file_size_limit() -> io::Result<()> {
    let runtime = runtime()?;
    let _entered = runtime.enter();
    // The handler exists as long as the process.
    signal(SignalKind::from_raw(Signal::XFSZ.as_raw())).map(drop)
}

fn runtime() -> io::Result<Runtime> {
    Builder::new_current_thread().enable_all().build()
}

/// The fatal signals that were not ignored at the start.
#[cfg(unix)]
fn further() -> impl Iterator<Item = (&'static str, Signal)> {
    let ignored = ignored_at_start();
    let is_heard = move |one: Signal| ignored & (1 << (one.as_raw() - 1)) == 0;
    FATAL.iter().copied().filter(move |(_, one)| is_heard(*one))
}

/// The signals of this process.
#[cfg(unix)]
fn arrivals() -> io::Result<Vec<Arrivals>> {
    let all = REQUESTS.into_iter().chain(further());
    all.map(|(name, one)| {
        let mut one = signal(SignalKind::from_raw(one.as_raw()))?;
        let poll = move |cx: &mut Context<'_>| one.poll_recv(cx).map(|_| name);
        Ok(Box::new(poll) as Arrivals)
    })
    .collect()
}

/// The console events that end a process by default.
#[cfg(windows)]
fn arrivals() -> io::Result<Vec<Arrivals>> {
    let mut ctrl_c = windows::ctrl_c()?;
    let mut ctrl_break = windows::ctrl_break()?;
    let mut close = windows::ctrl_close()?;
    let mut shutdown = windows::ctrl_shutdown()?;
    Ok(vec![
        Box::new(move |cx| ctrl_c.poll_recv(cx).map(|_| "Ctrl-C")),
        Box::new(move |cx| ctrl_break.poll_recv(cx).map(|_| "Ctrl-Break")),
        Box::new(move |cx| close.poll_recv(cx).map(|_| "console closed")),
        Box::new(move |cx| shutdown.poll_recv(cx).map(|_| "system shutdown")),
    ])
}

/// The signals that were ignored at the start, one bit each. Only Linux provides this.
#[cfg(unix)]
fn ignored_at_start() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status
        .lines()
        .find_map(|line| line.strip_prefix("SigIgn:"))
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.unwrap_or_default()
}

/// Handles the signals of this process while this value exists.
pub(crate) struct Signals {
    /// Receives a signal.
    pub(crate) came: oneshot::Receiver<()>,
    /// An orderly end drops this, and so cancels the last resort.
    _orderly: mpsc::Sender<()>,
}

impl Signals {
    /// Handles signals from now on. `force_exit` is called if an orderly end takes too long, and should not return.
    ///
    /// # Errors
    /// If the operating system refuses a thread or a signal handler.
    pub(crate) fn listen(force_exit: Box<dyn FnOnce() + Send>) -> io::Result<Self> {
        let runtime = runtime()?;
        let mut requests = {
            let _entered = runtime.enter();
            EndRequests::listen()?
        };
        let (come, came) = oneshot::channel();
        let (orderly, has_ended) = mpsc::channel::<()>();
        let wait = move || {
            let name = runtime.block_on(requests.next());
            // There is no receiver if the runtime has already ended.
            let _ = come.send(());
            tracing::info!("{name}: shutting down");
            if let Err(mpsc::RecvTimeoutError::Timeout) = has_ended.recv_timeout(MAX_SHUTDOWN_TIME)
            {
                force_exit();
            }
        };
        thread::Builder::new().name("signals".into()).spawn(wait)?;
        Ok(Self {
            came,
            _orderly: orderly,
        })
    }
}

/// Calls `ask` once this process is asked to end. A second request ends it at once.
///
/// # Errors
/// If the operating system refuses a thread or a signal handler.
#[cfg(feature = "conformance")]
pub(crate) fn at_request(ask: impl Fn() + Send + 'static) -> io::Result<()> {
    let runtime = runtime()?;
    let mut requests = {
        let _entered = runtime.enter();
        EndRequests::listen()?
    };
    let wait = move || {
        runtime.block_on(requests.next());
        ask();
        runtime.block_on(requests.next());
        std::process::exit(1);
    };
    thread::Builder::new()
        .name("signals".into())
        .spawn(wait)
        .map(drop)
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    fn signal_this_process(one: Signal) {
        rustix::process::kill_process(rustix::process::getpid(), one).unwrap();
    }

    /// This is one test, because a signal is for the whole process. A shell may have started it with SIGHUP ignored.
    #[test]
    fn only_a_client_that_misses_the_deadline_is_ended() {
        for (name, one) in REQUESTS.into_iter().chain(further().next()) {
            let (ended, end) = mpsc::channel();
            let signals = Signals::listen(Box::new(move || ended.send(()).unwrap())).unwrap();
            let before = Instant::now();
            signal_this_process(one);
            assert_eq!(signals.came.blocking_recv(), Ok(()), "{name}");
            end.recv().expect("the last resort");
            assert!(before.elapsed() >= MAX_SHUTDOWN_TIME);
        }
        let (ended, end) = mpsc::channel::<()>();
        let signals = Signals::listen(Box::new(move || ended.send(()).unwrap())).unwrap();
        signal_this_process(Signal::TERM);
        drop(signals);
        assert!(end.recv().is_err(), "an orderly end has no last resort");
    }
}
