//! What clients make the program hold: counted as it is allocated, client by client and in all; and who gives way when that is too much.
//!
//! Every client has an [`Account`]. What is allocated for it is charged there, its queues' nodes and the allocator's own bytes included, and
//! given back by whoever drops it. A message that several clients wait for counts once in the sum and whole in the account of each: who
//! does not read it keeps all of it.
//!
//! Nothing that a client asks for is refused because of what others hold. When the sum exceeds [`MAX_HELD`], the client that holds most gives
//! way: first the topic messages that wait for it, then its connection; then the next one, and only until the sum fits again.
//! Answers of megabytes are the exception: they wait for room, and whoever would hold most with its own is refused it.
//!
//! **Invariant:** what is taken is given back by whoever drops it last, in whichever thread, by whichever way it ends; and who holds
//! no more than [`MODEST`] never gives way.

mod share;

use std::fmt;
use std::sync::atomic::{AtomicU8, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use bytes::Bytes;
use tokio::sync::Notify;

pub use self::share::{Freed, Promise, Share, free_elsewhere};
use crate::protocol::outbox::{FRAME_BYTES, PLACE_BYTES};

const MIB: usize = 1024 * 1024;

/// Bytes that clients make the program hold, as they are counted: beyond it the client that holds most gives way.
pub const MAX_HELD: usize = 384 * MIB;
/// Bytes that the program has resident at most, whatever clients do: what is counted, what an allocator adds, files of the report that are
/// being sent, and the program itself. What the system keeps for sockets is not in it.
pub const MAX_MEMORY: usize = 640 * MIB;
/// Who holds no more bytes never gives way: 1,024 such clients fit.
pub const MODEST: usize = 256 * 1024;
/// An answer that takes no more than one such part of [`MAX_HELD`] is modest: it may be 60,000 steps long.
pub const MODEST_PART: usize = 64;
/// Bytes of topic messages that are left to a client that gives way.
pub const MESSAGES_LEFT: usize = 64 * 1024;
/// What a connection takes at rest: its actor, its tasks, and its entries in the registry.
pub const CONNECTION_BYTES: usize = 24 * 1024;

/// Why an answer of megabytes is not begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoRoom {
    /// What others compute at the moment, or what is being freed, has taken the room: that ends soon.
    #[error("others compute at the moment")]
    Yet,
    /// What waits for clients has taken the room, and none of them holds as much as the answer would have.
    #[error("too many bytes wait for clients that do not read; try again later")]
    Now,
}

/// All accounts, and their sum; clones share them.
#[derive(Clone)]
pub struct Memory {
    sum: Arc<Sum>,
    /// Messages, each once: nobody's own.
    messages: Arc<Account>,
}

#[derive(Debug)]
struct Sum {
    limit: usize,
    /// Held by all, what is shared counted once.
    held: AtomicUsize,
    /// Of that, taken for answers that are still being computed.
    promised: AtomicUsize,
    /// Of that, what waited for clients that are gone, and is being freed.
    freed: AtomicUsize,
    accounts: Mutex<Vec<Weak<Account>>>,
    /// Connections that gave way.
    cut_off: AtomicU64,
}

impl Default for Memory {
    fn default() -> Self {
        Self::of(MAX_HELD)
    }
}

impl Memory {
    /// Nothing is held, and at most `limit` bytes may be.
    #[must_use]
    pub fn of(limit: usize) -> Self {
        let sum = Arc::new(Sum {
            limit,
            held: AtomicUsize::new(0),
            promised: AtomicUsize::new(0),
            freed: AtomicUsize::new(0),
            accounts: Mutex::default(),
            cut_off: AtomicU64::new(0),
        });
        let messages = Arc::new(Account::new(Arc::clone(&sum)));
        Self { sum, messages }
    }

    /// Bytes held.
    #[must_use]
    pub fn held(&self) -> usize {
        self.sum.held.load(Ordering::Relaxed)
    }

    /// Connections that were ended since the start because they held the most.
    #[must_use]
    pub fn cut_off(&self) -> u64 {
        self.sum.cut_off.load(Ordering::Relaxed)
    }

    /// Opens the account of a connection, which is charged for that much.
    #[must_use]
    pub fn open(&self) -> Arc<Account> {
        let account = Arc::new(Account::new(Arc::clone(&self.sum)));
        {
            let mut accounts = self.sum.accounts();
            accounts.retain(|one| one.strong_count() > 0);
            accounts.push(Arc::downgrade(&account));
        }
        account.add(CONNECTION_BYTES);
        account
    }

