//! Arms in the lanes of a few pairs of registers: which arm gets a lane, and when one leaves it.
//!
//! A lane whose arm has left goes to the next arm that waits. So no lane is empty before the last arms are at work.
//!
//! **Invariant:** a lane without an arm holds one that rests without gravity, so that it can go on stepping beside the
//! others without ever diverging.

#![allow(
    clippy::indexing_slicing,
    reason = "pairs of registers, and the seats of each, are counted from their lanes"
)]

use std::vec::Drain;

use fearless_simd::Simd;

use super::lanes::{Lanes, Moving};
use super::seat::{Seat, StepKind};
use crate::math::number::{Number, Wide};

/// Registers that do each operation one behind the other.
const K: usize = 2;
/// Pairs of registers that take each step in turn.
pub(super) const PAIRS: usize = 2;

/// A few pairs' worth of arms of one kind, and those that wait for a lane.
pub(super) struct Formation<'q, 'a, S: Simd, const N: usize> {
    pairs: [Lanes<Wide<S, K>, N>; PAIRS],
    /// The arm in each lane, pair after pair.
    seats: Vec<Option<Seat<'a, N>>>,
    waiting: Drain<'q, Seat<'a, N>>,
}

impl<'q, 'a, S: Simd, const N: usize> Formation<'q, 'a, S, N> {
    /// Gives as many arms a lane as there are.
    #[inline(always)]
    pub(super) fn new(simd: S, mut waiting: Drain<'q, Seat<'a, N>>) -> Self {
        let mut pairs = [Lanes::resting(Wide::<S, K>::splat(simd, 0.0)); PAIRS];
        let mut seats = Vec::with_capacity(PAIRS * Wide::<S, K>::LANES);
        for lanes in &mut pairs {
            for lane in 0..Wide::<S, K>::LANES {
                let mut seat = waiting.next();
                if let Some(seat) = &mut seat {
                    lanes.seat(lane, seat);
                }
                seats.push(seat);
            }
        }
        Self {
            pairs,
            seats,
            waiting,
        }
    }

    /// Takes all steps of all arms.
    #[inline(always)]
    pub(super) fn run(mut self, kind: StepKind) {
        while let Some(steps) = self.until_look() {
            if kind.weighs {
                self.take_steps::<true>(kind, steps);
            } else {
                self.take_steps::<false>(kind, steps);
            }
            self.look(steps);
        }
    }

    /// How many steps all arms take before one of them is looked at.
    fn until_look(&self) -> Option<u64> {
        self.seats.iter().flatten().map(Seat::until_look).min()
    }

    #[inline(always)]
    fn take_steps<const WEIGHS: bool>(&mut self, kind: StepKind, steps: u64) {
        let mut seats = self.seats.chunks(Wide::<S, K>::LANES);
        let taken: [bool; PAIRS] = [(); PAIRS].map(|()| {
            seats
                .next()
                .is_some_and(|seats| seats.iter().any(Option::is_some))
        });
        for step in 0..steps {
            for (index, lanes) in self.pairs.iter_mut().enumerate() {
                if !taken[index] {
                    continue;
                }
                let mut next = lanes.next::<WEIGHS>(kind.method, kind.controlled);
                if !Wide::<S, K>::all_finite(&next.state.position, &next.state.velocity) {
                    // This is moved out of the way, so that nothing else has to be in memory.
                    let mut parted = next;
                    let first = index * Wide::<S, K>::LANES;
                    part(lanes, &mut parted, &mut self.seats[first..], step);
                    next = parted;
                }
                lanes.moving = next;
            }
        }
    }

    /// Counts the steps, shows where they led to, has arms leave that are done, and gives their lanes to the next.
    fn look(&mut self, steps: u64) {
        let chunks = self.seats.chunks_mut(Wide::<S, K>::LANES);
        for (lanes, seats) in self.pairs.iter_mut().zip(chunks) {
            for (lane, place) in seats.iter_mut().enumerate() {
                if let Some(seat) = place {
                    let push_ends = seat.count(steps);
                    if seat.is_done(|| lanes.moving.state(lane)) {
                        lanes.moving.write(lane, seat.arm);
                        seat.end(false);
                        lanes.rest(lane);
                        *place = None;
                    } else {
                        if push_ends {
                            lanes.end_push(lane);
                        }
                        if seat.ends_period() {
                            lanes.begin_period(lane, seat);
                        }
                    }
                }
                if place.is_none()
                    && let Some(mut next) = self.waiting.next()
                {
                    lanes.seat(lane, &mut next);
                    *place = Some(next);
                }
            }
        }
    }
}

/// Has the arms leave whose next state is not finite; before it they took `step` steps of this run.
#[cold]
#[inline(never)]
fn part<T: Number, const N: usize>(
    lanes: &mut Lanes<T, N>,
    next: &mut Moving<T, N>,
    seats: &mut [Option<Seat<'_, N>>],
    step: u64,
) {
    for (lane, place) in (0..T::LANES).zip(seats) {
        if !next.is_finite(lane)
            && let Some(mut seat) = place.take()
        {
            seat.count(step);
            lanes.moving.write(lane, seat.arm);
            seat.end(true);
            lanes.rest(lane);
            next.set(lane, &Moving::resting(0.0));
        }
    }
}
