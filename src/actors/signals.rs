//! SIGINT and SIGTERM, awaited on a thread that does nothing else, so that they are heard whatever the other threads
//! do.
//!
//! An orderly end answers what waits, and asks every thread to take part. One that is busy with what a client has sent
//! might not in time: then the last resort ends the process all the same.
//!
//! **Invariant:** from a signal on the process lives for [`LAST_RESORT`] at most.

use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use tokio::runtime::Builder;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::oneshot;

/// How long an orderly end may take: all of the second that a signal is given, but for what the log and the process
/// itself need.
pub const LAST_RESORT: Duration = Duration::from_millis(850);

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
        let runtime = Builder::new_current_thread().enable_all().build()?;
        let (mut interrupt, mut terminate) = {
            let _entered = runtime.enter();
            (
                signal(SignalKind::interrupt())?,
                signal(SignalKind::terminate())?,
            )
        };
        let (come, came) = oneshot::channel();
        let (orderly, has_ended) = mpsc::channel::<()>();
        let wait = move || {
            let name = runtime.block_on(async {
                tokio::select! {
                    _ = interrupt.recv() => "SIGINT",
                    _ = terminate.recv() => "SIGTERM",
                }
            });
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
        for name in ["-TERM", "-INT"] {
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
