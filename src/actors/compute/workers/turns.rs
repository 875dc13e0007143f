//! Turns on the workers: the next goes to the client that has had least of their time.
//!
//! Fair queueing by a clock that advances, while work is done, at the pace at which each client would be served if all
//! who are there were served at once (Demers, Keshav and Shenker, *Analysis and Simulation of a Fair Queueing
//! Algorithm*, 1989). Each piece of work has its own reading, which begins at the clock's and advances by the time that
//! it has had; the least reading is next. So a newcomer does not wait for what others have begun, nor is it served
//! before them for ever: a client that has had more than its share stays behind until the clock has caught up, also
//! when it leaves and comes back.
//!
//! **Invariant:** of several pieces of work that came together and wait, none is ahead of another by more than the time
//! of one turn.

use std::collections::{HashMap, VecDeque};
use std::time::Duration;

use crate::actors::ConnectionId;

/// The client for which a computation is done; none for the runtime's own.
pub type Owner = Option<ConnectionId>;
/// The client that the runtime's own computations count for.
pub const RUNTIME: Owner = None;

/// Pieces of work that take turns.
pub(super) struct Turns<T> {
    /// Work that waits for its turn; of equal readings the first is next.
    waiting: VecDeque<(Ticket, T)>,
    /// Pieces of work that have their turn.
    running: u32,
    clock: Duration,
    /// Readings beyond the clock of clients that have nothing here at present.
    ahead: HashMap<Owner, Duration>,
}

/// The owner of a piece of work, and its reading.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ticket {
    of: Owner,
    reading: Duration,
}

impl<T> Default for Turns<T> {
    fn default() -> Self {
        Self {
            waiting: VecDeque::new(),
            running: 0,
            clock: Duration::ZERO,
            ahead: HashMap::new(),
        }
    }
}

impl<T> Turns<T> {
    /// Adds a client's work, behind all that have had no more time than it.
    pub(super) fn enter(&mut self, of: impl Into<Owner>, work: T) {
        let of = of.into();
        let reading = self.ahead.remove(&of).unwrap_or_default();
        self.wait(Ticket { of, reading }, work);
    }

    /// Puts work back that was kept away; it claims nothing for that time.
    pub(super) fn wait(&mut self, mut place: Ticket, work: T) {
        place.reading = place.reading.max(self.clock);
        self.waiting.push_back((place, work));
    }

    /// Takes the work whose turn it is. The turn is given back by [`Turns::again`] or [`Turns::leave`].
    pub(super) fn next(&mut self) -> Option<(Ticket, T)> {
        let readings = self.waiting.iter().enumerate();
        let (least, _) = readings.min_by_key(|(_, (place, _))| place.reading)?;
        let next = self.waiting.remove(least)?;
        self.running += 1;
        Some(next)
    }

    /// The turn is over and took so long; the work wants another.
    pub(super) fn again(&mut self, mut place: Ticket, work: T, took: Duration) {
        place.reading += took;
        self.end(took);
        self.waiting.push_back((place, work));
    }

    /// The turn is over and took so long; the work is done, or kept away for a while.
    pub(super) fn leave(&mut self, mut place: Ticket, took: Duration) -> Ticket {
        place.reading += took;
        self.end(took);
        self.ahead.retain(|_, reading| *reading > self.clock);
        if place.reading > self.clock {
            self.ahead.insert(place.of, place.reading);
        }
        place
    }

    fn end(&mut self, took: Duration) {
        let present = u32::try_from(self.waiting.len()).unwrap_or(u32::MAX);
        self.clock += took / present.saturating_add(self.running).max(1);
        self.running = self.running.saturating_sub(1);
    }

    /// Takes out all work that waits for its turn.
    pub(super) fn take_waiting(&mut self) -> Vec<T> {
        self.waiting.drain(..).map(|(_, work)| work).collect()
    }

    /// Takes out the work that is not to wait any more.
    pub(super) fn take_waiting_if(&mut self, is_done: impl Fn(&T) -> bool) -> Vec<T> {
        let waiting = std::mem::take(&mut self.waiting).into_iter();
        let (taken, left) = waiting.partition::<VecDeque<_>, _>(|(_, work)| is_done(work));
        self.waiting = left;
        taken.into_iter().map(|(_, work)| work).collect()
    }

