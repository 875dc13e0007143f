//! The path of entries to the file: a bounded queue, and the thread that writes.
//!
//! **Invariant:** no sender waits for the file. A message that does not fit into the queue is dropped, counted
//! and reported. Topics leave half of the queue to inputs. The time of day is read once and continued with a monotonic
//! clock, and no decision depends on it.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};

use super::limits::{FLUSH_PERIOD, MAX_RECORDS, MAX_WAITING_BYTES, MAX_WAITING_ENTRIES};
use super::requests::{NotRecorded, Recorded};
use crate::record::{Content, McapWriter, RecordEntry, RecordError, RunSettings};

/// The extension of a record's file name.
const EXTENSION: &str = "mcap";

/// A clock of the time of day that never runs backwards.
#[derive(Clone, Copy)]
pub(super) struct TapeClock {
    began: Instant,
    since_1970: Duration,
}

impl TapeClock {
    /// A clock that starts at the present time of day.
    pub(super) fn start() -> Self {
        let since_1970 = SystemTime::UNIX_EPOCH.elapsed().unwrap_or_default();
        Self {
            began: Instant::now(),
            since_1970,
        }
    }

    /// Nanoseconds since 1970.
    pub(super) fn now(&self) -> u64 {
        let now = self.since_1970 + self.began.elapsed();
        u64::try_from(now.as_nanos()).unwrap_or(u64::MAX)
    }
}

/// Destination of a record.
pub(super) struct TapeTarget {
    pub(super) path: PathBuf,
    /// Size limit in bytes, with which other records in the folder are also counted; `None` for the operator's own.
    pub(super) limit: Option<u64>,
}

/// The queue of a record. The thread ends when the last clone is dropped.
#[derive(Clone)]
pub(super) struct Tape {
    entries: Sender<Waiting>,
    /// The free bytes of the queue for inputs, and for all other entries.
    for_inputs: Arc<Semaphore>,
    for_topics: Arc<Semaphore>,
    counts: Arc<TapeCounts>,
    clock: TapeClock,
}

type RecordWriter = McapWriter<io::BufWriter<Arc<File>>>;

/// An entry in the queue, with its bytes.
type Waiting = (RecordEntry, OwnedSemaphorePermit);

#[derive(Default)]
struct TapeCounts {
    dropped: AtomicU64,
    is_over: AtomicBool,
}

/// A started record.
pub(super) struct Begun {
    pub(super) tape: Tape,
    /// Receives the result when the file is complete.
    pub(super) end: oneshot::Receiver<Recorded>,
}

/// Starts a record. Its thread sends the answer, and calls `over` there if the record ends before its last tape
/// is dropped.
pub(super) fn begin(
    target: TapeTarget,
    settings: RunSettings,
    over: impl FnOnce() + Send + 'static,
) -> oneshot::Receiver<Result<Begun, NotRecorded>> {
    let (answer, begun) = oneshot::channel();
    let file = file_name(&target.path);
    let spawned = thread::Builder::new()
        .name("recorder".into())
        .spawn(move || {
            let begun = open(&target).and_then(|file| {
                let file = Arc::new(file);
                let writer = McapWriter::new(io::BufWriter::new(Arc::clone(&file)), &settings)
                    .map_err(|why| failure(&target, &why))?;
                Ok((file, writer))
            });
            let (file, writer) = match begun {
                Ok(begun) => begun,
                Err(why) => return drop(answer.send(Err(why))),
            };
            let (tape, queue) = Tape::new();
            let counts = Arc::clone(&tape.counts);
            let (ended, end) = oneshot::channel();
            if answer.send(Ok(Begun { tape, end })).is_err() {
                return;
            }
            let recorded = write(&file, writer, &queue, &counts, &target, over);
            // The program may end without waiting for the file.
            let _ = ended.send(recorded);
        });
    if let Err(error) = spawned {
        tracing::error!(%error, file, "cannot start a thread for the record");
    }
    begun
}

/// The name of the file in answers.
pub(super) fn file_name(path: &Path) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    name.to_string_lossy().into_owned()
}

