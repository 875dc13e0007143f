//! Accounts: bytes that one client makes the program hold, the sum of all, and who gives way.
//!
//! **Invariant:** an account is charged by whoever allocates, and given back by whoever frees.

use std::cmp::Reverse;
use std::sync::atomic::{AtomicU8, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use tokio::sync::Notify;

use super::{MESSAGES_LEFT, MODEST};
use crate::protocol::outbox::{FRAME_BYTES, PLACE_BYTES};

/// The part of the limit by which it may be exceeded while those who give way are leaving.
const LEAVING: usize = 64;
/// The part of it that is made free where messages give way, so that the next message finds room.
const ROOM: usize = 16;

/// The sum of all accounts, and what is known of it.
#[derive(Debug)]
pub(super) struct Sum {
    pub(super) limit: usize,
    /// Held by all, what is shared counted once.
    pub(super) held: AtomicUsize,
    /// The part of it that is taken for answers that are still being computed.
    pub(super) promised: AtomicUsize,
    /// The part of it that waited for clients that are gone, and is being freed.
    pub(super) freed: AtomicUsize,
    /// When more than this is held, a look is taken at who gives way.
    look: AtomicUsize,
    accounts: Mutex<Vec<Weak<Account>>>,
    /// Connections that gave way.
    pub(super) cut_off: AtomicU64,
}

impl Sum {
    /// Nothing is held, and at most `limit` bytes may be.
    pub(super) fn of(limit: usize) -> Self {
        Self {
            limit,
            held: AtomicUsize::new(0),
            promised: AtomicUsize::new(0),
            freed: AtomicUsize::new(0),
            look: AtomicUsize::new(limit),
            accounts: Mutex::default(),
            cut_off: AtomicU64::new(0),
        }
    }

    pub(super) fn accounts(&self) -> MutexGuard<'_, Vec<Weak<Account>>> {
        // The list is never left half changed.
        self.accounts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn add(&self, bytes: usize) {
        let held = self.held.fetch_add(bytes, Ordering::Relaxed) + bytes;
        if held > self.look.load(Ordering::Relaxed) {
            self.relieve();
        }
    }

    pub(super) fn give_back(&self, bytes: usize) {
        if self.held.fetch_sub(bytes, Ordering::Relaxed) - bytes <= self.limit {
            self.look.store(self.limit, Ordering::Relaxed);
        }
    }

    /// The accounts of all who are connected.
    pub(super) fn open(&self) -> Vec<Arc<Account>> {
        let accounts = self.accounts();
        accounts.iter().filter_map(Weak::upgrade).collect()
    }

    /// Has clients give way, those that hold most first, until what is left will fit.
    fn relieve(&self) {
        let held = self.held.load(Ordering::Relaxed);
        if held <= self.limit {
            return;
        }
        let mut all = self.open();
        let leaving = self.leaving(&all);
        let mut staying = held.saturating_sub(leaving);
        if staying > self.limit {
            all.retain(|one| one.is_serving());
            all.sort_by_cached_key(|one| Reverse(one.held()));
            for most in &all {
                let room = if most.has_messages() {
                    self.limit / ROOM
                } else {
                    0
                };
                if staying + room <= self.limit || most.held() <= MODEST {
                    break;
                }
                most.give_way();
                staying = staying.saturating_sub(most.leaving());
            }
        }
        if staying < held {
            // Until these have left, a look at a thousand clients at every allocation would cost more than all else.
            let soon = held + self.limit / LEAVING;
            self.look.store(soon, Ordering::Relaxed);
        }
    }

    /// The part of what is held that will be gone soon.
    pub(super) fn leaving(&self, all: &[Arc<Account>]) -> usize {
        let asked: usize = all.iter().map(|one| one.leaving()).sum();
        asked + self.freed.load(Ordering::Relaxed)
    }

    /// Whether a client that is served holds more than so many bytes.
    pub(super) fn anyone_holds_over(&self, bytes: usize) -> bool {
        let all = self.open();
        all.iter().any(|one| one.is_serving() && one.held() > bytes)
    }
}

/// A client has been asked to give up this.
const NOTHING: u8 = 0;
const MESSAGES: u8 = 1;
const CONNECTION: u8 = 2;

/// Bytes that one client makes the program hold.
#[derive(Debug)]
pub struct Account {
    pub(super) sum: Arc<Sum>,
    /// Allocated for this client alone.
    pub(super) own: AtomicUsize,
    /// Places in its queue of topic messages; they are its own as well.
    places: AtomicUsize,
    /// Topic messages that wait for it, each whole, though others may wait for them too.
    pub(super) shared: AtomicUsize,
    /// Topic messages that are being written to it, each whole as well.
    writing: AtomicUsize,
    asked: AtomicU8,
    /// Something was asked.
    news: Notify,
}

impl Account {
    pub(super) fn new(sum: Arc<Sum>) -> Self {
        Self {
            sum,
            own: AtomicUsize::new(0),
            places: AtomicUsize::new(0),
            shared: AtomicUsize::new(0),
            writing: AtomicUsize::new(0),
            asked: AtomicU8::new(NOTHING),
            news: Notify::new(),
        }
    }

    /// Bytes that the client makes the program hold.
    #[must_use]
    pub fn held(&self) -> usize {
        let own = self.own.load(Ordering::Relaxed) + self.writing.load(Ordering::Relaxed);
        own + self.messages()
    }

    /// The part of them that belongs to topic messages that wait for the client, and may be dropped.
    #[must_use]
    pub fn messages(&self) -> usize {
        self.places.load(Ordering::Relaxed) + self.shared.load(Ordering::Relaxed)
    }

    /// Sets what the client is charged for: `count` topic messages of `bytes` wait, and others, of `writing` bytes with
    /// their places, are being written. Called by its connection alone.
    pub fn queue(&self, count: usize, bytes: usize, writing: usize) {
        self.writing.store(writing, Ordering::Relaxed);
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

    /// Waits until the client has to give something up: true if that is its connection, false if it is the topic
    /// messages that wait for it, all but [`MESSAGES_LEFT`].
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

    /// The part of it that will be gone soon.
    fn leaving(&self) -> usize {
        match self.asked.load(Ordering::SeqCst) {
            NOTHING => 0,
            MESSAGES => self.messages().saturating_sub(MESSAGES_LEFT),
            _ => self.held(),
        }
    }

    /// Whether its messages are worth asking for.
    fn has_messages(&self) -> bool {
        self.messages() > 2 * MESSAGES_LEFT
    }

    fn give_way(&self) {
        let what = if self.has_messages() {
            MESSAGES
        } else {
            CONNECTION
        };
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

    pub(super) fn add(&self, bytes: usize) {
        self.own.fetch_add(bytes, Ordering::Relaxed);
        self.sum.add(bytes);
    }

    pub(super) fn give_back(&self, bytes: usize) {
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
