//! What all clients together may make the program hold: a few totals of bytes, beside the limits of each connection.
//!
//! A limit per connection, times all connections, is more memory than a machine has. So what connections hold is counted in totals too, and
//! whoever would exceed one gets a clear refusal, loses topic messages, or is not read for a while. What is counted is the memory itself: a
//! frame that a thousand clients share counts once, and is counted until its last byte has been written.
//!
//! **Invariant:** what is taken from a total is given back by whoever drops it last, in whichever thread, by whichever way it ends.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use bytes::Bytes;

const MIB: usize = 1024 * 1024;

/// Bytes of responses and statuses that wait on all connections together, those being computed included.
pub const MAX_RESPONSES_TOTAL: usize = 1024 * MIB;
/// Bytes of topic messages that wait on all connections together; one that several clients wait for counts once.
pub const MAX_MESSAGES_TOTAL: usize = 256 * MIB;
/// Bytes that all clients together have sent of frames that are not complete yet, counted twice: they are copied once complete.
pub const MAX_INPUT_TOTAL: usize = 256 * MIB;
/// Bytes that all registrations together take: subscriptions, topics advertised, services provided.
pub const MAX_NAMES_TOTAL: usize = 128 * MIB;
/// Bytes that clients can make the program hold, all in all: the totals, what is granted beside them, and what an allocator adds.
/// What the system keeps for sockets is not in it.
pub const MAX_MEMORY: usize = 2560 * MIB;

/// How much of a total may be taken, by what is at stake: the rest is kept for those who need less.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Claim {
    /// Answers of megabytes, which may be refused: five eighths.
    Heavy,
    /// What a client that has a backlog already, or sends long frames, can wait for: three quarters.
    Ordinary,
    /// A small answer for a client that has none waiting: all of it.
    Last,
}

impl Claim {
    const fn part_of(self, limit: usize) -> usize {
        match self {
            Self::Heavy => limit / 8 * 5,
            Self::Ordinary => limit / 4 * 3,
            Self::Last => limit,
        }
    }
}

/// Why an answer of megabytes is not begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoRoom {
    /// What others compute at the moment has taken the room: it ends soon.
    #[error("others compute at the moment")]
    Yet,
    /// What waits for clients that do not read has taken the room.
    #[error("too many bytes of answers wait for clients that do not read; try again later")]
    Now,
}

/// A total; clones share it.
#[derive(Clone)]
pub struct Budget(Arc<Total>);

struct Total {
    limit: usize,
    /// Taken, all in all.
    used: AtomicUsize,
    /// Of that, taken for answers that are still being computed.
    promised: AtomicUsize,
}

impl Budget {
    /// A total of `limit` bytes, nothing of it taken.
    #[must_use]
    pub fn of(limit: usize) -> Self {
        Self(Arc::new(Total {
            limit,
            used: AtomicUsize::new(0),
            promised: AtomicUsize::new(0),
        }))
    }

    /// Bytes taken.
    #[must_use]
    pub fn used(&self) -> usize {
        self.0.used.load(Ordering::Relaxed)
    }

    /// Whether no more than the part that the claim may use is taken.
    #[must_use]
    pub fn has_room(&self, claim: Claim) -> bool {
        self.used() <= claim.part_of(self.0.limit)
    }

    /// Takes `bytes`, if that does not exceed the part that the claim may use.
    #[must_use]
    pub fn take(&self, bytes: usize, claim: Claim) -> Option<Share> {
        self.try_add(bytes, claim).then(|| self.share(bytes))
    }

    /// Counts what is there already, whether or not there is room.
    #[must_use]
    pub fn note(&self, bytes: usize) -> Share {
        self.0.used.fetch_add(bytes, Ordering::Relaxed);
        self.share(bytes)
    }

    /// Counts a frame that is there already, until its last copy is gone.
    #[must_use]
    pub fn count(&self, frame: Bytes) -> Bytes {
        self.note(frame.len()).cover(frame)
    }

    /// Takes `bytes` for an answer that is to be computed.
    ///
    /// # Errors
    /// Says whether room can be expected: what others compute ends soon, what clients do not read may stay.
    pub fn promise(&self, bytes: usize) -> Result<Promise, NoRoom> {
        // First, so that whoever finds no room because of this one sees a promise, not an answer that nobody reads.
        self.0.promised.fetch_add(bytes, Ordering::SeqCst);
        if self.try_add(bytes, Claim::Heavy) {
            let share = self.share(bytes);
            return Ok(Promise(share));
        }
        self.0.promised.fetch_sub(bytes, Ordering::SeqCst);
        let waiting = self
            .used()
            .saturating_sub(self.0.promised.load(Ordering::SeqCst));
        if waiting.saturating_add(bytes) > Claim::Heavy.part_of(self.0.limit) {
            Err(NoRoom::Now)
        } else {
            Err(NoRoom::Yet)
        }
    }

    fn try_add(&self, bytes: usize, claim: Claim) -> bool {
        let most = claim.part_of(self.0.limit);
        let add = |used: usize| used.checked_add(bytes).filter(|sum| *sum <= most);
        let used = &self.0.used;
        used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add)
            .is_ok()
    }

    fn share(&self, bytes: usize) -> Share {
        Share {
            budget: self.clone(),
            bytes,
        }
    }
}