/// Creates the file, which must not exist, so no record is overwritten.
fn open(target: &TapeTarget) -> Result<File, NotRecorded> {
    let refused = |why: io::Error| failure(target, &why);
    if let (Some(_), Some(folder)) = (target.limit, target.path.parent()) {
        let records = fs::read_dir(folder)
            .map_err(refused)?
            .filter_map(Result::ok)
            .filter(|entry| entry.path().extension().is_some_and(|end| end == EXTENSION));
        if records.take(MAX_RECORDS).count() == MAX_RECORDS {
            return Err(NotRecorded::Full(MAX_RECORDS));
        }
    }
    File::create_new(&target.path).map_err(refused)
}

/// The operator gets the given path. Clients get a name without the folder.
fn failure(target: &TapeTarget, why: &impl ToString) -> NotRecorded {
    let path = &target.path;
    NotRecorded::File {
        file: match target.limit {
            Some(_) => file_name(path),
            None => path.display().to_string(),
        },
        why: why.to_string(),
    }
}

impl Tape {
    /// An empty queue, and its end.
    fn new() -> (Self, Receiver<Waiting>) {
        let (entries, queue) = channel();
        let half = || Arc::new(Semaphore::new(MAX_WAITING_BYTES / 2));
        let tape = Self {
            entries,
            for_inputs: half(),
            for_topics: half(),
            counts: Arc::default(),
            clock: TapeClock::start(),
        };
        (tape, queue)
    }

    /// Records an entry, unless the queue is full. Returns whether it did.
    pub(super) fn put(&self, content: Content) -> bool {
        if self.counts.is_over.load(Ordering::Relaxed) {
            return false;
        }
        // Inputs are few and short, and a replay needs every one.
        let pool = match content {
            Content::Input { .. } => &self.for_inputs,
            _ => &self.for_topics,
        };
        // A short entry counts as more bytes, which bounds the number of entries too.
        let bytes = content
            .allocated()
            .max(MAX_WAITING_BYTES / MAX_WAITING_ENTRIES);
        let bytes = u32::try_from(bytes).unwrap_or(u32::MAX);
        let permit = Arc::clone(pool).try_acquire_many_owned(bytes);
        let entry = RecordEntry {
            log_time: self.clock.now(),
            content,
        };
        let is_put = permit.is_ok_and(|permit| self.entries.send((entry, permit)).is_ok());
        if !is_put {
            self.counts.dropped.fetch_add(1, Ordering::Relaxed);
        }
        is_put
    }

    /// The same. `None` means that an entry was too long and is dropped.
    pub(super) fn put_or_count(&self, content: Option<Content>) -> bool {
        if content.is_none() {
            self.counts.dropped.fetch_add(1, Ordering::Relaxed);
        }
        content.is_some_and(|content| self.put(content))
    }
}

