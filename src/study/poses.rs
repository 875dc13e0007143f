//! The smallest timestep limit over all poses. It holds on the way from one setpoint to another, where other limits may
//! not.
//!
//! Inertia depends on every joint but the first, the gravity load on all of them. The loop is analysed at every pose of
//! a grid over the outer joints: without gravity, and, if there is gravity, with it for a ring of first joint angles.
//! Then the poses in between are searched. A climb starts from every local maximum of the grid and ascends the growth
//! at the smallest limit so far. If a mode grows at a pose, its limit is smaller. Poses that are unstable in continuous
//! time because of gravity are left out, since no timestep stabilises them. Without gravity they count, since the gains
//! are then the cause. A free arm has no gains, so only poses with gravity count.
//!
//! An arm whose joints integrate can be sent to every pose, also to unstable ones. Towards the border of unstable poses
//! the limit falls to zero. They are therefore searched first, by ascending the largest real part of any mode in
//! continuous time.
//!
//! **Invariant:** the work is bounded: the poses of the grid, and at most one climb from each pose of the outer joints.

use std::f64::consts::{PI, TAU};

use super::control_loop::ControlLoop;
use super::linear::Linear;
use super::paused::pause;
use super::stability::{Modes, NEUTRAL, Sampling, Stepping};

/// Angles of the first joint for the gravity load, among them hanging and upright.
const DIRECTIONS: u32 = 8;

/// Parts of the smallest limit so far. A pose that is stable at all of them needs no search of its own.
const PROBES: [f64; 3] = [1.0, 0.6, 0.2];

/// Smallest stride of a climb \[rad\]: near a maximum the limit then changes by a millionth.
const SMALLEST_STRIDE: f64 = 1e-3;

/// Most moves of one climb.
const MAX_MOVES: u32 = 400;

