//! Log lines to standard error, without ever waiting for whoever reads it.
//!
//! A parent that never reads the pipe it gave us must not stop the arm once that pipe is full. So a thread of its own
//! writes the lines, a bounded queue feeds it, and what does not fit is dropped and counted.
//!
//! **Invariant:** logging never blocks, a broken standard error never fails anything, and an event is one line,
//! whatever its text.

use std::fmt::{self, Write as _};
use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use tokio::sync::mpsc::Sender;
use tracing::field::{Field, Visit};
use tracing::level_filters::LevelFilter;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::{Context, SubscriberExt};

use crate::protocol::wire::text::push_plain;

/// Lines that may wait for the writer: more than any burst of connections logs at the default level.
const QUEUE_LINES: usize = 1024;

/// Longest line that is kept \[bytes\]: with [`QUEUE_LINES`] it bounds what a reader that stalls can cost to 4 MiB.
const LINE_BYTES: usize = 4096;

/// How long the end of the program waits for the last lines to be written.
const FINISH: Duration = Duration::from_millis(100);

enum Entry {
    Line(Vec<u8>),
    /// Answered once every line before it is written.
    Written(SyncSender<()>),
}

/// The way into the log.
#[derive(Clone)]
pub struct Log {
    entries: SyncSender<Entry>,
    dropped: Arc<AtomicU64>,
}

/// Logs what `tracing` reports from now on, down to `level`, to standard error.
///
/// # Errors
/// If the thread that writes cannot be started, or a log has been started already.
pub fn start(level: LevelFilter) -> io::Result<Log> {
    let log = Log::to(io::stderr())?;
    let lines = log.clone();
    let printed = tracing_subscriber::fmt::layer()
        .with_writer(move || lines.clone())
        .with_filter(level);
    let subscriber = tracing_subscriber::registry().with(printed).with(Warnings);
    tracing::subscriber::set_global_default(subscriber).map_err(io::Error::other)?;
    Ok(log)
}

/// A warning or an error, for whoever listens in the program itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Warning {
    /// As ROS has it: 30 is a warning, 40 an error.
    pub level: u8,
    /// The node that it comes from.
    pub node: &'static str,
    /// The event, in words.
    pub text: String,
    /// The source file.
    pub file: &'static str,
    /// The line in it.
    pub line: u32,
}

/// Who listens to warnings.
static LISTENER: Mutex<Option<Sender<Warning>>> = Mutex::new(None);

/// Warnings and errors go to `listener` too from now on, whatever the log's level; `None`: to nobody. What does not fit
/// into the channel is not waited for.
pub fn hear_warnings(listener: Option<Sender<Warning>>) {
    *LISTENER.lock().unwrap_or_else(PoisonError::into_inner) = listener;
}

/// Hands warnings to the listener.
struct Warnings;

impl<S: Subscriber> Layer<S> for Warnings {
    fn max_level_hint(&self) -> Option<LevelFilter> {
        Some(LevelFilter::WARN)
    }

    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let metadata = event.metadata();
        let level = match *metadata.level() {
            Level::ERROR => 40,
            Level::WARN => 30,
            _ => return,
        };
        let listener = LISTENER.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(listener) = &*listener {
            let mut text = Text::default();
            event.record(&mut text);
            let _ = listener.try_send(Warning {
                level,
                node: node_of(metadata.target()),
                text: text.0,
                file: metadata.file().unwrap_or_default(),
                line: metadata.line().unwrap_or_default(),
            });
        }
    }
}

/// The actor in whose module something was reported: `registry` of `pendularm::actors::gateway::registry::ops`.
fn node_of(target: &'static str) -> &'static str {
    let modules = target.split("::").skip_while(|part| *part != "actors");
    let modules: Vec<&'static str> = modules.skip(1).take(2).collect();
    match modules[..] {
        ["arm", "sim"] => "arm_sim",
        // Folders, in which the actors stand.
        ["arm" | "compute" | "gateway" | "resources" | "ros", actor] | [actor, ..] => actor,
        [] => "pendularm",
    }
}

/// An event as one line: the message, then the fields.
#[derive(Default)]
struct Text(String);

impl Visit for Text {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        // A `String` takes whatever is written to it.
        let _ = if field.name() == "message" {
            let fields = std::mem::take(&mut self.0);
            write!(self.0, "{value:?}{fields}")
        } else {
            write!(self.0, " {}={value:?}", field.name())
        };
    }
}

impl Log {
    fn to(sink: impl Write + Send + 'static) -> io::Result<Self> {
        let (entries, queue) = sync_channel(QUEUE_LINES);
        let log = Self {
            entries,
            dropped: Arc::default(),
        };
        let dropped = Arc::clone(&log.dropped);
        thread::Builder::new()
            .name("log".into())
            .spawn(move || write(&queue, &dropped, sink))?;
        Ok(log)
    }

    /// Puts a line into the log, whatever its level is.
    pub fn say(&self, line: &str) {
        let line = format!("{line}\n");
        // A line that does not fit is lost, as any line.
        let _ = self.clone().write_all(line.as_bytes());
    }

    /// Waits until what was logged so far is written, for a moment at most.
    pub fn finish(&self) {
        let (written, all) = sync_channel(1);
        if self.entries.try_send(Entry::Written(written)).is_ok() {
            // Nobody is left to be told that the last lines were not read in time.
            let _ = all.recv_timeout(FINISH);
        }
    }
}

