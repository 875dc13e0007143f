//! Accelerations of one arm in many states, with one SIMD lane per state.
//!
//! Input and output are columns, one slice per joint, so registers are loaded without a shuffle.
//!
//! **Invariant:** every result is bit-identical to [`super::forward_dynamics`], in every batch.

#![allow(
    clippy::indexing_slicing,
    reason = "joints run over 0..N of arrays that have N elements, states over those that every column has"
)]

use fearless_simd::{Simd, SimdBase, dispatch};

use super::articulated_body::recursion_along;
use crate::math::arm::{Arm, Rod};
use crate::math::number::{Arithmetic, Number, Registers, Wide, entries};
use crate::math::trig;

/// One column per joint. Entry `k` of each column belongs to state `k`.
pub type Columns<'a, const N: usize> = [&'a [f64]; N];

impl Registers {
    /// Computes [`forward_dynamics`] with registers of one width.
    pub fn forward_dynamics<const N: usize>(
        self,
        arm: &Arm<N>,
        q: Columns<'_, N>,
        qd: Columns<'_, N>,
        tau: Columns<'_, N>,
        mut qdd: [&mut [f64]; N],
    ) {
        let given = [q, qd, tau];
        let lengths = given.iter().flatten().map(|column| column.len());
        let count = lengths.chain(qdd.iter().map(|column| column.len())).min();
        let count = count.unwrap_or(0);
        let given = given.map(|columns| columns.map(|column| &column[..count]));
        let mut qdd = qdd.each_mut().map(|column| &mut column[..count]);
        if count < 2 * self.lanes() {
            let [q, qd, tau] = given;
            for at in 0..count {
                alone(arm, q.map(|column| column[at]), [qd, tau], &mut qdd, at);
            }
        } else {
            dispatch!(self.level(), simd => in_registers(simd, arm, given, &mut qdd, count));
        }
    }
}

/// Joint accelerations \[rad/s²\] at positions `q` \[rad\] and rates `qd` \[rad/s\] under the efforts `tau` \[N m\].
/// The shortest column decides the number of states. Entries of `qdd` beyond it do not change.
///
/// Never panics. A result is finite exactly if [`super::forward_dynamics`] returns a finite one.
///
/// ```
/// use pendularm::math::{arm::Arm, dynamics::batch};
///
/// let (q, qd, tau) = ([0.3; 100], [0.0; 100], [1.0; 100]);
/// let (mut first, mut second) = ([0.0; 100], [0.0; 100]);
/// batch::forward_dynamics(
///     &Arm::<2>::default(),
///     [&q, &q],
///     [&qd, &qd],
///     [&tau, &tau],
///     [&mut first, &mut second],
/// );
/// assert!(first.iter().all(|acceleration| *acceleration < 0.0));
/// ```
pub fn forward_dynamics<const N: usize>(
    arm: &Arm<N>,
    q: Columns<'_, N>,
    qd: Columns<'_, N>,
    tau: Columns<'_, N>,
    qdd: [&mut [f64]; N],
) {
    Registers::widest().forward_dynamics(arm, q, qd, tau, qdd);
}

/// Computes the states in the lanes of `q` one by one. They are too few to fill the registers, or an angle is beyond the
/// limit of the sines. Because `q` is passed by value, the compiler aligns the caller's stack, so no register is stored
/// across two cache lines.
#[inline(never)]
fn alone<T: Number, const N: usize>(
    arm: &Arm<N>,
    q: [T; N],
    given: [Columns<'_, N>; 2],
    qdd: &mut [&mut [f64]; N],
    at: usize,
) {
    for lane in 0..T::LANES {
        let q = entries!(0.0, i => q[i].lane(lane));
        let [qd, tau] = given.map(|columns| columns.map(|column| column[at + lane]));
        let accelerations = super::forward_dynamics(arm, &q, &qd, &tau);
        for (column, acceleration) in qdd.iter_mut().zip(accelerations) {
            column[at + lane] = acceleration;
        }
    }
}

/// Processes two registers at a time if the machine has enough of them. The second one hides the latency of the first;
/// with only 16 registers it costs more than it saves.
#[inline(always)]
fn in_registers<S: Simd, const N: usize>(
    simd: S,
    arm: &Arm<N>,
    given: [Columns<'_, N>; 3],
    qdd: &mut [&mut [f64]; N],
    count: usize,
) {
    if S::f64s::LEN >= 8 {
        together::<S, 2, N>(simd, arm, given, qdd, count);
    } else {
        together::<S, 1, N>(simd, arm, given, qdd, count);
    }
}

/// Processes all states in order. If the last states do not fill their registers, those start earlier, and some states
/// are computed twice.
#[inline(always)]
fn together<S: Simd, const K: usize, const N: usize>(
    simd: S,
    arm: &Arm<N>,
    [q, qd, tau]: [Columns<'_, N>; 3],
    qdd: &mut [&mut [f64]; N],
    count: usize,
) {
    let lanes = Wide::<S, K>::LANES;
    // One length for all columns, so that it is compared once and not for every load.
    let [q, qd, tau] = [q, qd, tau].map(|columns| columns.map(|column| &column[..count]));
    let mut qdd = qdd.each_mut().map(|column| &mut column[..count]);
    let zero = Wide::<S, K>::splat(simd, 0.0);
    let gravity = zero.like(arm.gravity);
    let rods = entries!(in_lanes(&arm.rods[0], zero), i => in_lanes(&arm.rods[i], zero));
    let mut next = 0;
    while next < count {
        let at = next.min(count - lanes);
        let q = entries!(zero, i => Wide::<S, K>::load(simd, &q[i][at..]));
        next += lanes;
        // Angles are checked first. Then sines and recursion are one block, and the compiler can mix their operations.
        if !Wide::all_within(&q, trig::LIMIT) {
            alone(arm, q, [qd, tau], &mut qdd, at);
            continue;
        }
        let (sin, cos) = trig::sin_cos_within(&q);
        let qd = entries!(zero, i => Wide::<S, K>::load(simd, &qd[i][at..]));
        let tau = entries!(zero, i => Wide::<S, K>::load(simd, &tau[i][at..]));
        let accelerations = recursion_along::<_, N, true>(&rods, &gravity, (&sin, &cos), &qd, &tau);
        for i in 0..N {
            accelerations[i].store(&mut qdd[i][at..]);
        }
    }
}

/// The same rod in all lanes.
#[inline(always)]
fn in_lanes<T: Number>(rod: &Rod, any: T) -> Rod<T> {
    Rod {
        length: any.like(rod.length),
        beyond: any.like(rod.beyond),
        mass_ratio: any.like(rod.mass_ratio),
        per_length: any.like(rod.per_length),
        per_mass_length: any.like(rod.per_mass_length),
    }
}
