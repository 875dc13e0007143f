//! An arm under constant efforts, followed to rounding or within a tolerance.
//!
//! Its motion is expanded in a power series (`series.rs`); a step is as long as the last terms of it are small, and
//! the series as long as the step. Positions and velocities are summed with compensation.
//!
//! **Invariant:** it computes the motion differently from every method under study, and the work of a span is bounded.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N, and over the coefficients of a series"
)]

pub(crate) mod series;

use super::matrix::largest;
use crate::math::arm::{Arm, State};
use crate::math::count::length_in_f64;
use crate::math::dynamics::forward_dynamics;
use crate::math::elementary::{ln, pow};
use crate::math::integrator::two_sum;
use crate::math::trig;
use series::PowerSeries;

/// The least tolerance that makes a difference: below it rounding is all that is left.
pub const ROUNDING: f64 = 1e-16;

/// Coefficients after which a span is given up, since the motion is too wild to be followed. They make a thousand
/// steps.
const MAX_COEFFICIENTS: u64 = 20_000;

/// Highest order of a series in doubles: beyond it rounding is all that a coefficient adds.
const HIGHEST: usize = 22;

/// Terms that have to be small before a series is believed to have come to its end. An arm that is let go at rest and
/// stretched along the horizontal has three in a row that vanish between two that do not.
const LAST: usize = 4;

/// The factor by which a step may be longer than the last.
const LONGER: f64 = 1.25;

/// Factors by which a step is shortened if its series does not reach so far: the second one if its last terms are
/// [`MUCH`] too large.
const SHORTER: [f64; 2] = [0.95, 0.25];
const MUCH: f64 = 1e9;

/// A motion that is followed, rounding errors carried along.
#[derive(Debug, Clone)]
pub struct TaylorReference<const N: usize> {
    state: State<N>,
    carry: State<N>,
    tolerance: f64,
    /// Order of the series where no span ends.
    order: usize,
    /// Factors of [`SHORTER`], and what they leave of the last terms.
    shorter: [(f64, f64); 2],
    /// How many times the tolerance each of the last terms may be: a term of lower order is not asked for as much.
    allowances: [f64; LAST],
    /// Parts that a step and a span are cut into, beyond what the tolerance asks for.
    cuts: f64,
    coefficients: u64,
    /// The last length of a step that a series allowed \[s\].
    step: f64,
    ahead: Ahead,
    series: PowerSeries<f64, N>,
}

/// The rest of a span.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Ahead {
    /// The whole span \[s\].
    span: f64,
    /// How much of it is left \[s\], and what rounding took from that.
    rest: (f64, f64),
    /// Coefficients after which it is given up.
    bound: u64,
}

impl<const N: usize> TaylorReference<N> {
    /// An arm in the given state, to be followed to rounding.
    #[must_use]
    pub fn new(state: State<N>) -> Self {
        Self::within(state, ROUNDING)
    }

    /// An arm in the given state. A step leaves out at most `tolerance` times the way that the joints turn in it; it is
    /// held between [`ROUNDING`] and 1.
    #[must_use]
    pub fn within(state: State<N>, tolerance: f64) -> Self {
        let tolerance = if tolerance > ROUNDING {
            tolerance.min(1.0)
        } else {
            ROUNDING
        };
        let order = order_for(tolerance);
        Self {
            state,
            carry: State::rest(),
            tolerance,
            order,
            shorter: SHORTER.map(|factor| (factor, power(factor, order - LAST))),
            allowances: std::array::from_fn(|i| {
                let missing = length_in_f64(LAST - 1 - i) / length_in_f64(order);
                pow(tolerance, -missing)
            }),
            cuts: 1.0,
            coefficients: 0,
            step: f64::INFINITY,
            ahead: Ahead::default(),
            series: PowerSeries::new(),
        }
    }

    /// Follows the same motion in steps that are so many times shorter than they might be.
    #[must_use]
    pub(super) fn cut(self, cuts: u32) -> Self {
        Self {
            cuts: f64::from(cuts),
            ..self
        }
    }

    /// The arm's state.
    #[must_use]
    pub fn state(&self) -> &State<N> {
        &self.state
    }

    /// Coefficients of the series so far. Each takes about as long as an evaluation of the dynamics.
    #[must_use]
    pub fn coefficients(&self) -> u64 {
        self.coefficients
    }

    /// Follows the arm under `effort` \[N m\] for `span` \[s\]; `false` if it could not be followed, and is somewhere
    /// on the way.
    pub fn follow(&mut self, arm: &Arm<N>, effort: &[f64; N], span: f64) -> bool {
        self.begin(span);
        self.go_on(arm, effort, u64::MAX).unwrap_or(false)
    }

