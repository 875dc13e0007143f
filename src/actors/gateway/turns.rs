//! Turns: where many have much to do at once, a few of them go on each time around.
//!
//! One thread serves every client, and a light call passes it some eight times on its way. If two hundred busy clients,
//! or a thousand subscribers of a message, all went on every time around, the call would wait for all of them eight
//! times. So a reader waits in one queue if it has a whole chunk or many frames at hand, if its message has gone to
//! many, or once much has been read of late. A writer waits in another once much has been written of late. A writer
//! whose messages all come from nodes has a third queue: the arm publishes on, and its subscribers do not wait behind
//! what others have sent to hundreds.
//!
//! **Invariant:** between two looks at what else there is to do, each queue lets only so many go on, first come, first
//! served, and no writer goes on once those before it have taken [`WRITING_TIME`].

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::{Rc, Weak};
use std::thread::LocalKey;
use std::time::Duration;

use tokio::sync::oneshot;

use super::limits::WRITE_BYTES;
use crate::actors::resources::work_clock;

/// Readers that go on each time around. A chunk, or an op of the gateway's own, takes a fraction of a millisecond:
/// together they take about one.
const READERS_AT_A_TIME: usize = 4;
/// Bytes of chunks per pass with which no reader waits, about 0.5 ms.
const FREE_READS: usize = WRITE_BYTES;
/// Writers that go on each time around, which takes a tenth of a millisecond. Fewer go on if together they have
/// [`WRITE_BYTES`] to write. With twice as many, and twice [`FREE_WRITES`], a light call beside 1,000 subscribers took
/// up to a millisecond longer.
const WRITERS_AT_A_TIME: usize = 16;
/// Writes per pass that never queue, about 0.5 ms; a long write counts several times. A hundred subscribers of a
/// message wait in no queue: it costs a tenth of what writing to them does.
const FREE_WRITES: usize = 128;
/// Every so many bytes of a message count as another write.
const LONG: usize = 4096;
/// The time that writers have each time around: three times what [`WRITERS_AT_A_TIME`] take as a rule. Where the system
/// has to find memory for what clients do not read, a write of fifty bytes was seen to take 340 µs.
const WRITING_TIME: Duration = Duration::from_micros(300);

/// Bytes that a delivery counts as: some five hundred of them take half a millisecond.
const DELIVERY: usize = WRITE_BYTES / 512;

/// A reader or a writer that waits in a queue.
trait Waits: 'static {
    /// Tells it that its turn has come; false if it no longer waits.
    fn go_on(self) -> bool;
}

/// A reader is a task, which is woken.
impl Waits for oneshot::Sender<()> {
    fn go_on(self) -> bool {
        self.send(()).is_ok()
    }
}

/// A writer writes where the queue is worked through. To wake its actor instead would have it look at its mailbox and
/// at all that it waits for, a thousand times for a message to a thousand subscribers.
pub(super) trait WritesInTurn {
    /// Writes what there is to write, without waiting.
    fn write_in_turn(&self);
}

/// A writer that waits.
type WaitingWriter = Weak<dyn WritesInTurn>;

impl Waits for WaitingWriter {
    fn go_on(self) -> bool {
        let writer = self.upgrade();
        if let Some(writer) = &writer {
            writer.write_in_turn();
        }
        writer.is_some()
    }
}

/// A queue of this thread.
struct TurnQueue<W> {
    at_a_time: usize,
    /// The allowance of a pass, and how much of it is left: bytes for readers, writes for writers.
    free: usize,
    left: Cell<usize>,
    /// The queue, each waiter with the bytes that it is going to read or write.
    waiting: RefCell<VecDeque<(usize, W)>>,
    /// Whether there is a task at work.
    at_work: Cell<bool>,
}

thread_local! {
    static READERS: Rc<TurnQueue<oneshot::Sender<()>>> = Rc::new(TurnQueue::new(READERS_AT_A_TIME, FREE_READS));
    static PACED: Rc<TurnQueue<WaitingWriter>> = Rc::new(TurnQueue::new(WRITERS_AT_A_TIME, FREE_WRITES));
    static UNPACED: Rc<TurnQueue<WaitingWriter>> = Rc::new(TurnQueue::new(WRITERS_AT_A_TIME, FREE_WRITES));
}

