//! The smallest timestep limit over all poses. It holds on the way from one setpoint to another, where other limits may
//! not.
//!
//! Inertia depends on every joint but the first, the gravity load on all of them. The loop is analysed at every pose of
//! a grid over the outer joints: without gravity, and, if there is gravity, with it for a ring of first joint angles.
//! Then the poses in between are searched. A climb starts from every local maximum of the grid and ascends the growth
//! at the smallest limit so far. If a mode grows at a pose, its limit is smaller. Poses that are unstable in continuous
//! time because of gravity are left out, since no timestep stabilises them. Without gravity they count, since the gains
//! are then the cause.
//!
//! An arm whose joints integrate can be sent to every pose, also to unstable ones. Towards the border of unstable poses
//! the limit falls to zero. They are therefore searched first, by ascending the largest real part of any mode in
//! continuous time.
//!
//! **Invariant:** the work is bounded: [`cells`] poses, and at most one climb from each.

use crate::math::count::length_in_f64;
use std::f64::consts::{PI, TAU};

use super::control_loop::ControlLoop;
use super::linear::Linear;
use super::paused::pause;
use super::stability::{Modes, NEUTRAL, Sampling, Stepping};

/// Angles of the first joint for the gravity load, among them hanging and upright.
const DIRECTIONS: usize = 8;

/// Parts of the smallest limit so far. A pose that is stable at all of them needs no search of its own.
const PROBES: [f64; 3] = [1.0, 0.6, 0.2];

/// Smallest stride of a climb \[rad\]: near a maximum the limit then changes by a millionth.
const SMALLEST_STRIDE: f64 = 1e-3;

/// Most moves of one climb.
const MAX_MOVES: u32 = 400;

/// Poses around the circle of each outer joint; even, so that stretched and folded are among them.
const fn grid<const N: usize>() -> usize {
    if N > 2 { 16 } else { 64 }
}

/// A pose to be analysed, with gravity or without.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PoseCandidate<const N: usize> {
    pub(super) pose: [f64; N],
    has_gravity: bool,
}

impl<const N: usize> PoseCandidate<N> {
    /// A pose with the arm's gravity.
    pub(super) const fn as_it_is(pose: [f64; N]) -> Self {
        Self {
            pose,
            has_gravity: true,
        }
    }

    /// The loop that was analysed.
    pub(super) fn linear(&self, control: &ControlLoop<N>) -> Linear {
        let linear = Linear::at_pose(control, &self.pose);
        if self.has_gravity {
            linear
        } else {
            linear.weightless()
        }
    }
}

/// The smallest limit of all poses and of a known one \[s\], with its pose; `None` if there is no limit. A pose that is
/// unstable in continuous time has a limit of zero. Without `sampling` such a pose is sought, and no other. The search
/// pauses after every pose.
pub(super) async fn smallest_of_all_poses<const N: usize>(
    control: ControlLoop<N>,
    sampling: Option<Sampling>,
    known: (Option<f64>, PoseCandidate<N>),
) -> (Option<f64>, PoseCandidate<N>) {
    let (smallest, worst) = known;
    let mut search = PoseSearch {
        control,
        sampling,
        smallest,
        worst,
    };
    search.run().await;
    (search.smallest, search.worst)
}

/// The most memory of a search \[bytes\]: the cells, and the list of cells from which the climbs start.
pub(super) const fn most_bytes<const N: usize>() -> usize {
    2 * cells::<N>() * size_of::<(PoseCandidate<N>, f64)>()
}

struct PoseSearch<const N: usize> {
    control: ControlLoop<N>,
    /// When the law runs for the sought limit; `None` if an unstable pose is sought.
    sampling: Option<Sampling>,
    /// The smallest so far \[s\]; `None` while there is no limit.
    smallest: Option<f64>,
    /// The pose of that value.
    worst: PoseCandidate<N>,
}

impl<const N: usize> PoseSearch<N> {
    async fn run(&mut self) {
        if self.sampling.is_some() {
            for (_, candidate) in grid_poses(self.turns()) {
                self.judge(&candidate);
                pause().await;
            }
            if self.smallest.is_none_or(|limit| limit == 0.0) {
                return;
            }
        }
        // The largest growth of every cell at the smallest limit.
        let mut cells: Vec<(PoseCandidate<N>, f64)> = Vec::new();
        for (cell, candidate) in grid_poses(self.turns()) {
            let growth = self.growth(&candidate);
            match cells.get_mut(cell) {
                Some(cell) if growth > cell.1 => *cell = (candidate, growth),
                Some(_) => {}
                None => cells.push((candidate, growth)),
            }
            pause().await;
            if self.is_found() {
                return;
            }
        }
        for start in summits::<N>(&cells).into_iter().rev() {
            self.climb(start).await;
            if self.is_found() {
                return;
            }
        }
    }

    /// Whether an unstable pose is sought and was found.
    fn is_found(&self) -> bool {
        self.sampling.is_none() && self.smallest.is_some()
    }

    /// Analyses per pose of the outer joints. Without gravity the angle of the first joint has no effect.
    fn turns(&self) -> usize {
        if self.control.arm.gravity() == 0.0 {
            1
        } else {
            DIRECTIONS + 1
        }
    }