/// Writes entries until the last tape is dropped, the file fails, or the size limit is reached.
fn write(
    file: &File,
    mut writer: RecordWriter,
    queue: &Receiver<Waiting>,
    counts: &TapeCounts,
    target: &TapeTarget,
    over: impl FnOnce(),
) -> Recorded {
    let outcome = take_entries(file, &mut writer, queue, counts, target);
    counts.is_over.store(true, Ordering::Relaxed);
    let messages = writer.messages();
    let finished = outcome.and_then(|is_last| writer.finish().map(|_| is_last));
    let recorded = Recorded {
        file: file_name(&target.path),
        messages,
        bytes: file.metadata().map_or(0, |file| file.len()),
        dropped: counts.dropped.load(Ordering::Relaxed),
    };
    match finished {
        Ok(true) => {}
        Ok(false) => {
            tracing::warn!(
                file = recorded.file,
                bytes = recorded.bytes,
                "the record has reached its size limit and ends"
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

/// Writes waiting entries. Returns `false` if the file has become too long.
fn take_entries(
    file: &File,
    writer: &mut RecordWriter,
    queue: &Receiver<Waiting>,
    counts: &TapeCounts,
    target: &TapeTarget,
) -> Result<bool, RecordError> {
    let mut flush_due = Instant::now() + FLUSH_PERIOD;
    let mut dropped = 0;
    loop {
        let is_last = match queue.recv_timeout(flush_due.saturating_duration_since(Instant::now()))
        {
            Ok((entry, _)) => {
                match writer.write(&entry) {
                    // A frame that cannot be read back does not end the record.
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
            writer.flush()?;
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
        if let Some(limit) = target.limit
            && file.metadata()?.len() >= limit
        {
            return Ok(false);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::catalog::Topic;

    fn message(bytes: usize) -> Content {
        Content::Published {
            topic: Topic::JointTrajectory,
            frame: "x".repeat(bytes).into(),
        }
    }

    fn input() -> Content {
        Content::Input {
            step: 0,
            note: String::new(),
        }
    }

    fn dropped(tape: &Tape) -> u64 {
        tape.counts.dropped.load(Ordering::Relaxed)
    }

    #[test]
    fn topics_leave_half_of_the_queue_to_inputs() {
        let (tape, queue) = Tape::new();
        for _ in 0..MAX_WAITING_ENTRIES / 2 {
            assert!(tape.put(message(1)));
        }
        assert!(!tape.put(message(1)));
        for _ in MAX_WAITING_ENTRIES / 2..MAX_WAITING_ENTRIES {
            assert!(tape.put(input()));
        }
        assert!(!tape.put(input()));
        assert_eq!(dropped(&tape), 2);
        drop(queue.recv().unwrap());
        assert!(tape.put(message(1)));
    }

    #[test]
    fn the_bytes_that_wait_are_bounded() {
        let (tape, _queue) = Tape::new();
        let long = 1024 * 1024;
        let taken = (0..).take_while(|_| tape.put(message(long))).count();
        assert_eq!(
            taken,
            MAX_WAITING_BYTES / 2 / long - 1,
            "each with a little beside its text"
        );
        assert!(tape.put(input()));
        assert_eq!(dropped(&tape), 1);
        assert!(!tape.put_or_count(None));
        assert_eq!(dropped(&tape), 2);
    }

    #[test]
    fn a_record_ends_at_its_limit_and_says_so() {
        let folder = std::env::temp_dir().join(format!("pendularm-tape-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let path = folder.join("short.mcap");
        let _ = fs::remove_file(&path);
        let (tell, heard) = std::sync::mpsc::channel();
        let settings = RunSettings { links: 2, seed: 0 };
        let target = TapeTarget {
            path: path.clone(),
            limit: Some(100_000),
        };
        let begun = begin(target, settings, move || tell.send(()).unwrap());
        let Begun { tape, end } = begun.blocking_recv().unwrap().unwrap();
        while tape.put(input()) {}
        heard.recv().unwrap();
        let recorded = end.blocking_recv().unwrap();
        assert_eq!(recorded.bytes, fs::metadata(&path).unwrap().len());
        assert!(
            recorded.bytes >= 100_000 && recorded.bytes < 200_000,
            "{recorded:?}"
        );
        let mut recording = crate::record::Recording::new(File::open(&path).unwrap());
        let mut read = 0;
        while recording.next_passage().unwrap().is_some() {
            read += 1;
        }
        assert_eq!(read, recorded.messages);
        assert_eq!(recording.ending(), Some(crate::record::RecordEnding::Whole));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_folder_has_a_bounded_number_of_records() {
        let folder = std::env::temp_dir().join(format!("pendularm-tapes-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let target = |name: &str| TapeTarget {
            path: folder.join(name),
            limit: Some(1),
        };
        for number in 1..MAX_RECORDS {
            File::create(folder.join(format!("{number}.mcap"))).unwrap();
        }
        assert!(open(&target("last.mcap")).is_ok());
        let full = open(&target("more.mcap")).err();
        assert_eq!(full, Some(NotRecorded::Full(MAX_RECORDS)));
        let own = TapeTarget {
            limit: None,
            ..target("own.mcap")
        };
        assert!(open(&own).is_ok(), "the operator's own is not counted");
        assert!(open(&own).is_err(), "and overwrites nothing");
        fs::remove_dir_all(&folder).unwrap();
    }
}