    /// Begins a span \[s\], to be followed by [`TaylorReference::go_on`].
    pub(super) fn begin(&mut self, span: f64) {
        self.ahead = Ahead {
            span,
            rest: (span, 0.0),
            bound: self.coefficients.saturating_add(MAX_COEFFICIENTS),
        };
    }

    /// Goes on with the span until there have been so many `coefficients` in all, or some more; none while it is not
    /// over, `false` if it could not be followed.
    pub(super) fn go_on(
        &mut self,
        arm: &Arm<N>,
        effort: &[f64; N],
        coefficients: u64,
    ) -> Option<bool> {
        while self.ahead.rest.0 > 0.0 {
            if self.coefficients > self.ahead.bound || !self.state.is_finite() {
                return Some(false);
            }
            if self.coefficients >= coefficients {
                return None;
            }
            self.step(arm, effort);
        }
        Some(self.state.is_finite())
    }

    fn step(&mut self, arm: &Arm<N>, effort: &[f64; N]) {
        let Ahead { span, rest, .. } = self.ahead;
        let whole = (span / self.cuts).min(rest.0);
        let State { position, velocity } = &self.state;
        let acceleration = forward_dynamics(arm, position, velocity, effort);
        let directions = trig::sin_cos(position);
        self.series.begin(arm, &directions, velocity, &acceleration);
        let mut small = 0;
        if whole > LONGER * LONGER * self.step {
            while self.series.order() < self.order {
                self.series.extend(&[0.0; N]);
            }
        } else {
            // A short step needs no long series.
            let mut power = whole;
            while self.series.order() < self.order && small < LAST {
                self.series.extend(&[0.0; N]);
                power *= whole;
                let term = self.excess(self.series.order(), whole, power);
                small = if term <= 1.0 { small + 1 } else { 0 };
            }
        }
        self.coefficients += self.series.order() as u64;
        if small < LAST {
            self.step = self.allowed((LONGER * self.step).min(span));
        }
        let cut = self.step / self.cuts;
        let h = if small == LAST || cut >= whole {
            whole
        } else {
            // Two steps of one length are better than a long one and a remnant.
            cut.min(0.5 * rest.0)
        };
        let (dq, dv) = self.series.change(h);
        for i in 0..N {
            (self.state.position[i], self.carry.position[i]) =
                two_sum(self.state.position[i], dq[i] + self.carry.position[i]);
            (self.state.velocity[i], self.carry.velocity[i]) =
                two_sum(self.state.velocity[i], dv[i] + self.carry.velocity[i]);
        }
        let (left, lost) = two_sum(rest.0, -h);
        self.ahead.rest = if h >= rest.0 {
            (0.0, 0.0)
        } else {
            two_sum(left, rest.1 + lost)
        };
    }

    /// The longest step \[s\] up to `step` whose last terms are as small as the tolerance asks for.
    fn allowed(&self, mut step: f64) -> f64 {
        let first = self.order + 1 - LAST;
        let mut of_order = power(step, first);
        let mut excess = 0.0_f64;
        for (order, allowance) in (first..).zip(self.allowances) {
            excess = excess.max(self.excess(order, step, of_order) / allowance);
            of_order *= step;
        }
        // Terms fall with at least the power of the first of them, less 1 for what they are measured by.
        while excess > 1.0 && step > 0.0 {
            let (factor, of_terms) = self.shorter[usize::from(excess > MUCH)];
            step *= factor;
            excess *= of_terms;
        }
        step
    }

    /// How many times too large the terms of `order` are in a step \[s\], whose `power` of that order is given.
    fn excess(&self, order: usize, step: f64, power: f64) -> f64 {
        let PowerSeries { angle, rate, .. } = &self.series;
        let of_angle = self.tolerance * step * (size(&rate[0]) + step * size(&rate[1]));
        let of_rate = self.tolerance * step * (size(&rate[1]) + step * size(&rate[2]))
            + ROUNDING * size(&rate[0]);
        let angle = size(&angle[order]) * power / of_angle;
        let rate = size(&rate[order]) * power / of_rate;
        angle.max(rate)
    }
}

/// The order at which a motion costs least for a tolerance: two more than in Jorba and Zou, section 3.3. They take
/// the cost of a step to grow with the square of its order; every step begins with an evaluation besides.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "clamped to small whole numbers"
)]
fn order_for(tolerance: f64) -> usize {
    ((3.0 - 0.5 * ln(tolerance)).ceil() as usize).clamp(6, HIGHEST)
}

fn power(base: f64, exponent: usize) -> f64 {
    let (mut power, mut square, mut rest) = (1.0, base, exponent);
    while rest > 0 {
        if rest % 2 == 1 {
            power *= square;
        }
        square *= square;
        rest /= 2;
    }
    power
}

fn size<const N: usize>(x: &[f64; N]) -> f64 {
    largest(x.iter().map(|x| x.abs()))
}
