//! Runs whose end effector is looked at in even intervals.
//!
//! **Invariant:** a run goes on by pieces, and a piece is a fraction of a millisecond (optimised build).

use glam::DVec2;

use super::continuous::ContinuousLoop;
use super::follower::Follower;
use super::matrix::largest;
use crate::math::arm::{Arm, State};
use crate::math::kinematics::forward;
use crate::math::simulation::Simulation;

/// Steps between two returns to the caller.
const STEPS_PER_PIECE: u64 = 500;

/// Coefficients of a followed arm's series between two returns to the caller, and some more.
const COEFFICIENTS_PER_PIECE: u64 = 2000;

/// Most coefficients of a followed arm: seconds of one core.
const MAX_COEFFICIENTS: u64 = 20_000_000;

/// A loop that can be stepped and seen.
pub(super) trait Steppable {
    fn step(&mut self) -> bool;
    fn end_effector(&self) -> DVec2;
}

impl<const N: usize> Steppable for ContinuousLoop<N> {
    fn step(&mut self) -> bool {
        ContinuousLoop::step(self)
    }

    fn end_effector(&self) -> DVec2 {
        forward(self.control.arm.lengths(), &self.state.position).position
    }
}

impl<const N: usize> Steppable for Simulation<N> {
    fn step(&mut self) -> bool {
        Simulation::step(self)
    }

    fn end_effector(&self) -> DVec2 {
        forward(self.arm().lengths(), &self.state().position).position
    }
}

/// A run on its way, with the end effector at the samples so far.
#[derive(Debug, Clone)]
pub(super) struct Followed<S> {
    stepped: S,
    /// Steps between two samples.
    pub(super) per_sample: u64,
    steps: u64,
    /// The end effector at the samples so far \[m\].
    pub(super) track: Vec<DVec2>,
}

impl<S: Steppable> Followed<S> {
    pub(super) fn new(stepped: S, per_sample: u64) -> Self {
        Self {
            stepped,
            per_sample,
            steps: 0,
            track: Vec::new(),
        }
    }

    /// Goes on by a piece: `None` while there is more to come, `Some(false)` once numbers have ended.
    pub(super) fn advance(&mut self, samples: u64) -> Option<bool> {
        for _ in 0..STEPS_PER_PIECE {
            if self.steps == samples * self.per_sample {
                return Some(true);
            }
            if !self.stepped.step() {
                return Some(false);
            }
            self.steps += 1;
            if self.steps.is_multiple_of(self.per_sample) {
                self.track.push(self.stepped.end_effector());
            }
        }
        None
    }
}

/// An arm left to itself, on its way within a tolerance, with the end effector at the samples so far.
#[derive(Debug, Clone)]
pub(super) struct FreeMotion<const N: usize> {
    arm: Arm<N>,
    follower: Follower<N>,
    pub(super) tolerance: f64,
    /// Time between two samples \[s\].
    spacing: f64,
    /// Whether the way to the next sample is begun.
    begun: bool,
    /// The end effector at the samples so far \[m\].
    pub(super) track: Vec<DVec2>,
}

impl<const N: usize> FreeMotion<N> {
    pub(super) fn new(arm: Arm<N>, start: State<N>, spacing: f64, tolerance: f64) -> Self {
        Self {
            arm,
            follower: Follower::within(start, tolerance),
            tolerance,
            spacing,
            begun: false,
            track: Vec::new(),
        }
    }

    /// Goes on by a piece: `None` while there is more to come, `Some(false)` if it can not be followed.
    pub(super) fn advance(&mut self, samples: u64) -> Option<bool> {
        let bound = self.follower.coefficients() + COEFFICIENTS_PER_PIECE;
        while (self.track.len() as u64) < samples {
            if !self.begun {
                self.follower.begin(self.spacing);
                self.begun = true;
            }
            let followed = self.follower.go_on(&self.arm, &[0.0; N], bound)?;
            if !followed || self.follower.coefficients() > MAX_COEFFICIENTS {
                return Some(false);
            }
            self.begun = false;
            let pose = forward(self.arm.lengths(), &self.follower.state().position);
            self.track.push(pose.position);
        }
        Some(true)
    }
}

/// The largest distance between two tracks that begin at one point \[m\].
///
/// It may be largest between two samples: a parabola through three of them rises above the middle one by at most an
/// eighth of their second difference, which is added.
pub(super) fn apart(one: &[DVec2], other: &[DVec2]) -> f64 {
    if one.len() != other.len() {
        return f64::INFINITY;
    }
    let differences = one.iter().zip(other).map(|(one, other)| *one - *other);
    let differences: Vec<DVec2> = std::iter::once(DVec2::ZERO).chain(differences).collect();
    let rises = differences.windows(3).map(|three| match three {
        [before, here, after] => (*before - 2.0 * *here + *after).length() / 8.0,
        _ => 0.0,
    });
    let rises = rises.chain(std::iter::once(0.0));
    let here = differences
        .iter()
        .skip(1)
        .map(|difference| difference.length());
    largest(here.zip(rises).map(|(here, rise)| here + rise))
}