/// Takes one line at a time: `tracing-subscriber` formats an event first, then writes it whole.
impl Write for Log {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        if self.entries.try_send(Entry::Line(plain(line))).is_err() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The text that is kept of an event: one line, of bounded length, on which nothing acts on a terminal. It may repeat
/// what a client has sent, and a client must not be able to write lines of its own.
fn plain(line: &[u8]) -> Vec<u8> {
    let text = String::from_utf8_lossy(line);
    let text = text.strip_suffix('\n').unwrap_or(&text);
    let mut kept = String::with_capacity(text.len().min(LINE_BYTES) + 1);
    for character in text.chars() {
        if kept.len() >= LINE_BYTES {
            kept.push_str("...");
            break;
        }
        push_plain(&mut kept, character);
    }
    kept.push('\n');
    kept.into_bytes()
}

/// Writes line after line until the last [`Log`] is gone. An error of the sink has nowhere to be told.
fn write(queue: &Receiver<Entry>, dropped: &AtomicU64, mut sink: impl Write) {
    for entry in queue {
        match entry {
            Entry::Line(line) => {
                let _ = sink.write_all(&line);
            }
            Entry::Written(done) => {
                let _ = sink.flush();
                let _ = done.try_send(());
            }
        }
        let lost = dropped.swap(0, Ordering::Relaxed);
        if lost > 0 {
            let _ = writeln!(
                sink,
                "{lost} log lines were dropped: nobody read them fast enough"
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, Sender, channel};
    use std::sync::{Condvar, Mutex};

    use super::*;

    #[test]
    fn a_warning_names_the_actor_and_not_the_folder_in_which_it_stands() {
        for (target, node) in [
            ("pendularm::actors::arm::sim::telemetry", "arm_sim"),
            ("pendularm::actors::arm::ik_action", "ik_action"),
            ("pendularm::actors::gateway::registry::ops", "registry"),
            ("pendularm::actors::gateway::connection", "connection"),
            ("pendularm::actors::compute::workers", "workers"),
            ("pendularm::actors::runtime", "runtime"),
            ("pendularm::logging", "pendularm"),
        ] {
            assert_eq!(node_of(target), node, "{target}");
        }
    }

    /// A sink that can be held shut, and tells each write.
    #[derive(Clone)]
    struct Gate {
        open: Arc<(Mutex<bool>, Condvar)>,
        writes: Sender<String>,
    }

    impl Gate {
        fn new(open: bool) -> (Self, Receiver<String>) {
            let (writes, seen) = channel();
            (
                Self {
                    open: Arc::new((Mutex::new(open), Condvar::new())),
                    writes,
                },
                seen,
            )
        }

        fn open(&self) {
            *self.open.0.lock().unwrap() = true;
            self.open.1.notify_all();
        }
    }

    impl Write for Gate {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let _open = self
                .open
                .1
                .wait_while(self.open.0.lock().unwrap(), |open| !*open)
                .unwrap();
            let _ = self
                .writes
                .send(String::from_utf8_lossy(bytes).into_owned());
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn finishing_waits_for_what_was_logged() {
        let (gate, seen) = Gate::new(true);
        let mut log = Log::to(gate).unwrap();
        log.write_all(b"first\n").unwrap();
        log.write_all(b"second\n").unwrap();
        log.finish();
        assert_eq!(seen.try_iter().collect::<String>(), "first\nsecond\n");
    }

    #[test]
    fn a_sink_that_takes_nothing_blocks_nobody_and_the_loss_is_reported() {
        let (gate, seen) = Gate::new(false);
        let mut log = Log::to(gate.clone()).unwrap();
        // The writer holds one line at the gate, or none yet; the queue holds the rest.
        for _ in 0..QUEUE_LINES + 10 {
            log.write_all(b"line\n").unwrap();
        }
        gate.open();
        drop((log, gate));
        let text: String = seen.iter().collect();
        let reported = text
            .lines()
            .filter_map(|line| line.split_once(" log lines were"));
        let lost: usize = reported
            .map(|(count, _)| count.parse::<usize>().unwrap())
            .sum();
        assert!((9..=10).contains(&lost), "lost {lost}");
        assert_eq!(
            text.lines().filter(|line| *line == "line").count(),
            QUEUE_LINES + 10 - lost
        );
    }

    /// A client's text may be in an event: neither a line of its own nor a sequence that a terminal obeys comes of it.
    #[test]
    fn an_event_is_one_line_and_nothing_on_it_acts() {
        let hostile =
            "a\r\nERROR forged\u{1b}[2J\u{7}\0\u{202e}\u{2028}\u{9b}31m\u{feff} %s{} \u{e9}";
        let (gate, seen) = Gate::new(true);
        let mut log = Log::to(gate).unwrap();
        log.write_all(format!("{hostile}\n").as_bytes()).unwrap();
        log.write_all(b"not UTF-8: \xff\xfe\n").unwrap();
        log.finish();
        let written: String = seen.try_iter().collect();
        assert_eq!(
            written,
            "a\\r\\nERROR forged\\u{1b}[2J\\u{7}\\u{0}\\u{202e}\\u{2028}\\u{9b}31m\\u{feff} %s{} \u{e9}\n\
             not UTF-8: \u{fffd}\u{fffd}\n"
        );
    }

    /// Six bytes for one, all of them: what is kept is bounded, not what is read.
    #[test]
    fn escapes_count_towards_the_limit() {
        let line = plain(&vec![0x1b; 3 * LINE_BYTES]);
        assert!(line.len() < LINE_BYTES + 16, "{}", line.len());
        assert!(line.ends_with(b"...\n"));
    }

    #[test]
    fn a_line_is_cut_at_its_limit() {
        let (gate, seen) = Gate::new(true);
        let mut log = Log::to(gate).unwrap();
        log.write_all(&[b'x'; 3 * LINE_BYTES]).unwrap();
        log.finish();
        assert_eq!(
            seen.try_iter().collect::<String>().len(),
            LINE_BYTES + "...\n".len()
        );
    }
}
