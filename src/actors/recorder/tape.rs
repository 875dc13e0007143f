//! The way of entries to the file: a bounded queue, and the thread that writes.
//!
//! **Invariant:** nobody waits for the file; what does not fit into the queue is dropped, counted and told, an input
//! last of all.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use tokio::sync::oneshot;

use super::messages::{NotRecorded, Recorded};
use super::{FLUSH_PERIOD, MAX_FILES, MAX_WAITING_BYTES, MAX_WAITING_ENTRIES};
use crate::record::{Content, Entry, RecordError, Scribe, Settings};

/// The end of a record's file name.
const EXTENSION: &str = "mcap";

/// Where a record goes.
pub(super) struct Target {
    pub(super) path: PathBuf,
    /// Bytes after which it ends by itself, and other records beside it are counted; none for the operator's own.
    pub(super) limit: Option<u64>,
}

/// The way into a record that is being written. The thread ends with the last of them.
#[derive(Clone)]
pub(super) struct Tape {
    entries: SyncSender<Entry>,
    counts: Arc<Counts>,
    clock: Clock,
}

/// A clock that tells the time of day and never runs backwards.
#[derive(Clone, Copy)]
struct Clock {
    began: Instant,
    since_1970: Duration,
}

#[derive(Default)]
struct Counts {
    entries: AtomicUsize,
    bytes: AtomicUsize,
    dropped: AtomicU64,
    is_over: AtomicBool,
}

/// A record that has begun.
pub(super) struct Begun {
    pub(super) tape: Tape,
    /// Comes when the file is whole.
    pub(super) end: oneshot::Receiver<Recorded>,
}

/// Begins a record; the answer comes from its thread. `over` is called there when it ends before its last tape.
pub(super) fn begin(
    target: Target,
    settings: Settings,
    over: impl FnOnce() + Send + 'static,
) -> oneshot::Receiver<Result<Begun, NotRecorded>> {
    let (answer, begun) = oneshot::channel();
    let file = file_name(&target.path);
    let spawned = thread::Builder::new()
        .name("recorder".into())
        .spawn(move || {
            let scribe = open(&target).and_then(|file| {
                Scribe::new(io::BufWriter::new(file), &settings)
                    .map_err(|why| failure(&target.path, &why))
            });
            let scribe = match scribe {
                Ok(scribe) => scribe,
                Err(why) => return drop(answer.send(Err(why))),
            };
            let (entries, queue) = sync_channel(MAX_WAITING_ENTRIES);
            let counts = Arc::<Counts>::default();
            let tape = Tape {
                entries,
                counts: Arc::clone(&counts),
                clock: Clock::start(),
            };
            let (ended, end) = oneshot::channel();
            if answer.send(Ok(Begun { tape, end })).is_err() {
                return;
            }
            let recorded = write(scribe, &queue, &counts, &target, over);
            // The program may be ending without waiting for the file.
            let _ = ended.send(recorded);
        });
    if let Err(error) = spawned {
        tracing::error!(%error, file, "no thread to record with");
    }
    begun
}

/// The name of the file, as it is told.
pub(super) fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Makes the file, which must not be there: no record is ever overwritten.
fn open(target: &Target) -> Result<File, NotRecorded> {
    let refused = |why: io::Error| failure(&target.path, &why);
    if let (Some(_), Some(folder)) = (target.limit, target.path.parent()) {
        let records = fs::read_dir(folder)
            .map_err(refused)?
            .filter_map(Result::ok)
            .filter(|entry| entry.path().extension().is_some_and(|end| end == EXTENSION));
        if records.take(MAX_FILES).count() == MAX_FILES {
            return Err(NotRecorded::Full(MAX_FILES));
        }
    }
    File::create_new(&target.path).map_err(refused)
}

fn failure(path: &Path, why: &impl ToString) -> NotRecorded {
    NotRecorded::File {
        file: file_name(path),
        why: why.to_string(),
    }
}

