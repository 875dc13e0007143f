//! Log lines to standard error, without ever waiting for whoever reads it.
//!
//! A parent that never reads the pipe it gave us must not stop the arm once that pipe is full. So a thread of its own
//! writes the lines, a bounded queue feeds it, and what does not fit is dropped and counted.
//!
//! **Invariant:** logging never blocks, a broken standard error never fails anything, and an event is one line,
//! whatever its text.

mod object;
mod warnings;

use std::io::{self, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use tracing::level_filters::LevelFilter;
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::{Context, SubscriberExt};

use self::object::LogObject;
use self::warnings::Warnings;
pub use self::warnings::{Warning, hear_warnings};
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

/// How each line of the log is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LogFormat {
    /// For people.
    #[default]
    Text,
    /// One JSON object, for programs.
    Json,
}

/// The way into the log.
#[derive(Clone)]
pub struct Log {
    format: LogFormat,
    entries: SyncSender<Entry>,
    dropped: Arc<AtomicU64>,
}

/// Logs what `tracing` reports from now on, down to `level`, to standard error.
///
/// # Errors
/// If the thread that writes cannot be started, or a log has been started already.
pub fn start(level: LevelFilter, format: LogFormat) -> io::Result<Log> {
    let log = Log::to(io::stderr(), format)?;
    let lines = log.clone();
    let events = tracing_subscriber::registry();
    match format {
        LogFormat::Text => {
            let printed = tracing_subscriber::fmt::layer().with_writer(move || lines.clone());
            let events = events.with(printed.with_filter(level)).with(Warnings);
            tracing::subscriber::set_global_default(events)
        }
        LogFormat::Json => {
            let events = events
                .with(Objects(lines).with_filter(level))
                .with(Warnings);
            tracing::subscriber::set_global_default(events)
        }
    }
    .map_err(io::Error::other)?;
    Ok(log)
}

/// Puts events into the log as objects.
struct Objects(Log);

impl<S: Subscriber> Layer<S> for Objects {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let metadata = event.metadata();
        let mut object = LogObject::new(*metadata.level(), metadata.target(), LINE_BYTES);
        event.record(&mut object);
        self.0.put(object.line());
    }
}

impl Log {
    fn to(sink: impl Write + Send + 'static, format: LogFormat) -> io::Result<Self> {
        let (entries, queue) = sync_channel(QUEUE_LINES);
        let log = Self {
            format,
            entries,
            dropped: Arc::default(),
        };
        let dropped = Arc::clone(&log.dropped);
        thread::Builder::new()
            .name("log".into())
            .spawn(move || write(&queue, &dropped, format, sink))?;
        Ok(log)
    }

    /// Puts a line into the log, whatever the log's level is: an error.
    pub fn say(&self, line: &str) {
        self.put(own(Level::ERROR, line, self.format));
    }

    /// A line that does not fit is lost, and counted.
    fn put(&self, line: Vec<u8>) {
        if self.entries.try_send(Entry::Line(line)).is_err() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
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
        self.put(plain(line));
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

/// A line of the log's own.
fn own(level: Level, line: &str, format: LogFormat) -> Vec<u8> {
    match format {
        LogFormat::Text => plain(line.as_bytes()),
        LogFormat::Json => {
            let mut object = LogObject::new(level, "pendularm::logging", LINE_BYTES);
            object.member("message", line);
            object.line()
        }
    }
}

/// Writes line after line until the last [`Log`] is gone. An error of the sink has nowhere to be told.
fn write(queue: &Receiver<Entry>, dropped: &AtomicU64, format: LogFormat, mut sink: impl Write) {
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
            let line = format!("{lost} log lines were dropped: nobody read them fast enough");
            let _ = sink.write_all(&own(Level::WARN, &line, format));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::{Receiver, Sender, channel};
    use std::sync::{Condvar, Mutex};

    use super::*;

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
        let mut log = Log::to(gate, LogFormat::Text).unwrap();
        log.write_all(b"first\n").unwrap();
        log.write_all(b"second\n").unwrap();
        log.finish();
        assert_eq!(seen.try_iter().collect::<String>(), "first\nsecond\n");
    }

    #[test]
    fn a_sink_that_takes_nothing_blocks_nobody_and_the_loss_is_reported() {
        let (gate, seen) = Gate::new(false);
        let mut log = Log::to(gate.clone(), LogFormat::Text).unwrap();
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

    #[test]
    fn as_json_lines_of_the_log_itself_are_objects_too() {
        let (gate, seen) = Gate::new(false);
        let log = Log::to(gate.clone(), LogFormat::Json).unwrap();
        for _ in 0..QUEUE_LINES + 10 {
            log.say("a \"line\"\n");
        }
        gate.open();
        drop((log, gate));
        let text: String = seen.iter().collect();
        let objects = text
            .lines()
            .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
        let messages: Vec<String> = objects
            .map(|object| object["message"].as_str().unwrap().to_owned())
            .collect();
        assert_eq!(messages[0], "a \"line\"\n");
        assert!(
            messages
                .iter()
                .any(|one| one.contains("log lines were dropped"))
        );
    }

    /// A client's text may be in an event: neither a line of its own nor a sequence that a terminal obeys comes of it.
    #[test]
    fn an_event_is_one_line_and_nothing_on_it_acts() {
        let hostile =
            "a\r\nERROR forged\u{1b}[2J\u{7}\0\u{202e}\u{2028}\u{9b}31m\u{feff} %s{} \u{e9}";
        let (gate, seen) = Gate::new(true);
        let mut log = Log::to(gate, LogFormat::Text).unwrap();
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
        let mut log = Log::to(gate, LogFormat::Text).unwrap();
        log.write_all(&[b'x'; 3 * LINE_BYTES]).unwrap();
        log.finish();
        assert_eq!(
            seen.try_iter().collect::<String>().len(),
            LINE_BYTES + "...\n".len()
        );
    }
}
