//! Log lines on standard error, written by a separate thread.
//!
//! A full stderr pipe must not block the arm. So a bounded queue feeds the thread, and lines that do not fit are
//! dropped and counted.
//!
//! **Invariant:** logging never blocks, a broken standard error causes no failure, and every event is one
//! line.

pub mod repeats;

use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::{Map, Value, json};
use tokio::sync::mpsc::Sender;
use tracing::level_filters::LevelFilter;
use tracing::{Event, Level, Metadata, Subscriber};
use tracing_subscriber::fmt::{self, format::Writer, time::FormatTime, time::SystemTime};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};

use self::repeats::{PERIOD, Repeated, Repeats};
use crate::protocol::wire::text::escape;

/// Most lines in the queue: more than a burst of connections logs at the default level.
pub const QUEUE_LINES: usize = 1024;

/// Longest line \[bytes\]. With [`QUEUE_LINES`] it bounds the memory of the queue to 4 MiB.
pub const LINE_BYTES: usize = 4096;

/// The target of the log's own lines.
const OWN_TARGET: &str = "pendularm::logging";

/// Longest time that the end of the program waits for the last lines.
const FINISH: Duration = Duration::from_millis(100);

enum Entry {
    Line(Vec<u8>),
    /// A request that is answered after all earlier lines have been written.
    Written(SyncSender<()>),
}

/// A warning or an error: its origin and its text.
pub type Warning = (&'static Metadata<'static>, String);

static LISTENER: Mutex<Option<Sender<Warning>>> = Mutex::new(None);

/// Also sends warnings and errors to `listener` from now on, at every level of the log. `None` ends that. If the
/// channel is full, the warning is dropped.
pub fn listen_for_warnings(listener: Option<Sender<Warning>>) {
    *LISTENER.lock().unwrap_or_else(PoisonError::into_inner) = listener;
}

fn pass_on(metadata: &'static Metadata<'static>, text: String) {
    let listener = LISTENER.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(listener) = &*listener
        && *metadata.level() <= Level::WARN
    {
        let _ = listener.try_send((metadata, text));
    }
}

/// The format of log lines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LogFormat {
    /// For people.
    #[default]
    Text,
    /// One JSON object, for programs.
    Json,
}

/// The queue of the log.
#[derive(Clone)]
pub struct Log {
    level: LevelFilter,
    format: LogFormat,
    repeats: Arc<Repeats>,
    entries: SyncSender<Entry>,
    dropped: Arc<AtomicU64>,
}

/// Logs events of `tracing` from now on, down to `level`, to standard error.
///
/// # Errors
/// If the writing thread cannot be started, or a log has been started already.
pub fn start(level: LevelFilter, format: LogFormat) -> io::Result<Log> {
    let (entries, queue) = sync_channel(QUEUE_LINES);
    let log = Log {
        level,
        format,
        repeats: Arc::default(),
        entries,
        dropped: Arc::default(),
    };
    let (writer, lines) = (log.clone(), log.clone());
    thread::Builder::new()
        .name("log".into())
        .spawn(move || writer.write_lines(&queue, io::stderr()))?;
    let printed = fmt::layer().with_writer(move || lines.clone());
    let printed = match format {
        LogFormat::Text => printed.boxed(),
        LogFormat::Json => printed.json().flatten_event(true).boxed(),
    };
    let subscriber = tracing_subscriber::registry().with(printed);
    let subscriber = subscriber.with(log.clone());
    tracing::subscriber::set_global_default(subscriber).map_err(io::Error::other)?;
    Ok(log)
}

/// Decides which events are printed. Passes warnings to their listener, at every level of the log.
impl<S: Subscriber> Layer<S> for Log {
    fn max_level_hint(&self) -> Option<LevelFilter> {
        Some(self.level.max(LevelFilter::WARN))
    }

    fn event_enabled(&self, event: &Event<'_>, _: Context<'_, S>) -> bool {
        let metadata = event.metadata();
        let is_logged = *metadata.level() <= self.level;
        if *metadata.level() > Level::INFO {
            return is_logged;
        }
        let Some(repeated) = self.repeats.count(event, Instant::now()) else {
            return false;
        };
        if repeated.events == 1 {
            pass_on(metadata, repeated.text);
            return is_logged;
        }
        if let Some(line) = self.report(repeated) {
            self.put(line);
        }
        false
    }
}

