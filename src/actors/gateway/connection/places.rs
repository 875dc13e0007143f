//! Places of which there are so many: who comes when all are taken gets the one that has been taken longest.
//!
//! Where everybody is done in a moment, only those lose their place who wait for something; who is refused instead
//! would be whoever comes.
//!
//! Where places are not alike, whoever comes takes one and displaces the oldest until there is room.
//!
//! **Invariant:** never more places are taken than there are.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

/// The places, oldest first: each is notified when it is lost.
#[derive(Debug)]
pub(super) struct Places {
    most: usize,
    taken: Mutex<VecDeque<Arc<Notify>>>,
}

impl Places {
    /// So many places, none of them taken.
    pub(super) fn new(most: usize) -> Self {
        Self {
            most,
            taken: Mutex::default(),
        }
    }

    /// Takes a place, the oldest one's if there is no other.
    pub(super) fn take(&self) -> Place<'_> {
        let notice = Arc::new(Notify::new());
        let mut taken = self.taken();
        if taken.len() >= self.most {
            lose_oldest(&mut taken);
        }
        taken.push_back(Arc::clone(&notice));
        Place {
            places: self,
            notice,
        }
    }

    fn taken(&self) -> MutexGuard<'_, VecDeque<Arc<Notify>>> {
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn lose_oldest(taken: &mut VecDeque<Arc<Notify>>) {
    if let Some(oldest) = taken.pop_front() {
        oldest.notify_one();
    }
}

/// A place; free again when this is dropped.
#[derive(Debug)]
pub(super) struct Place<'a> {
    places: &'a Places,
    notice: Arc<Notify>,
}

impl Place<'_> {
    /// Ends when somebody else has the place. To be asked until then, not beyond.
    pub(super) async fn lost(&self) {
        self.notice.notified().await;
    }

    /// The oldest place is lost, if that is not this one; false if it is, or is lost itself.
    #[cfg(feature = "web")]
    pub(super) fn displace(&self) -> bool {
        let mut taken = self.places.taken();
        let is_behind = taken
            .iter()
            .skip(1)
            .any(|one| Arc::ptr_eq(one, &self.notice));
        if is_behind {
            lose_oldest(&mut taken);
        }
        is_behind
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        let mut taken = self.places.taken();
        taken.retain(|one| !Arc::ptr_eq(one, &self.notice));
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tokio::time::timeout;

    use super::*;

    async fn is_lost(place: &Place<'_>) -> bool {
        timeout(Duration::ZERO, place.lost()).await.is_ok()
    }

    #[tokio::test]
    async fn the_oldest_place_goes_to_who_comes_when_all_are_taken() {
        let places = Places::new(2);
        let (first, second) = (places.take(), places.take());
        drop(first);
        let third = places.take();
        assert!(!is_lost(&second).await, "there was one left");
        let fourth = places.take();
        assert!(is_lost(&second).await && !is_lost(&third).await && !is_lost(&fourth).await);
        drop(second);
        assert_eq!(
            places.taken().len(),
            2,
            "what was lost is not given back twice"
        );
    }
}
