//! The arm under constant efforts, followed to rounding: Gragg's midpoint rule extrapolated to vanishing steps.
//!
//! Over a span the rule is run with 2, 4, 6, … steps; its error is a series in the square of the step, which the
//! Aitken-Neville scheme removes term by term until two results agree. A span on which they don't is cut in two.
//!
//! Source: Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I* (1993), ch. II.9.
//!
//! **Invariant:** another path than any of the methods under study; the work of a span is bounded.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N, and over rows 0..ROWS of the scheme"
)]

use super::matrix::largest;
use crate::math::arm::{Arm, State};
use crate::math::dynamics::forward_dynamics;
use crate::math::integrator::two_sum;

/// Rows of the scheme; the last has order 16.
const ROWS: usize = 8;

/// Two results agree if they differ by so little, relative to what the span changes: some ten times what rounding
/// leaves.
const TOLERANCE: f64 = 3e-15;

/// How often a span may be halved. A timestep of a second is followed in spans of a millisecond.
const MAX_HALVINGS: u32 = 10;

/// Evaluations after which a span is given up: the motion is too wild to be followed.
const MAX_EVALUATIONS: u64 = 20_000;

/// An arm that is followed, rounding errors carried along.
#[derive(Debug, Clone, PartialEq)]
pub struct Follower<const N: usize> {
    state: State<N>,
    carry: State<N>,
    evaluations: u64,
    ahead: Ahead,
}

/// The rest of a span: parts still ahead, each a power of two of it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Ahead {
    /// The whole span \[s\].
    span: f64,
    /// How often it is halved for the next part.
    halvings: u32,
    /// How many parts of that size remain.
    remaining: u64,
    /// Evaluations after which it is given up.
    bound: u64,
}

/// The change of positions and velocities over a span.
type Change<const N: usize> = ([f64; N], [f64; N]);

impl<const N: usize> Follower<N> {
    /// An arm in the given state.
    #[must_use]
    pub fn new(state: State<N>) -> Self {
        Self {
            state,
            carry: State::rest(),
            evaluations: 0,
            ahead: Ahead::default(),
        }
    }

    /// The arm's state.
    #[must_use]
    pub fn state(&self) -> &State<N> {
        &self.state
    }

    /// Evaluations of the dynamics so far.
    #[must_use]
    pub fn evaluations(&self) -> u64 {
        self.evaluations
    }

    /// Follows the arm under `effort` \[N m\] for `span` \[s\]; `false` if it could not be followed, and is somewhere
    /// on the way.
    pub fn follow(&mut self, arm: &Arm<N>, effort: &[f64; N], span: f64) -> bool {
        self.begin(span);
        self.go_on(arm, effort, u64::MAX).unwrap_or(false)
    }

    /// A span \[s\] lies ahead, to be followed by [`Follower::go_on`].
    pub(super) fn begin(&mut self, span: f64) {
        self.ahead = Ahead {
            span,
            halvings: 0,
            remaining: 1,
            bound: self.evaluations.saturating_add(MAX_EVALUATIONS),
        };
    }

    /// Goes on with the span until there have been so many `evaluations` in all, or some more; none while it is not
    /// over, `false` if it could not be followed.
    pub(super) fn go_on(
        &mut self,
        arm: &Arm<N>,
        effort: &[f64; N],
        evaluations: u64,
    ) -> Option<bool> {
        while self.ahead.remaining > 0 {
            if self.evaluations > self.ahead.bound {
                return Some(false);
            }
            if self.evaluations >= evaluations {
                return None;
            }
            let halvings = i32::try_from(self.ahead.halvings).unwrap_or(i32::MAX);
            let part = self.ahead.span * 0.5_f64.powi(halvings);
            let change = self.extrapolate(arm, effort, part);
            let ahead = &mut self.ahead;
            match change {
                Some(change) => {
                    ahead.remaining -= 1;
                    // Longer parts again where they fit.
                    while ahead.halvings > 0
                        && ahead.remaining.is_multiple_of(2)
                        && ahead.remaining > 0
                    {
                        ahead.halvings -= 1;
                        ahead.remaining /= 2;
                    }
                    self.add(&change);
                }
                None if ahead.halvings == MAX_HALVINGS => return Some(false),
                None => {
                    ahead.halvings += 1;
                    ahead.remaining *= 2;
                }
            }
        }
        Some(self.state.is_finite())
    }