impl fmt::Debug for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} of {}", self.used(), self.0.limit)
    }
}

/// Bytes taken from a total, given back when this is dropped.
#[derive(Debug)]
pub struct Share {
    budget: Budget,
    bytes: usize,
}

impl Share {
    /// Bytes taken.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Makes it `bytes`; false, and as it was, if that is more than the claim may use.
    #[must_use]
    pub fn resize(&mut self, bytes: usize, claim: Claim) -> bool {
        if bytes > self.bytes {
            if !self.budget.try_add(bytes - self.bytes, claim) {
                return false;
            }
        } else {
            self.budget
                .0
                .used
                .fetch_sub(self.bytes - bytes, Ordering::Relaxed);
        }
        self.bytes = bytes;
        true
    }

    /// The share goes with the frame: it is given back when the last copy of that is gone.
    #[must_use]
    pub fn cover(self, frame: Bytes) -> Bytes {
        Bytes::from_owner(Counted {
            frame,
            _share: self,
        })
    }
}

impl Drop for Share {
    fn drop(&mut self) {
        self.budget.0.used.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// Bytes taken for an answer that is being computed.
#[derive(Debug)]
pub struct Promise(Share);

impl Promise {
    /// The answer is there, no longer than was promised: what it does not need is given back.
    #[must_use]
    pub fn cover(self, frame: Bytes) -> Bytes {
        let share = self.0.budget.note(frame.len());
        drop(self);
        share.cover(frame)
    }
}

impl Drop for Promise {
    fn drop(&mut self) {
        let promised = &self.0.budget.0.promised;
        promised.fetch_sub(self.0.bytes, Ordering::SeqCst);
    }
}

/// A frame and what was taken for it.
struct Counted {
    frame: Bytes,
    _share: Share,
}

impl AsRef<[u8]> for Counted {
    fn as_ref(&self) -> &[u8] {
        &self.frame
    }
}

/// The totals of one runtime.
#[derive(Debug)]
pub struct Totals {
    /// [`MAX_RESPONSES_TOTAL`].
    pub responses: Budget,
    /// [`MAX_MESSAGES_TOTAL`].
    pub messages: Budget,
    /// [`MAX_INPUT_TOTAL`].
    pub input: Budget,
    /// [`MAX_NAMES_TOTAL`].
    pub names: Budget,
}

impl Default for Totals {
    fn default() -> Self {
        Self {
            responses: Budget::of(MAX_RESPONSES_TOTAL),
            messages: Budget::of(MAX_MESSAGES_TOTAL),
            input: Budget::of(MAX_INPUT_TOTAL),
            names: Budget::of(MAX_NAMES_TOTAL),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_taken_is_given_back_with_the_last_copy() {
        let budget = Budget::of(1000);
        let share = budget.take(400, Claim::Last).unwrap();
        let frame = share.cover(Bytes::from(vec![7; 400]));
        let copy = frame.slice(10..20);
        assert_eq!(budget.used(), 400);
        drop(frame);
        assert_eq!((budget.used(), &copy[..]), (400, &[7; 10][..]));
        drop(copy);
        assert_eq!(budget.used(), 0);
    }

    #[test]
    fn each_claim_has_its_part() {
        let budget = Budget::of(800);
        let heavy = budget.take(500, Claim::Heavy).unwrap();
        assert!(budget.take(1, Claim::Heavy).is_none());
        let ordinary = budget.take(100, Claim::Ordinary).unwrap();
        assert!(budget.take(1, Claim::Ordinary).is_none());
        let last = budget.take(200, Claim::Last).unwrap();
        assert!(budget.take(1, Claim::Last).is_none());
        assert!(budget.has_room(Claim::Last) && !budget.has_room(Claim::Ordinary));
        drop((heavy, ordinary, last));
        assert_eq!(budget.used(), 0);
    }

    #[test]
    fn a_share_grows_and_shrinks() {
        let budget = Budget::of(100);
        let mut share = budget.take(10, Claim::Last).unwrap();
        assert!(share.resize(75, Claim::Ordinary));
        assert!(!share.resize(76, Claim::Ordinary));
        assert_eq!((share.bytes(), budget.used()), (75, 75));
        assert!(share.resize(5, Claim::Ordinary));
        assert_eq!(budget.used(), 5);
        let _ = budget.note(1000);
        assert_eq!(budget.used(), 5, "noted and gone");
    }

    #[test]
    fn who_finds_no_room_is_told_whether_it_is_worth_waiting() {
        let budget = Budget::of(800);
        let computing = budget.promise(300).unwrap();
        assert_eq!(budget.promise(300).unwrap_err(), NoRoom::Yet);
        assert_eq!(
            budget.promise(501).unwrap_err(),
            NoRoom::Now,
            "it never fits"
        );
        let answer = computing.cover(Bytes::from(vec![0; 250]));
        assert_eq!(budget.used(), 250);
        assert_eq!(
            budget.promise(300).unwrap_err(),
            NoRoom::Now,
            "the answer waits"
        );
        drop(answer);
        drop(budget.promise(300).unwrap());
        assert_eq!(budget.used(), 0);
        assert_eq!(budget.0.promised.load(Ordering::SeqCst), 0);
    }
}