/// Waits until it is this reader's turn.
pub(super) async fn read() {
    read_bytes(0).await;
}

/// Waits as [`read`] does; the reader's last message went to so many subscribers, and its next may too.
pub(super) async fn read_after(deliveries: usize) {
    read_bytes(deliveries * DELIVERY).await;
}

/// Whether a reader may go on at once with so many bytes, light ones always; otherwise it has to wait its turn.
pub(super) fn may_read(bytes: usize) -> bool {
    bytes < LONG || READERS.with(|queue| queue.take(bytes))
}

/// Waits as [`read`] does, before a read that may complete a message of `bytes`, which is then scanned whole.
pub(super) async fn read_bytes(bytes: usize) {
    let (go, goes) = oneshot::channel();
    READERS.with(|queue| queue.join(bytes, go));
    // A task ends early only with the runtime that it runs in.
    let _ = goes.await;
}

/// A queue in which writers wait.
#[derive(Debug, Clone, Copy)]
pub(super) enum WritersQueue {
    /// For messages whose publisher waits for delivery, and for encoded messages.
    Paced,
    /// For messages of nodes, which publish on.
    Unpaced,
}

impl WritersQueue {
    /// Whether a client may be written so many bytes at once; otherwise its writer has to [`join`](Self::join).
    pub(super) fn may_write(self, bytes: usize) -> bool {
        self.queue().with(|queue| queue.take(1 + bytes / LONG))
    }

    /// Puts a writer, which has so many bytes to write, at the end of the queue.
    pub(super) fn join(self, bytes: usize, writer: WaitingWriter) {
        self.queue().with(|queue| queue.join(bytes, writer));
    }

    const fn queue(self) -> &'static LocalKey<Rc<TurnQueue<WaitingWriter>>> {
        match self {
            Self::Paced => &PACED,
            Self::Unpaced => &UNPACED,
        }
    }
}

impl<W: Waits> TurnQueue<W> {
    const fn new(at_a_time: usize, free: usize) -> Self {
        Self {
            at_a_time,
            free,
            left: Cell::new(free),
            waiting: RefCell::new(VecDeque::new()),
            at_work: Cell::new(false),
        }
    }

    /// Takes `cost` of what is free. If there is less, it takes all of it and returns false.
    fn take(self: &Rc<Self>, cost: usize) -> bool {
        let left = self.left.get().checked_sub(cost);
        self.left.set(left.unwrap_or(0));
        self.work();
        left.is_some()
    }

    /// Starts the task that works through the queue, and then makes free again what has been taken.
    fn work(self: &Rc<Self>) {
        if !self.at_work.replace(true) {
            actix_rt::spawn(TurnQueueTask(Rc::clone(self)).run());
        }
    }

    fn join(self: &Rc<Self>, bytes: usize, waiting: W) {
        self.waiting.borrow_mut().push_back((bytes, waiting));
        self.work();
    }
}

/// The task that works through a queue. If it ends early, with the runtime that it runs in, no reader waits in vain.
struct TurnQueueTask<W: Waits>(Rc<TurnQueue<W>>);

impl<W: Waits> Drop for TurnQueueTask<W> {
    fn drop(&mut self) {
        self.0.at_work.set(false);
        self.0.left.set(self.0.free);
        self.0.waiting.take();
    }
}

impl<W: Waits> TurnQueueTask<W> {
    async fn run(self) {
        let queue = &self.0;
        loop {
            let (mut going, mut bytes) = (0, 0);
            let began = work_clock::now();
            let is_late = || work_clock::now().saturating_duration_since(began) >= WRITING_TIME;
            while going < queue.at_a_time && bytes < WRITE_BYTES && (going == 0 || !is_late()) {
                let Some((wanted, next)) = queue.waiting.borrow_mut().pop_front() else {
                    break;
                };
                // A waiter that has ended meanwhile takes no turn.
                if next.go_on() {
                    going += 1;
                    bytes += wanted;
                }
            }
            if going == 0 {
                return;
            }
            // A writer that joins again at once goes on the next time around.
            tokio::task::yield_now().await;
        }
    }
}