    fn add(&mut self, (dq, dv): &Change<N>) {
        for i in 0..N {
            (self.state.position[i], self.carry.position[i]) =
                two_sum(self.state.position[i], dq[i] + self.carry.position[i]);
            (self.state.velocity[i], self.carry.velocity[i]) =
                two_sum(self.state.velocity[i], dv[i] + self.carry.velocity[i]);
        }
    }

    /// The change over `span`, if the scheme settles.
    fn extrapolate(&mut self, arm: &Arm<N>, effort: &[f64; N], span: f64) -> Option<Change<N>> {
        let mut previous: [Change<N>; ROWS] = [([0.0; N], [0.0; N]); ROWS];
        let State { position, velocity } = &self.state;
        let start = forward_dynamics(arm, position, velocity, effort);
        // An arm that is held still is the difference of two large accelerations, and no better known than these.
        let falling = forward_dynamics(arm, position, velocity, &[0.0; N]);
        self.evaluations += 2;
        let lifting = std::array::from_fn(|i| start[i] - falling[i]);
        let noise = f64::EPSILON * span * (size(&falling) + size::<N>(&lifting));
        let mut steps = 0.0;
        let speed = size(&self.state.velocity);
        for row in 0..ROWS {
            steps += 2.0;
            let mut best = self.midpoint(arm, effort, &start, span, steps);
            let mut last = best;
            let mut inner = steps;
            for of_column in previous.iter_mut().take(row) {
                // Row k has 2 k steps; the weight is that of Neville's scheme in the square of the step.
                inner -= 2.0;
                let weight = 1.0 / ((steps / inner).powi(2) - 1.0);
                let before = *of_column;
                *of_column = best;
                last = best;
                best = (
                    std::array::from_fn(|i| best.0[i] + (best.0[i] - before.0[i]) * weight),
                    std::array::from_fn(|i| best.1[i] + (best.1[i] - before.1[i]) * weight),
                );
            }
            previous[row] = best;
            let apart =
                |a: &[f64; N], b: &[f64; N]| size::<N>(&std::array::from_fn(|i| a[i] - b[i]));
            let enough_q = TOLERANCE * (size(&best.0) + span * speed) + span * noise;
            let enough_v = TOLERANCE * (size(&best.1) + speed) + noise;
            let settled =
                apart(&best.0, &last.0) <= enough_q && apart(&best.1, &last.1) <= enough_v;
            if row > 0 && settled {
                return Some(best);
            }
        }
        None
    }

    /// Gragg's rule over `span` in `steps` steps, smoothed at the end.
    fn midpoint(
        &mut self,
        arm: &Arm<N>,
        effort: &[f64; N],
        start: &[f64; N],
        span: f64,
        steps: f64,
    ) -> Change<N> {
        let State { position, velocity } = self.state;
        let h = span / steps;
        let (mut q, mut v) = ([0.0; N], [0.0; N]);
        let mut next_q = velocity.map(|velocity| h * velocity);
        let mut next_v = start.map(|acceleration| h * acceleration);
        let mut taken = 1.0;
        loop {
            let speed: [f64; N] = std::array::from_fn(|i| velocity[i] + next_v[i]);
            let at = std::array::from_fn(|i| position[i] + next_q[i]);
            let a = forward_dynamics(arm, &at, &speed, effort);
            self.evaluations += 1;
            if taken >= steps {
                return (
                    std::array::from_fn(|i| 0.5 * (next_q[i] + q[i] + h * speed[i])),
                    std::array::from_fn(|i| 0.5 * (next_v[i] + v[i] + h * a[i])),
                );
            }
            taken += 1.0;
            let (before_q, before_v) = (q, v);
            (q, v) = (next_q, next_v);
            next_q = std::array::from_fn(|i| before_q[i] + 2.0 * h * speed[i]);
            next_v = std::array::from_fn(|i| before_v[i] + 2.0 * h * a[i]);
        }
    }
}

fn size<const N: usize>(x: &[f64; N]) -> f64 {
    largest(x.iter().map(|x| x.abs()))
}