    /// Counts a topic message, which may be shared, until its last copy is gone.
    #[must_use]
    pub fn count(&self, frame: Bytes) -> Bytes {
        self.messages.count(frame)
    }
}

impl fmt::Debug for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {}", self.held(), self.sum.limit)
    }
}

impl Sum {
    fn accounts(&self) -> std::sync::MutexGuard<'_, Vec<Weak<Account>>> {
        // The list is never left half changed.
        self.accounts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn add(&self, bytes: usize) {
        if self.held.fetch_add(bytes, Ordering::Relaxed) + bytes > self.limit {
            self.relieve();
        }
    }

    fn give_back(&self, bytes: usize) {
        self.held.fetch_sub(bytes, Ordering::Relaxed);
    }

    /// Those who are connected.
    fn open(&self) -> Vec<Arc<Account>> {
        let accounts = self.accounts();
        accounts.iter().filter_map(Weak::upgrade).collect()
    }

    /// Has clients give way, those that hold most first, until what is left will fit.
    fn relieve(&self) {
        while self.held.load(Ordering::Relaxed) > self.limit {
            let all = self.open();
            let staying = self.held.load(Ordering::Relaxed);
            if staying.saturating_sub(self.leaving(&all)) <= self.limit {
                return;
            }
            let serving = all.iter().filter(|one| one.is_serving());
            let Some(most) = serving.max_by_key(|one| one.held()) else {
                return;
            };
            if most.held() <= MODEST {
                return;
            }
            most.give_way();
        }
    }

    /// Of what is held, what will be gone soon.
    fn leaving(&self, all: &[Arc<Account>]) -> usize {
        let asked: usize = all.iter().map(|one| one.leaving()).sum();
        asked + self.freed.load(Ordering::Relaxed)
    }

    /// Whether a client that is served holds more than so many bytes.
    fn anyone_holds_over(&self, bytes: usize) -> bool {
        let all = self.open();
        all.iter().any(|one| one.is_serving() && one.held() > bytes)
    }
}

/// What a client has been asked to give up.
const NOTHING: u8 = 0;
const MESSAGES: u8 = 1;
const CONNECTION: u8 = 2;

/// What one client makes the program hold.
#[derive(Debug)]
pub struct Account {
    sum: Arc<Sum>,
    /// Allocated for this client alone.
    own: AtomicUsize,
    /// Places in its queue of topic messages; they are its own as well.
    places: AtomicUsize,
    /// Topic messages that wait for it, each whole, though others may wait for them too.
    shared: AtomicUsize,
    asked: AtomicU8,
    /// Something was asked.
    news: Notify,
}

impl Account {
    fn new(sum: Arc<Sum>) -> Self {
        Self {
            sum,
            own: AtomicUsize::new(0),
            places: AtomicUsize::new(0),
            shared: AtomicUsize::new(0),
            asked: AtomicU8::new(NOTHING),
            news: Notify::new(),
        }
    }

    /// Bytes that the client makes the program hold.
    #[must_use]
    pub fn held(&self) -> usize {
        self.own.load(Ordering::Relaxed) + self.messages()
    }

    /// Of that, what the topic messages that wait for it take.
    #[must_use]
    pub fn messages(&self) -> usize {
        self.places.load(Ordering::Relaxed) + self.shared.load(Ordering::Relaxed)
    }

    /// Takes `bytes` until the share is dropped.
    #[must_use]
    pub fn take(self: &Arc<Self>, bytes: usize) -> Share {
        self.add(bytes);
        Share::noted(self, bytes)
    }

    /// Counts a frame, and what there is beside its bytes, until the last copy of it is gone.
    #[must_use]
    pub fn count(self: &Arc<Self>, frame: Bytes) -> Bytes {
        self.take(frame.len() + FRAME_BYTES).cover(frame)
    }

    /// So many topic messages, of so many bytes together, wait for the client now. Told by its connection alone.
    pub fn queue(&self, count: usize, bytes: usize) {
        let whole = bytes + count * FRAME_BYTES;
        self.shared.store(whole, Ordering::Relaxed);
        let places = count * PLACE_BYTES;
        let before = self.places.swap(places, Ordering::Relaxed);
        if places > before {
            self.sum.add(places - before);
        } else if places < before {
            self.sum.give_back(before - places);
        }
    }

