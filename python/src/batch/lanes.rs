//! Many arms side by side, one per lane: simulations that share SIMD registers and threads.
//!
//! **Invariant:** lanes are independent, so a lane is bit-identical to a single arm, for any number of threads.

use pyo3::prelude::PyResult;
use rayon::prelude::*;

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::energy;
use pendularm::math::kinematics::forward;
use pendularm::math::pid::Gains;
use pendularm::math::simulation::{Simulation, batch};

use super::given::of_arm;
use crate::arrays::{Rows, collected};
use crate::floats::Promised;

/// Fewest lane-steps per additional thread: some tens of microseconds.
const WORTH_A_THREAD: u64 = 3000;

/// Lanes per task of a thread: at least enough to fill the registers, and few enough that all threads have work.
const TOGETHER: (usize, usize) = (32, 1024);

/// The arrays of the lanes' values, one row each.
pub(crate) struct Shown<'a> {
    pub(crate) position: &'a mut [f64],
    pub(crate) velocity: &'a mut [f64],
    pub(crate) effort: &'a mut [f64],
    pub(crate) time: &'a mut [f64],
    pub(crate) diverged: &'a mut [bool],
}

impl Shown<'_> {
    /// Updates the rows from the lanes.
    pub(crate) fn show<const N: usize>(self, lanes: &[Simulation<N>]) {
        let rows = self
            .position
            .chunks_exact_mut(N)
            .zip(self.velocity.chunks_exact_mut(N))
            .zip(self.effort.chunks_exact_mut(N))
            .zip(self.time)
            .zip(self.diverged);
        for (one, ((((shown_position, shown_velocity), effort), time), diverged)) in
            lanes.iter().zip(rows)
        {
            let State { position, velocity } = one.state();
            shown_position.copy_from_slice(position);
            shown_velocity.copy_from_slice(velocity);
            effort.copy_from_slice(one.effort());
            *time = one.time();
            *diverged = one.divergence().is_some();
        }
    }
}

/// A part of the lanes' steps.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Piece<'a> {
    /// The number of steps of every lane, or one per lane.
    pub(crate) steps: &'a [u64],
    /// Effort that is applied in all these steps, in place of the controller's.
    pub(crate) effort: Option<&'a Rows<'a>>,
    /// The number of steps already taken, and of those taken now.
    pub(crate) done: u64,
    pub(crate) length: u64,
    /// Whether threads may share the lanes.
    pub(crate) is_shared: bool,
}

/// Takes a part of the steps, and updates the arrays.
pub(crate) fn advance<const N: usize>(
    lanes: &mut [Simulation<N>],
    shown: Shown<'_>,
    piece: Piece<'_>,
) {
    if !piece.is_shared {
        return piece.take(0, lanes, shown);
    }
    let fewest = usize::try_from(WORTH_A_THREAD.div_ceil(piece.length.max(1)));
    let share = lanes.len().div_ceil(4 * rayon::current_num_threads());
    let (least, most) = TOGETHER;
    let each = share.clamp(least, most).max(fewest.unwrap_or(usize::MAX));
    if lanes.len() < 2 * each {
        return piece.take(0, lanes, shown);
    }
    let shares = lanes
        .par_chunks_mut(each)
        .zip(shown.position.par_chunks_mut(each * N))
        .zip(shown.velocity.par_chunks_mut(each * N))
        .zip(shown.effort.par_chunks_mut(each * N))
        .zip(shown.time.par_chunks_mut(each))
        .zip(shown.diverged.par_chunks_mut(each));
    shares.enumerate().for_each(
        |(index, (((((lanes, position), velocity), effort), time), diverged))| {
            let shown = Shown {
                position,
                velocity,
                effort,
                time,
                diverged,
            };
            piece.take(index * each, lanes, shown);
        },
    );
}

impl Piece<'_> {
    /// Takes it with the lanes of this slice.
    fn take<const N: usize>(&self, first: usize, lanes: &mut [Simulation<N>], shown: Shown<'_>) {
        // This may be a thread of the pool.
        let _floats = Promised::begin();
        self.drive(first, lanes, true);
        let each = lanes.iter_mut().enumerate();
        batch::advance(each.map(|(index, lane)| (lane, self.left(first + index))));
        self.drive(first, lanes, false);
        shown.show(lanes);
    }

    /// Begins or ends the effort in the lanes that take steps.
    fn drive<const N: usize>(&self, first: usize, lanes: &mut [Simulation<N>], begins: bool) {
        let Some(effort) = self.effort else {
            return;
        };
        for (index, lane) in lanes.iter_mut().enumerate() {
            if self.left(first + index) > 0 {
                lane.drive(begins.then(|| effort.row(first + index)));
            }
        }
    }

    /// The number of steps of a lane in this piece.
    fn left(&self, lane: usize) -> u64 {
        let steps = of_arm(self.steps, lane).unwrap_or(0);
        steps.saturating_sub(self.done).min(self.length)
    }
}

/// Kinetic plus potential energy of every lane \[J\].
pub(crate) fn energies<const N: usize>(lanes: &[Simulation<N>]) -> PyResult<Vec<f64>> {
    let energies = lanes.iter().map(|one| energy(one.arm(), one.state()));
    collected(lanes.len(), energies)
}

/// The end effector of every lane \[m\], x and y in turn.
pub(crate) fn end_effectors<const N: usize>(lanes: &[Simulation<N>]) -> PyResult<Vec<f64>> {
    let tips = lanes
        .iter()
        .map(|one| forward(one.arm().lengths(), &one.state().position));
    let numbers = tips.flat_map(|tip| tip.position.to_array());
    collected(2 * lanes.len(), numbers)
}

/// Arms in the starting pose, as in a fresh runtime.
pub(crate) fn fresh<const N: usize>(arms: usize) -> PyResult<Vec<Simulation<N>>> {
    let fresh = Simulation::new(Arm::default(), Gains::default());
    collected(arms, std::iter::repeat_n(fresh, arms))
}