impl Log {
    /// Logs a line as an error, at every level of the log.
    pub fn say(&self, line: &str) {
        self.put(self.own(Level::ERROR, OWN_TARGET, line));
    }

    /// Waits until all earlier lines are written, for a bounded time.
    pub fn finish(&self) {
        let (written, all) = sync_channel(1);
        if self.entries.try_send(Entry::Written(written)).is_ok() {
            // A reader that is too slow misses the last lines.
            let _ = all.recv_timeout(FINISH);
        }
    }

    /// A line that does not fit is dropped and counted.
    fn put(&self, line: Vec<u8>) {
        if self.entries.try_send(Entry::Line(line)).is_err() {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    /// Passes repeated events to the listener. Returns their line, if the log's level includes it.
    fn report(&self, repeated: Repeated) -> Option<Vec<u8>> {
        let (metadata, events, text) = (repeated.metadata, repeated.events, repeated.text);
        let text = match events {
            1 => text,
            _ => format!("{text} (first of {events} within a second)"),
        };
        let is_logged = *metadata.level() <= self.level;
        let line = is_logged.then(|| self.own(*metadata.level(), metadata.target(), &text));
        pass_on(metadata, text);
        line
    }

    /// A line that does not come from `tracing`, in the same format.
    fn own(&self, level: Level, target: &str, text: &str) -> Vec<u8> {
        let mut time = String::new();
        // The format fails only for a year out of range. The line then has no time.
        let _ = SystemTime.format_time(&mut Writer::new(&mut time));
        let level = level.as_str();
        self.kept(&match self.format {
            LogFormat::Text => format!("{time} {level:>5} {target}: {text}"),
            LogFormat::Json => {
                json!({"timestamp": time, "level": level, "message": text, "target": target})
                    .to_string()
            }
        })
    }

    /// Bounds the length of a line, and escapes control characters. The line may contain a client's text, which must
    /// not form a line by itself.
    fn kept(&self, line: &str) -> Vec<u8> {
        let mut kept = escape(line.strip_suffix('\n').unwrap_or(line));
        // Space for the mark, and for a character at the cut.
        let mut most = LINE_BYTES - 8;
        while kept.len() > LINE_BYTES && most > 0 {
            kept = match self.format {
                LogFormat::Text => cut(&kept, most),
                LogFormat::Json => escape(&cut_members(&kept, most)),
            };
            most /= 2;
        }
        kept.push('\n');
        kept.into_bytes()
    }

    /// Writes all lines. Errors of standard error cannot be reported.
    fn write_lines(&self, queue: &Receiver<Entry>, mut sink: impl Write) {
        loop {
            let (mut early, mut asked) = (Duration::ZERO, None);
            match queue.recv_timeout(PERIOD) {
                Ok(Entry::Line(line)) => {
                    let _ = sink.write_all(&line);
                }
                Ok(Entry::Written(written)) => (early, asked) = (PERIOD, Some(written)),
                // The log itself holds a sender, so this means an empty queue.
                Err(_) => {}
            }
            for repeated in self.repeats.due(Instant::now() + early) {
                let line = self.report(repeated).unwrap_or_default();
                let _ = sink.write_all(&line);
            }
            let lost = self.dropped.swap(0, Ordering::Relaxed);
            if lost > 0 {
                let text = format!("{lost} log lines were dropped: the reader is too slow");
                let _ = sink.write_all(&self.own(Level::WARN, OWN_TARGET, &text));
            }
            let _ = asked.map(|written| written.try_send(()));
        }
    }
}

/// Gets one line per call, because `tracing-subscriber` formats an event and then writes it whole.
impl Write for Log {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        self.put(self.kept(&String::from_utf8_lossy(line)));
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The first `most` bytes of a text, and a mark that it was cut.
fn cut(text: &str, most: usize) -> String {
    let kept = text.as_bytes().get(..most).unwrap_or(text.as_bytes());
    String::from_utf8_lossy(kept).into_owned() + "..."
}

fn cut_members(object: &str, most: usize) -> String {
    let mut members: Map<String, Value> = serde_json::from_str(object).unwrap_or_default();
    for member in members.values_mut() {
        if let Value::String(text) = member
            && text.len() > most
        {
            *text = cut(text, most);
        }
    }
    Value::Object(members).to_string()
}