impl Tape {
    /// Records something, unless there is no room; whether it did.
    pub(super) fn put(&self, content: Content) -> bool {
        if self.counts.is_over.load(Ordering::Relaxed) {
            return false;
        }
        let bytes = content.allocated();
        // Inputs are few and short, and without one of them the rest can't be repeated.
        let share = if matches!(content, Content::Input { .. }) {
            1
        } else {
            2
        };
        let entries_before = self.counts.entries.fetch_add(1, Ordering::Relaxed);
        let bytes_before = self.counts.bytes.fetch_add(bytes, Ordering::Relaxed);
        let fits = entries_before < MAX_WAITING_ENTRIES / share
            && bytes_before.saturating_add(bytes) <= MAX_WAITING_BYTES / share;
        let entry = Entry {
            log_time: self.clock.now(),
            content,
        };
        if fits && self.entries.try_send(entry).is_ok() {
            return true;
        }
        self.counts.written(bytes);
        self.counts.dropped.fetch_add(1, Ordering::Relaxed);
        false
    }

    /// Counts something that is too long to be recorded.
    pub(super) fn leave_out(&self) {
        self.counts.dropped.fetch_add(1, Ordering::Relaxed);
    }
}

impl Clock {
    fn start() -> Self {
        let since_1970 = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
        Self {
            began: Instant::now(),
            since_1970,
        }
    }

    /// Nanoseconds since 1970.
    fn now(&self) -> u64 {
        let now = self.since_1970 + self.began.elapsed();
        u64::try_from(now.as_nanos()).unwrap_or(u64::MAX)
    }
}

impl Counts {
    /// An entry waits no more.
    fn written(&self, bytes: usize) {
        self.entries.fetch_sub(1, Ordering::Relaxed);
        self.bytes.fetch_sub(bytes, Ordering::Relaxed);
    }
}

/// Writes entry after entry until the last tape is gone, the file takes no more, or it is long enough.
fn write(
    mut scribe: Scribe<io::BufWriter<File>>,
    queue: &Receiver<Entry>,
    counts: &Counts,
    target: &Target,
    over: impl FnOnce(),
) -> Recorded {
    let file = file_name(&target.path);
    let outcome = take_entries(&mut scribe, queue, counts, target);
    counts.is_over.store(true, Ordering::Relaxed);
    let recorded = Recorded {
        messages: scribe.messages(),
        bytes: scribe.bytes(),
        dropped: counts.dropped.load(Ordering::Relaxed),
        file,
    };
    let finished = outcome.and_then(|is_last| scribe.finish().map(|_| is_last));
    match finished {
        Ok(true) => {}
        Ok(false) => {
            tracing::warn!(
                file = recorded.file,
                bytes = recorded.bytes,
                "the record is as long as it may be, and ends"
            );
            over();
        }
        Err(error) => {
            tracing::error!(%error, file = recorded.file, "the record ends");
            over();
        }
    }
    recorded
}

/// Whether that was all there was; false if the file has become too long.
fn take_entries(
    scribe: &mut Scribe<io::BufWriter<File>>,
    queue: &Receiver<Entry>,
    counts: &Counts,
    target: &Target,
) -> Result<bool, RecordError> {
    let mut flush_due = Instant::now() + FLUSH_PERIOD;
    let mut dropped = 0;
    loop {
        let is_last = match queue.recv_timeout(flush_due.saturating_duration_since(Instant::now()))
        {
            Ok(entry) => {
                counts.written(entry.content.allocated());
                match scribe.write(&entry) {
                    // A frame that can't be read back is one of ours gone wrong, and no reason to end.
                    Err(error @ RecordError::Frame(_)) => {
                        tracing::warn!(%error, "a message is not recorded");
                    }
                    outcome => outcome?,
                }
                false
            }
            Err(RecvTimeoutError::Timeout) => false,
            Err(RecvTimeoutError::Disconnected) => true,
        };
        if is_last || Instant::now() >= flush_due {
            scribe.flush()?;
            flush_due = Instant::now() + FLUSH_PERIOD;
            let so_far = counts.dropped.load(Ordering::Relaxed);
            if so_far > dropped {
                let file = file_name(&target.path);
                tracing::warn!(
                    dropped = so_far - dropped,
                    file,
                    "the record has gaps: the file is slow"
                );
                dropped = so_far;
            }
        }
        if is_last {
            return Ok(true);
        }
        if target.limit.is_some_and(|limit| scribe.bytes() >= limit) {
            return Ok(false);
        }
    }
}