    /// How many wait for their turn.
    pub(super) fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// How many wait for their turn or have it.
    pub(super) fn len(&self) -> usize {
        self.waiting.len() + usize::try_from(self.running).unwrap_or(usize::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SLICE: Duration = Duration::from_millis(1);

    /// Gives turns until `end`, each as long as `length` says; how much time each client has had.
    fn serve(
        turns: &mut Turns<u64>,
        count: usize,
        length: impl Fn(u64) -> Duration,
    ) -> HashMap<u64, Duration> {
        let mut had = HashMap::new();
        for _ in 0..count {
            let (place, client) = turns.next().unwrap();
            let took = length(client);
            *had.entry(client).or_default() += took;
            turns.again(place, client, took);
        }
        had
    }

    fn entered(clients: impl IntoIterator<Item = u64>) -> Turns<u64> {
        let mut turns = Turns::default();
        for client in clients {
            turns.enter(ConnectionId(client), client);
        }
        turns
    }

    #[test]
    fn equal_turns_go_round() {
        let mut turns = entered(1..=3);
        let mut order = Vec::new();
        for _ in 0..7 {
            let (place, client) = turns.next().unwrap();
            order.push(client);
            turns.again(place, client, SLICE);
        }
        assert_eq!(order, [1, 2, 3, 1, 2, 3, 1]);
    }

    #[test]
    fn who_takes_longer_turns_gets_fewer_and_all_get_the_same_time() {
        let mut turns = entered(1..=3);
        let length = |client| SLICE * [1, 7, 30][usize::try_from(client).unwrap() - 1];
        let had = serve(&mut turns, 10_000, length);
        let (least, most) = (had.values().min().unwrap(), had.values().max().unwrap());
        assert!(*most - *least <= 30 * SLICE, "{had:?}");
    }

    /// Five that have computed for minutes: the sixth waits for one turn of each at most, and has a sixth of the time
    /// from then on.
    #[test]
    fn a_newcomer_begins_at_once_and_gets_its_share_and_no_more() {
        let mut turns = entered(1..=5);
        serve(&mut turns, 100_000, |_| SLICE);
        turns.enter(ConnectionId(6), 6);
        assert_eq!(serve(&mut turns, 6, |_| SLICE).get(&6), Some(&SLICE));
        let had = serve(&mut turns, 6000, |_| SLICE);
        for (client, time) in had {
            let share = 1000 * SLICE;
            assert!(time.abs_diff(share) <= 2 * SLICE, "{client}: {time:?}");
        }
    }

    #[test]
    fn who_leaves_and_comes_back_is_where_it_was() {
        let mut turns = entered(1..=4);
        let mut had: HashMap<u64, Duration> = HashMap::new();
        for _ in 0..4000 {
            let (place, client) = turns.next().unwrap();
            *had.entry(client).or_default() += SLICE;
            if client == 1 {
                // One call per turn, as a client makes them that asks again as soon as it is answered.
                turns.leave(place, SLICE);
                turns.enter(ConnectionId(1), 1);
            } else {
                turns.again(place, client, SLICE);
            }
        }
        for (client, time) in had {
            assert!(
                time.abs_diff(1000 * SLICE) <= 3 * SLICE,
                "{client}: {time:?}"
            );
        }
    }

    /// New connections without end, each with one turn's work: those that were there go on all the same.
    #[test]
    fn newcomers_without_end_starve_nobody() {
        let mut turns = entered(1..=2);
        let mut newest = 100;
        let mut had_by_the_first = Duration::ZERO;
        for _ in 0..3000 {
            // Ten of them are always there.
            while turns.len() < 12 {
                newest += 1;
                turns.enter(ConnectionId(newest), newest);
            }
            let (place, client) = turns.next().unwrap();
            if client <= 2 {
                had_by_the_first += SLICE;
                turns.again(place, client, SLICE);
            } else {
                turns.leave(place, SLICE);
            }
        }
        // Two of twelve: a sixth of 3 s, and not less than half of that.
        assert!(had_by_the_first >= 250 * SLICE, "{had_by_the_first:?}");
        assert!(turns.ahead.len() <= 100, "{}", turns.ahead.len());
    }

    #[test]
    fn what_was_kept_away_claims_nothing_for_that_time() {
        let mut turns = entered([1, 2]);
        let (place, kept) = turns.next().unwrap();
        let place = turns.leave(place, Duration::ZERO);
        serve(&mut turns, 1000, |_| SLICE);
        turns.wait(place, kept);
        let had = serve(&mut turns, 100, |_| SLICE);
        assert!(had[&2] >= 49 * SLICE, "{had:?}");
    }

    #[test]
    fn nothing_is_remembered_of_who_had_no_more_than_a_share() {
        let mut turns = entered([1]);
        for _ in 0..1000 {
            let (place, client) = turns.next().unwrap();
            turns.leave(place, SLICE);
            turns.enter(ConnectionId(1), client);
        }
        assert!(turns.ahead.is_empty());
        assert_eq!((turns.len(), turns.waiting()), (1, 1));
    }
}
