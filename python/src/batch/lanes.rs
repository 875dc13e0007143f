//! Many arms side by side, each a lane: the same simulation that steps one arm, as often as there are lanes.
//!
//! **Invariant:** no lane knows of another, so that a lane has the bits of a single arm, however many threads share
//! the work.

use rayon::prelude::*;

use pendularm::math::arm::{Arm, State};
use pendularm::math::count::in_f64;
use pendularm::math::dynamics::energy;
use pendularm::math::kinematics::forward;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::Simulation;

use crate::fields::Rows;

/// Fewest lane-steps that are worth another thread: some tens of microseconds.
const WORTH_A_THREAD: u64 = 500;

/// The arrays that show the lanes, one row each.
pub(crate) struct Shown<'a> {
    pub(crate) position: &'a mut [f64],
    pub(crate) velocity: &'a mut [f64],
    pub(crate) effort: &'a mut [f64],
    pub(crate) time: &'a mut [f64],
    pub(crate) diverged: &'a mut [bool],
}

/// One lane with the rows that show it.
struct Lane<'a, const N: usize> {
    simulation: &'a mut Simulation<N>,
    position: &'a mut [f64],
    velocity: &'a mut [f64],
    effort: &'a mut [f64],
    time: &'a mut f64,
    diverged: &'a mut bool,
}

impl<const N: usize> Lane<'_, N> {
    fn show(&mut self) {
        let State { position, velocity } = self.simulation.state();
        self.position.copy_from_slice(position);
        self.velocity.copy_from_slice(velocity);
        self.effort.copy_from_slice(self.simulation.effort());
        *self.time = self.simulation.time();
        *self.diverged = self.simulation.divergence().is_some();
    }
}

/// Steps that are to be taken, lane by lane or in all alike.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Steps<'a> {
    Alike(u64),
    Each(&'a [u64]),
}

impl Steps<'_> {
    pub(crate) fn of(&self, lane: usize) -> u64 {
        match self {
            Self::Alike(steps) => *steps,
            Self::Each(steps) => steps.get(lane).copied().unwrap_or(0),
        }
    }

    /// The most that any lane takes.
    pub(crate) fn most(&self) -> u64 {
        match self {
            Self::Alike(steps) => *steps,
            Self::Each(steps) => steps.iter().copied().max().unwrap_or(0),
        }
    }
}

/// A piece of the steps that the lanes are to take.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece<'a> {
    pub(crate) steps: Steps<'a>,
    /// Effort that is added in all these steps, in place of what disturbs a lane.
    pub(crate) effort: Option<&'a Rows<'a>>,
    /// Steps that have been taken, and how many more are taken now.
    pub(crate) done: u64,
    pub(crate) length: u64,
    /// Whether threads may share the lanes.
    pub(crate) is_shared: bool,
}

/// Takes a piece of the steps, and shows where that leads.
pub(crate) fn advance<const N: usize>(
    lanes: &mut [Simulation<N>],
    shown: Shown<'_>,
    piece: Piece<'_>,
) {
    let step = |(index, mut lane): (usize, Lane<'_, N>)| {
        let steps = piece.steps.of(index);
        if piece.done == 0
            && steps > 0
            && let Some(effort) = piece.effort
        {
            let duration = in_f64(steps) * lane.simulation.timestep();
            lane.simulation.disturb(effort.row(index), duration);
        }
        let left = steps.saturating_sub(piece.done);
        lane.simulation.advance(left.min(piece.length));
        lane.show();
    };
    let fewest = WORTH_A_THREAD.div_ceil(piece.length.max(1));
    let lanes_each = usize::try_from(fewest).unwrap_or(usize::MAX);
    if piece.is_shared && lanes.len() >= 2 * lanes_each {
        let Shown {
            position,
            velocity,
            effort,
            time,
            diverged,
        } = shown;
        lanes
            .par_iter_mut()
            .zip(position.par_chunks_exact_mut(N))
            .zip(velocity.par_chunks_exact_mut(N))
            .zip(effort.par_chunks_exact_mut(N))
            .zip(time.par_iter_mut())
            .zip(diverged.par_iter_mut())
            .map(
                |(((((simulation, position), velocity), effort), time), diverged)| Lane {
                    simulation,
                    position,
                    velocity,
                    effort,
                    time,
                    diverged,
                },
            )
            .enumerate()
            .with_min_len(lanes_each)
            .for_each(step);
    } else {
        each(lanes, shown).enumerate().for_each(step);
    }
}

/// Brings the arrays up to date, after a change that was no step.
pub(crate) fn show<const N: usize>(lanes: &mut [Simulation<N>], shown: Shown<'_>) {
    each(lanes, shown).for_each(|mut lane| lane.show());
}

fn each<'a, const N: usize>(
    lanes: &'a mut [Simulation<N>],
    shown: Shown<'a>,
) -> impl Iterator<Item = Lane<'a, N>> {
    let Shown {
        position,
        velocity,
        effort,
        time,
        diverged,
    } = shown;
    lanes
        .iter_mut()
        .zip(position.chunks_exact_mut(N))
        .zip(velocity.chunks_exact_mut(N))
        .zip(effort.chunks_exact_mut(N))
        .zip(time)
        .zip(diverged)
        .map(
            |(((((simulation, position), velocity), effort), time), diverged)| Lane {
                simulation,
                position,
                velocity,
                effort,
                time,
                diverged,
            },
        )
}

/// Kinetic plus potential energy of every lane \[J\].
pub(crate) fn energies<const N: usize>(lanes: &[Simulation<N>]) -> Vec<f64> {
    lanes
        .iter()
        .map(|one| energy(one.arm(), one.state()))
        .collect()
}

/// The end effector of every lane \[m\], x and y in turn.
pub(crate) fn end_effectors<const N: usize>(lanes: &[Simulation<N>]) -> Vec<f64> {
    let tips = lanes
        .iter()
        .map(|one| forward(one.arm().lengths(), &one.state().position));
    tips.flat_map(|tip| tip.position.to_array()).collect()
}

/// Arms in the starting pose, as a fresh runtime has one.
pub(crate) fn fresh<const N: usize>(arms: usize) -> Vec<Simulation<N>>
where
    Gains<N>: Default,
{
    vec![Simulation::new(Arm::default(), Gains::default()); arms]
}