/// Angles around the circle of each outer joint; even, so that stretched and folded are among them.
const fn around<const N: usize>() -> u32 {
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

/// The smallest limit of all poses and of a known one \[s\], with its pose; `None` if there is no limit. Without
/// `sampling` only a pose that is unstable in continuous time is sought; its limit is zero. The search pauses after
/// every pose.
pub(super) async fn smallest_of_all_poses<const N: usize>(
    control: ControlLoop<N>,
    sampling: Option<Sampling>,
    known: (Option<f64>, PoseCandidate<N>),
) -> (Option<f64>, PoseCandidate<N>) {
    let mut search = PoseSearch {
        control,
        sampling,
        least: known,
    };
    search.run().await;
    search.least
}

struct PoseSearch<const N: usize> {
    control: ControlLoop<N>,
    /// When the law runs for the sought limit; `None` if an unstable pose is sought.
    sampling: Option<Sampling>,
    /// The smallest so far \[s\], `None` while there is no limit, and its pose.
    least: (Option<f64>, PoseCandidate<N>),
}

impl<const N: usize> PoseSearch<N> {
    async fn run(&mut self) {
        let outer = outer_poses::<N>();
        if self.sampling.is_some() {
            for pose in &outer {
                for candidate in self.turned(pose) {
                    self.judge(&candidate);
                    pause().await;
                }
            }
            if self.least.0.is_none_or(|limit| limit == 0.0) {
                return;
            }
        }
        // For every pose of the outer joints, the largest growth at the smallest limit.
        let mut worst: Vec<(PoseCandidate<N>, f64)> = Vec::new();
        for pose in &outer {
            let mut here = (PoseCandidate::as_it_is(*pose), f64::NEG_INFINITY);
            for candidate in self.turned(pose) {
                let growth = self.growth(&candidate);
                if growth > here.1 {
                    here = (candidate, growth);
                }
                pause().await;
                if self.is_found() {
                    return;
                }
            }
            worst.push(here);
        }
        for start in summits(&worst).into_iter().rev() {
            self.climb(start).await;
            if self.is_found() {
                return;
            }
        }
    }

    /// Whether an unstable pose is sought and was found.
    fn is_found(&self) -> bool {
        self.sampling.is_none() && self.least.0.is_some()
    }

    /// A pose of the outer joints without gravity, where the angle of the first joint has no effect. If there is
    /// gravity, also with it in every direction.
    fn turned(&self, outer: &[f64; N]) -> impl Iterator<Item = PoseCandidate<N>> + use<N> {
        let weightless = PoseCandidate {
            pose: *outer,
            has_gravity: false,
        };
        let has_gravity = self.control.arm.gravity() > 0.0;
        let directions = if has_gravity { DIRECTIONS } else { 0 };
        let heavy = (0..directions).map(move |part| {
            let mut turned = PoseCandidate::as_it_is(weightless.pose);
            turned.pose[0] = part_of_turn(part, DIRECTIONS);
            turned
        });
        // Without gravity a free arm only drifts.
        let drifts = has_gravity && self.control.is_free();
        std::iter::once(weightless)
            .skip(usize::from(drifts))
            .chain(heavy)
    }

    fn judge(&mut self, candidate: &PoseCandidate<N>) {
        let Some(sampling) = self.sampling else {
            return;
        };
        let linear = candidate.linear(&self.control);
        let stepping = Stepping::of(&linear, &self.control, sampling);
        let passes = self.least.0.is_some_and(|limit| {
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
            && self.least.0.is_none_or(|smallest| limit < smallest)
        {
            self.least = (Some(limit), *candidate);
        }
    }

    /// Growth at the smallest limit so far, or in continuous time if an unstable pose is sought.
    fn growth(&mut self, candidate: &PoseCandidate<N>) -> f64 {
        let linear = candidate.linear(&self.control);
        let Some(sampling) = self.sampling else {
            let modes = Modes::of(&linear);
            if modes.clearly_grow() {
                self.least = (Some(0.0), *candidate);
            }
            return modes.growth();
        };
        let growth =
            Stepping::of(&linear, &self.control, sampling).growth(self.least.0.unwrap_or(0.0));
        if growth > NEUTRAL && candidate.has_gravity && Modes::of(&linear).run_away() {
            f64::NEG_INFINITY
        } else {
            growth
        }
    }

    /// Ascends the growth to a local maximum, with one analysis per move.
    async fn climb(&mut self, mut at: PoseCandidate<N>) {
        let mut growth = self.growth(&at);
        let mut stride = PI / f64::from(around::<N>());
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

/// The grid of the outer joints, with the first joint at zero. By mirror symmetry about the vertical the second joint
/// needs only half of its circle.
fn outer_poses<const N: usize>() -> Vec<[f64; N]> {
    let whole = around::<N>();
    let mut poses = vec![[0.0; N]];
    for joint in (1..N).rev() {
        let first = if joint == 1 { whole / 2 } else { 0 };
        let turned = |mut pose: [f64; N]| {
            (first..whole + u32::from(joint == 1)).map(move |part| {
                pose[joint] = part_of_turn(part, whole);
                pose
            })
        };
        poses = poses.into_iter().flat_map(turned).collect();
    }
    poses
}

/// Local maxima: poses of the grid at which the growth is at least that of all neighbours.
fn summits<const N: usize>(worst: &[(PoseCandidate<N>, f64)]) -> Vec<PoseCandidate<N>> {
    let spacing = TAU / f64::from(around::<N>());
    // Neighbours differ in one angle.
    let is_beside = |one: &PoseCandidate<N>, other: &PoseCandidate<N>| {
        let apart = (1..N).map(|joint| (one.pose[joint] - other.pose[joint]).abs());
        apart.map(|apart| apart.min(TAU - apart)).sum::<f64>() < 1.5 * spacing
    };
    let is_summit = |(pose, growth): &&(PoseCandidate<N>, f64)| {
        let mut others = worst.iter().filter(|other| is_beside(pose, &other.0));
        others.all(|other| other.1 <= *growth)
    };
    worst.iter().filter(is_summit).map(|pose| pose.0).collect()
}

/// `part / whole` of a turn, from -π \[rad\].
fn part_of_turn(part: u32, whole: u32) -> f64 {
    TAU * (f64::from(part) / f64::from(whole)) - PI
}