    /// The topic messages that wait for the client are to be freed elsewhere: until that is done, nobody else has to give way for them.
    #[must_use]
    pub fn freeing(&self) -> Freed {
        Freed::of(&self.sum, self.shared.load(Ordering::Relaxed))
    }

    /// Takes `bytes` for an answer that is to be computed. An eighth of all that there is is left for what needs no promise, and another
    /// for answers of no more than [`MODEST_PART`] of it, so that they find room beside as many long ones as there may be.
    ///
    /// # Errors
    /// Says whether room can be expected: what others compute ends soon, what clients do not read may stay. Not after `patience`
    /// has run out, if somebody holds more than this client would: it gives way then.
    pub fn promise(
        self: &Arc<Self>,
        bytes: usize,
        is_out_of_patience: bool,
    ) -> Result<Promise, NoRoom> {
        let sum = &self.sum;
        let eighths = if bytes > sum.limit / MODEST_PART {
            6
        } else {
            7
        };
        let most = sum.limit / 8 * eighths;
        // First, so that whoever finds no room because of this one sees a promise, not an answer that nobody reads.
        sum.promised.fetch_add(bytes, Ordering::SeqCst);
        let add = |held: usize| held.checked_add(bytes).filter(|all| *all <= most);
        let ordering = Ordering::SeqCst;
        if sum.held.fetch_update(ordering, ordering, add).is_ok() {
            self.own.fetch_add(bytes, Ordering::Relaxed);
            return Ok(Promise::of(Share::noted(self, bytes)));
        }
        let promised = sum.promised.fetch_sub(bytes, Ordering::SeqCst) - bytes;
        let leaving = sum.leaving(&sum.open());
        let held = sum.held.load(Ordering::SeqCst);
        let waiting = held.saturating_sub(promised).saturating_sub(leaving);
        if waiting.saturating_add(bytes) <= most {
            return Err(NoRoom::Yet);
        }
        if is_out_of_patience && sum.anyone_holds_over(self.held().saturating_add(bytes)) {
            sum.promised.fetch_add(bytes, Ordering::SeqCst);
            return Ok(Promise::of(self.take(bytes)));
        }
        Err(NoRoom::Now)
    }

    /// Waits until something is asked of the client: true if that is its connection, false if it is the topic messages that wait for it,
    /// but for [`MESSAGES_LEFT`].
    pub async fn asked(&self) -> bool {
        loop {
            match self.asked.load(Ordering::SeqCst) {
                NOTHING => self.news.notified().await,
                asked => return asked == CONNECTION,
            }
        }
    }

    /// The topic messages are gone. If that was not enough, it is the next one's turn.
    pub fn gave_messages(&self) {
        let order = Ordering::SeqCst;
        // Nothing else was asked meanwhile.
        let _ = self.asked.compare_exchange(MESSAGES, NOTHING, order, order);
        self.sum.relieve();
    }

    fn is_serving(&self) -> bool {
        self.asked.load(Ordering::SeqCst) == NOTHING
    }

    /// What of this will be gone soon.
    fn leaving(&self) -> usize {
        match self.asked.load(Ordering::SeqCst) {
            NOTHING => 0,
            MESSAGES => self.messages().saturating_sub(MESSAGES_LEFT),
            _ => self.held(),
        }
    }

    fn give_way(&self) {
        let has_messages = self.messages() > 2 * MESSAGES_LEFT;
        let what = if has_messages { MESSAGES } else { CONNECTION };
        let order = Ordering::SeqCst;
        let before = self.asked.compare_exchange(NOTHING, what, order, order);
        if before.is_err() {
            return;
        }
        if what == CONNECTION {
            self.sum.cut_off.fetch_add(1, Ordering::Relaxed);
        }
        self.news.notify_one();
    }

    fn add(&self, bytes: usize) {
        self.own.fetch_add(bytes, Ordering::Relaxed);
        self.sum.add(bytes);
    }

    fn give_back(&self, bytes: usize) {
        self.own.fetch_sub(bytes, Ordering::Relaxed);
        self.sum.give_back(bytes);
    }
}

impl Drop for Account {
    fn drop(&mut self) {
        // All shares are gone: what is left is the connection itself and its queue.
        let left = *self.own.get_mut() + *self.places.get_mut();
        self.sum.give_back(left);
    }
}