    fn judge(&mut self, candidate: &PoseCandidate<N>) {
        let Some(sampling) = self.sampling else {
            return;
        };
        let linear = candidate.linear(&self.control);
        let stepping = Stepping::new(&linear, self.control.method, sampling);
        let passes = self.smallest.is_some_and(|limit| {
            PROBES
                .iter()
                .all(|part| limit == 0.0 || stepping.is_stable(part * limit))
        });
        if passes {
            return;
        }
        let modes = Modes::of(&linear);
        if candidate.has_gravity && modes.run_away() {
            return;
        }
        if let Some(limit) = stepping.search(&modes)
            && self.smallest.is_none_or(|smallest| limit < smallest)
        {
            self.smallest = Some(limit);
            self.worst = *candidate;
        }
    }

    /// Growth at the smallest limit so far, or in continuous time if an unstable pose is sought.
    fn growth(&mut self, candidate: &PoseCandidate<N>) -> f64 {
        let linear = candidate.linear(&self.control);
        let Some(sampling) = self.sampling else {
            let modes = Modes::of(&linear);
            if modes.run_away() {
                self.smallest = Some(0.0);
                self.worst = *candidate;
            }
            return modes.growth();
        };
        let growth = Stepping::new(&linear, self.control.method, sampling)
            .growth(self.smallest.unwrap_or(0.0));
        if growth > NEUTRAL && candidate.has_gravity && Modes::of(&linear).run_away() {
            f64::NEG_INFINITY
        } else {
            growth
        }
    }

    /// Ascends the growth to a local maximum, with one analysis per move.
    async fn climb(&mut self, mut at: PoseCandidate<N>) {
        let mut growth = self.growth(&at);
        let mut stride = 0.5 * TAU / ratio(grid::<N>(), 1);
        // The first joint has an effect only with gravity.
        let first = usize::from(!at.has_gravity);
        let directions = 2 * N.saturating_sub(first);
        // The next direction to try, and the number of consecutive failures.
        let (mut direction, mut failed) = (0, 0);
        for _ in 0..MAX_MOVES {
            if stride < SMALLEST_STRIDE || directions == 0 || self.is_found() {
                return;
            }
            pause().await;
            let sign = if direction % 2 == 0 { 1.0 } else { -1.0 };
            let mut next = at;
            next.pose[first + direction / 2] += sign * stride;
            let growth_there = self.growth(&next);
            if growth_there > growth {
                (at, growth, failed) = (next, growth_there, 0);
                if growth > NEUTRAL && self.sampling.is_some() {
                    self.judge(&at);
                    growth = self.growth(&at);
                }
            } else {
                direction = (direction + 1) % directions;
                failed += 1;
                if failed == directions {
                    failed = 0;
                    stride *= 0.5;
                }
            }
        }
    }
}

/// The poses of the grid with the cell of each, `turns` poses to a cell: first without gravity, then, if there is any,
/// with it in every direction.
fn grid_poses<const N: usize>(turns: usize) -> impl Iterator<Item = (usize, PoseCandidate<N>)> {
    (0..).map_while(move |index| {
        let (cell, turn) = (index / turns, index % turns);
        let mut pose = outer_pose::<N>(cell)?;
        if turn > 0
            && let Some(first) = pose.first_mut()
        {
            *first = part_of_turn(turn - 1, DIRECTIONS);
        }
        let has_gravity = turn > 0;
        Some((cell, PoseCandidate { pose, has_gravity }))
    })
}

/// Local maxima: cells whose growth is at least that of all neighbours.
fn summits<const N: usize>(cells: &[(PoseCandidate<N>, f64)]) -> Vec<PoseCandidate<N>> {
    let (half, whole) = (grid::<N>() / 2 + 1, grid::<N>());
    let stands_out = |index: usize| {
        let mut apart = 1;
        (1..N).all(|joint| {
            let length = if joint == 1 { half } else { whole };
            let (stride, digit) = (apart, index / apart % length);
            apart *= length;
            // The second joint covers a half circle, whose ends have one neighbour.
            let beside = if joint == 1 {
                [digit.saturating_sub(1), (digit + 1).min(length - 1)]
            } else {
                [(digit + length - 1) % length, (digit + 1) % length]
            };
            beside.iter().all(|beside| {
                let neighbour = cells.get(index - digit * stride + beside * stride);
                neighbour.is_none_or(|neighbour| neighbour.1 <= cells[index].1)
            })
        })
    };
    (0..cells.len())
        .filter(|&index| stands_out(index))
        .map(|index| cells[index].0)
        .collect()
}

/// Number of poses of the outer joints.
const fn cells<const N: usize>() -> usize {
    let (mut cells, mut joint) = (grid::<N>() / 2 + 1, 2);
    while joint < N {
        (cells, joint) = (cells * grid::<N>(), joint + 1);
    }
    cells
}

/// One of the poses of the outer joints, the first joint at zero; `None` beyond the last. By mirror symmetry about the
/// vertical the second joint needs only half of its circle.
fn outer_pose<const N: usize>(index: usize) -> Option<[f64; N]> {
    let half = grid::<N>() / 2 + 1;
    let mut index = Some(index).filter(|index| *index < cells::<N>())?;
    Some(std::array::from_fn(|joint| match joint {
        0 => 0.0,
        1 => {
            let digit = index % half;
            index /= half;
            PI * ratio(digit, grid::<N>() / 2)
        }
        _ => {
            let digit = index % grid::<N>();
            index /= grid::<N>();
            part_of_turn(digit, grid::<N>())
        }
    }))
}

/// `part / whole` of a turn, from -π \[rad\].
fn part_of_turn(part: usize, whole: usize) -> f64 {
    TAU * ratio(part, whole) - PI
}

fn ratio(part: usize, whole: usize) -> f64 {
    length_in_f64(part) / length_in_f64(whole)
}
