//! Signals, awaited on a thread that does nothing else, so that they are heard whatever the other threads do.
//!
//! An orderly end answers what waits, and asks every thread to take part. One that is busy with what a client has sent
//! might not in time: then the last resort ends the process all the same.
//!
//! **Invariant:** from a signal on the process lives for [`LAST_RESORT`] at most.

use std::future::poll_fn;
use std::sync::mpsc;
use std::task::Poll;
use std::thread;
use std::time::Duration;

use rustix::process::Signal;
use tokio::runtime::{Builder, Runtime};
use tokio::signal::unix::{Signal as Arrivals, SignalKind, signal};
use tokio::sync::oneshot;

/// How long an orderly end may take: all of the second that a signal is given, but for what the log and the process
/// itself need.
pub const LAST_RESORT: Duration = Duration::from_millis(850);

/// Requests to end. They count even if the program was started with them ignored, as a shell starts jobs in the
/// background.
const REQUESTS: [(&str, Signal); 2] = [("SIGINT", Signal::INT), ("SIGTERM", Signal::TERM)];
/// Further signals that end a process by default. They end the program in order, unless it was started with them
/// ignored, as `nohup` starts a program. SIGABRT is not among them, because it asks for a core dump.
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

/// From now on a write beyond the limit of file sizes (`ulimit -f`) fails like one to a full disk. By default SIGXFSZ
/// kills the process.
///
/// # Errors
/// If the operating system refuses the signal handler.
pub fn survive_file_size_limit() -> std::io::Result<()> {
    let runtime = runtime()?;
    let _entered = runtime.enter();
    // The handler stays for as long as the process lives.
    signal(SignalKind::from_raw(Signal::XFSZ.as_raw())).map(drop)
}

fn runtime() -> std::io::Result<Runtime> {
    Builder::new_current_thread().enable_all().build()
}

/// The signals that the program was started with ignored, a bit for each. Only Linux says.
fn ignored_at_start() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status
        .lines()
        .find_map(|line| line.strip_prefix("SigIgn:"))
        .and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.unwrap_or_default()
}

/// The signals of this process, as long as this value lives.
pub(super) struct Signals {
    /// Comes when a signal does.
    pub(super) came: oneshot::Receiver<()>,
    /// Dropped by an orderly end, which makes the last resort needless.
    _orderly: mpsc::Sender<()>,
}

impl Signals {
    /// From now on signals are heard. `last_resort` is called if the end that one asks for takes too long; it should
    /// not return.
    ///
    /// # Errors
    /// If the operating system refuses a thread or a signal handler.
    pub(super) fn hear(last_resort: Box<dyn FnOnce() + Send>) -> std::io::Result<Self> {
        let runtime = runtime()?;
        let ignored = ignored_at_start();
        let is_heard = |number: i32| ignored & (1 << (number - 1)) == 0;
        let further = FATAL
            .iter()
            .filter(|(_, one)| is_heard(one.as_raw()))
            .copied();
        let mut arrivals: Vec<(&str, Arrivals)> = {
            let _entered = runtime.enter();
            let all = REQUESTS.into_iter().chain(further);
            all.map(|(name, one)| Ok((name, signal(SignalKind::from_raw(one.as_raw()))?)))
                .collect::<std::io::Result<_>>()?
        };
        let (come, came) = oneshot::channel();
        let (orderly, has_ended) = mpsc::channel::<()>();
        let wait = move || {
            let name = runtime.block_on(poll_fn(|cx| {
                let mut all = arrivals.iter_mut();
                let first =
                    all.find_map(|(name, one)| one.poll_recv(cx).is_ready().then_some(*name));
                first.map_or(Poll::Pending, Poll::Ready)
            }));
            // Nobody hears it if the runtime has ended by itself.
            let _ = come.send(());
            tracing::info!("{name}: shutting down");
            if let Err(mpsc::RecvTimeoutError::Timeout) = has_ended.recv_timeout(LAST_RESORT) {
                last_resort();
            }
        };
        thread::Builder::new().name("signals".into()).spawn(wait)?;
        Ok(Self {
            came,
            _orderly: orderly,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::Command;
    use std::time::Instant;

    fn signal_this_process(name: &str) {
        let pid = std::process::id().to_string();
        let status = Command::new("kill").args([name, &pid]).status().unwrap();
        assert!(status.success());
    }

    /// One test, since a signal is for the whole process.
    #[test]
    fn who_does_not_end_in_time_is_ended_and_nobody_else() {
        for name in ["-TERM", "-INT", "-HUP"] {
            let (ended, end) = mpsc::channel();
            let signals = Signals::hear(Box::new(move || ended.send(()).unwrap())).unwrap();
            let before = Instant::now();
            signal_this_process(name);
            assert_eq!(signals.came.blocking_recv(), Ok(()));
            end.recv().expect("the last resort");
            assert!(before.elapsed() >= LAST_RESORT);
        }
        let (ended, end) = mpsc::channel::<()>();
        let signals = Signals::hear(Box::new(move || ended.send(()).unwrap())).unwrap();
        signal_this_process("-TERM");
        drop(signals);
        assert!(end.recv().is_err(), "an orderly end has no last resort");
    }
}
