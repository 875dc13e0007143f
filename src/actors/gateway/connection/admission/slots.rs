//! A fixed number of slots. When all are in use, a newcomer evicts the oldest holder.
//!
//! Where clients finish quickly, only slow ones become the oldest. To refuse the newcomer instead would shut out honest
//! clients.
//!
//! **Invariant:** never more slots are held than there are.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

/// The slots, oldest first: each is notified when it is evicted.
#[derive(Debug)]
pub struct Slots {
    most: usize,
    taken: Mutex<VecDeque<Arc<Notify>>>,
}

impl Slots {
    /// Makes `most` slots, all of them free.
    #[must_use]
    pub fn new(most: usize) -> Self {
        Self {
            most,
            taken: Mutex::default(),
        }
    }

    /// Takes a slot: the oldest one, if none is free.
    pub(crate) fn take(&self) -> HeldSlot<'_> {
        let notice = Arc::new(Notify::new());
        let mut taken = self.taken();
        if taken.len() >= self.most
            && let Some(oldest) = taken.pop_front()
        {
            oldest.notify_one();
        }
        taken.push_back(Arc::clone(&notice));
        HeldSlot {
            slots: self,
            notice,
        }
    }

    fn remove(&self, notice: &Arc<Notify>) {
        self.taken().retain(|one| !Arc::ptr_eq(one, notice));
    }

    fn taken(&self) -> MutexGuard<'_, VecDeque<Arc<Notify>>> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A slot that is held; it is free again when this is dropped.
#[derive(Debug)]
pub(crate) struct HeldSlot<'a> {
    slots: &'a Slots,
    notice: Arc<Notify>,
}

impl HeldSlot<'_> {
    /// Gives the slot back before this is dropped. Nobody is evicted from it then.
    #[cfg(feature = "web")]
    pub(crate) fn give_back(&self) {
        self.slots.remove(&self.notice);
    }

    /// Ends when somebody else has the slot. It must not be awaited again after that.
    pub(crate) async fn evicted(&self) {
        self.notice.notified().await;
    }
}

impl Drop for HeldSlot<'_> {
    fn drop(&mut self) {
        self.slots.remove(&self.notice);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tokio::time::timeout;

    use super::*;

    async fn is_evicted(slot: &HeldSlot<'_>) -> bool {
        timeout(Duration::ZERO, slot.evicted()).await.is_ok()
    }

    #[tokio::test]
    async fn the_oldest_slot_goes_to_who_comes_when_all_are_held() {
        let slots = Slots::new(2);
        let (first, second) = (slots.take(), slots.take());
        drop(first);
        let third = slots.take();
        assert!(!is_evicted(&second).await, "there was one left");
        let fourth = slots.take();
        assert!(
            is_evicted(&second).await && !is_evicted(&third).await && !is_evicted(&fourth).await
        );
        drop(second);
        assert_eq!(
            slots.taken().len(),
            2,
            "what was evicted is not given back twice"
        );
    }
}
