//! A Taylor integrator for the arm's motion, to rounding or within a tolerance. The study uses doubles and constant
//! efforts; the report's references use any drive and more digits.
//!
//! Its motion is a power series (`series.rs`). The step length makes the last terms of the series small. Positions and
//! velocities are summed with compensation.
//!
//! **Invariant:** it shares no formula with the methods under study, and the work of a span is bounded.

pub(crate) mod series;

use libm::{log, pow};

use super::matrix::largest;
use super::paused::{PieceWork, at_once};
use crate::math::arm::{Arm, State};
use crate::math::count::{length_in_f64, whole};
use crate::math::dynamics::{forward_dynamics, less_friction};
use crate::math::integrator::two_sum;
use crate::math::number::Arithmetic;
use crate::math::trig;
use series::PowerSeries;

/// The smallest useful tolerance: below it rounding dominates.
pub const ROUNDING: f64 = f64::LEAST_TOLERANCE;

/// Most coefficients per span, some thousand steps. A motion that needs more changes too fast to be computed.
const MAX_COEFFICIENTS: u64 = 20_000;

/// Highest order of a series in doubles: beyond it a coefficient contributes only rounding.
const HIGHEST_ORDER: usize = 22;

/// Number of last terms that must be small before a series counts as converged. For an arm released at rest, stretched
/// along the horizontal, three consecutive terms vanish between two that do not.
const LAST: usize = 4;

/// Largest ratio of a step to the last one.
const LONGER: f64 = 1.25;

/// Part of the allowed step that is taken if the last step was too long.
const RESERVE: f64 = 0.95;

/// The arithmetic in which a motion is computed.
pub(crate) trait Precision: Arithmetic + Default {
    /// Relative size of a rounding error.
    const LEAST_TOLERANCE: f64;
    /// The magnitude as a double.
    fn magnitude(self) -> f64;
    /// `sum + change` and its rounding error, where `carry` is the rounding error of `sum`.
    fn plus_carried(self, carry: Self, change: Self) -> (Self, Self);
    /// Sines and cosines of angles \[rad\].
    fn directions<const N: usize>(angles: &[Self; N]) -> ([Self; N], [Self; N]);
    /// Joint accelerations \[rad/s²\] under joint efforts \[N m\].
    fn acceleration<const N: usize>(
        arm: &Arm<N>,
        position: &[Self; N],
        velocity: &[Self; N],
        effort: &[Self; N],
    ) -> [Self; N];
}

impl Precision for f64 {
    const LEAST_TOLERANCE: f64 = 1e-16;

    fn magnitude(self) -> f64 {
        self.abs()
    }

    fn plus_carried(self, carry: Self, change: Self) -> (Self, Self) {
        two_sum(self, change + carry)
    }

    fn directions<const N: usize>(angles: &[Self; N]) -> ([Self; N], [Self; N]) {
        trig::sin_cos(angles)
    }

    fn acceleration<const N: usize>(
        arm: &Arm<N>,
        position: &[Self; N],
        velocity: &[Self; N],
        effort: &[Self; N],
    ) -> [Self; N] {
        forward_dynamics(arm, position, velocity, effort)
    }
}

/// The joint efforts of a motion \[N m\], as a series.
pub(crate) trait Drive<T, const N: usize> {
    /// The efforts in a state.
    fn efforts(&self, position: &[T; N], velocity: &[T; N]) -> [T; N];
    /// Their coefficient of order `k`, above 0, in a step that begins at `position`.
    fn coefficient(&self, position: &[T; N], series: &PowerSeries<T, N>, k: usize) -> [T; N];
}

/// Constant efforts.
impl<T: Precision, const N: usize> Drive<T, N> for [T; N] {
    fn efforts(&self, _: &[T; N], _: &[T; N]) -> [T; N] {
        *self
    }

    fn coefficient(&self, _: &[T; N], _: &PowerSeries<T, N>, _: usize) -> [T; N] {
        [T::default(); N]
    }
}

/// Constant efforts and viscous friction.
struct Damped<const N: usize> {
    effort: [f64; N],
    viscous: [f64; N],
}

impl<const N: usize> Drive<f64, N> for Damped<N> {
    fn efforts(&self, _: &[f64; N], velocity: &[f64; N]) -> [f64; N] {
        less_friction(&self.viscous, velocity, &self.effort)
    }

    fn coefficient(&self, _: &[f64; N], series: &PowerSeries<f64, N>, k: usize) -> [f64; N] {
        let rates = series::differences(&series.rate[k]);
        less_friction(&self.viscous, &rates, &[0.0; N])
    }
}

/// A motion in progress, with compensated rounding errors.
#[derive(Debug, Clone)]
pub(crate) struct Taylor<T, const N: usize> {
    pub(crate) state: State<N, T>,
    carry: State<N, T>,
    tolerance: f64,
    /// Order of the series, except at the end of a span.
    order: usize,
    /// How much larger than the last term each of the last terms may be.
    allowances: [f64; LAST],
    /// Factor by which steps and spans are divided in addition to the tolerance's demand.
    cuts: f64,
    coefficients: u64,
    /// The last step length that a series allowed \[s\].
    step: f64,
    /// The present span \[s\].
    span: f64,
    /// The rest of the span \[s\], and its rounding error.
    pub(crate) rest: (f64, f64),
    /// The series of the last step.
    pub(crate) series: PowerSeries<T, N>,
}

impl<T: Precision, const N: usize> Taylor<T, N> {
    /// An arm in the given state. A step leaves out at most `tolerance` times the way that the joints turn in it.
    pub(crate) fn new(state: State<N, T>, tolerance: f64, order: usize) -> Self {
        let nothing = [T::default(); N];
        let allowance = |missing| pow(tolerance, -length_in_f64(missing) / length_in_f64(order));
        Self {
            state,
            carry: State {
                position: nothing,
                velocity: nothing,
            },
            tolerance,
            order,
            allowances: std::array::from_fn(|i| allowance(LAST - 1 - i)),
            cuts: 1.0,
            coefficients: 0,
            step: f64::INFINITY,
            span: 0.0,
            rest: (0.0, 0.0),
            series: PowerSeries::new(),
        }
    }

    /// Begins a span \[s\].
    pub(crate) fn begin(&mut self, span: f64) {
        self.span = span;
        self.rest = (span, 0.0);
    }

    /// Takes the next step of the span.
    pub(crate) fn step(&mut self, arm: &Arm<N>, drive: &impl Drive<T, N>) {
        let (span, rest) = (self.span, self.rest);
        let whole = (span / self.cuts).min(rest.0);
        let State { position, velocity } = self.state;
        let effort = drive.efforts(&position, &velocity);
        let acceleration = T::acceleration(arm, &position, &velocity, &effort);
        let directions = T::directions(&position);
        self.series
            .begin(arm, &directions, &velocity, &acceleration);
        // A short step needs no long series.
        let is_short = whole <= LONGER * LONGER * self.step;
        let (mut small, mut power) = (0, whole);
        while self.series.order() < self.order && small < LAST {
            let effort = drive.coefficient(&position, &self.series, self.series.order());
            self.series.extend(&series::link_efforts(&effort));
            if is_short {
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
            // Two equal steps are better than a long one and a short rest.
            cut.min(0.5 * rest.0)
        };
        let is_last = h >= rest.0;
        let real = |value| T::default().like(value);
        let time = if is_last {
            real(h) + real(rest.1)
        } else {
            real(h)
        };
        let (dq, dv) = self.series.change(time);
        let State {
            position: q,
            velocity: v,
        } = &mut self.state;
        let carry = &mut self.carry;
        for i in 0..N {
            (q[i], carry.position[i]) = q[i].plus_carried(carry.position[i], dq[i]);
            (v[i], carry.velocity[i]) = v[i].plus_carried(carry.velocity[i], dv[i]);
        }
        let (left, lost) = two_sum(rest.0, -h);
        self.rest = if is_last {
            (0.0, 0.0)
        } else {
            two_sum(left, rest.1 + lost)
        };
    }

    /// The longest step \[s\] up to `step` whose last terms are within the tolerance.
    fn allowed(&self, step: f64) -> f64 {
        let first = self.order + 1 - LAST;
        let mut power = (0..first).fold(1.0, |power, _| power * step);
        let mut excess = 0.0_f64;
        for (order, allowance) in (first..).zip(self.allowances) {
            excess = excess.max(self.excess(order, step, power) / allowance);
            power *= step;
        }
        if excess <= 1.0 {
            return step;
        }
        // The terms decrease with at least the power of the first of them, minus 1 for the scale of the comparison.
        RESERVE * step * pow(excess, -1.0 / length_in_f64(first - 1))
    }

    /// How many times too large the terms of `order` are in a step \[s\], whose `power` of that order is given.
    fn excess(&self, order: usize, step: f64, power: f64) -> f64 {
        let PowerSeries { angle, rate, .. } = &self.series;
        let of_angle = self.tolerance * step * (size(&rate[0]) + step * size(&rate[1]));
        let of_rate = self.tolerance * step * (size(&rate[1]) + step * size(&rate[2]))
            + T::LEAST_TOLERANCE * size(&rate[0]);
        let angle = size(&angle[order]) * power / of_angle;
        let rate = size(&rate[order]) * power / of_rate;
        angle.max(rate)
    }
}

/// The order of least cost for a tolerance: two more than in Jorba and Zou, section 3.3. Their cost of a step grows
/// with the square of its order. Here every step also needs an evaluation at its start.
fn order_for(tolerance: f64) -> usize {
    let order = whole((3.0 - 0.5 * log(tolerance)).ceil());
    usize::try_from(order).map_or(HIGHEST_ORDER, |order| order.clamp(6, HIGHEST_ORDER))
}

fn size<T: Precision, const N: usize>(x: &[T; N]) -> f64 {
    largest(x.iter().map(|x| x.magnitude()))
}

/// The motion of an arm under constant efforts, in doubles.
#[derive(Debug, Clone)]
pub struct TaylorReference<const N: usize>(Taylor<f64, N>);

impl<const N: usize> TaylorReference<N> {
    /// The motion from the given state, computed to rounding.
    pub fn new(state: State<N>) -> Self {
        Self::within(state, ROUNDING)
    }

    /// An arm in the given state. A step leaves out at most `tolerance` times the way that the joints turn in it; it is
    /// held between [`ROUNDING`] and 1.
    pub fn within(state: State<N>, tolerance: f64) -> Self {
        let tolerance = tolerance.clamp(ROUNDING, 1.0);
        Self(Taylor::new(state, tolerance, order_for(tolerance)))
    }

    /// The same motion with its steps divided by this factor.
    #[must_use]
    pub(super) fn cut(mut self, cuts: u32) -> Self {
        self.0.cuts = f64::from(cuts);
        self
    }

    /// The arm's state.
    pub fn state(&self) -> &State<N> {
        &self.0.state
    }

    /// Number of series coefficients so far. Each costs about as much as an evaluation of the dynamics.
    pub fn coefficients(&self) -> u64 {
        self.0.coefficients
    }

    /// The same motion at the start of a span \[s\].
    #[cfg(feature = "report")]
    #[must_use]
    pub(crate) fn begun(mut self, span: f64) -> Self {
        self.0.begin(span);
        self
    }

    /// Takes a step of the span under `effort` \[N m\], without friction. Returns the rest of the span \[s\].
    #[cfg(feature = "report")]
    pub(crate) fn step(&mut self, arm: &Arm<N>, effort: &[f64; N]) -> f64 {
        self.0.step(arm, effort);
        self.0.rest.0
    }

    /// Follows the arm under `effort` \[N m\] for `span` \[s\]; `false` if the motion could not be computed. The state
    /// is then somewhere within the span.
    pub fn follow(&mut self, arm: &Arm<N>, effort: &[f64; N], span: f64) -> bool {
        at_once(self.follow_in_pieces(arm, effort, span, &mut PieceWork::default()))
    }

    /// Does what [`TaylorReference::follow`] does, in pieces.
    pub(super) async fn follow_in_pieces(
        &mut self,
        arm: &Arm<N>,
        effort: &[f64; N],
        span: f64,
        piece: &mut PieceWork,
    ) -> bool {
        let bound = self.coefficients().saturating_add(MAX_COEFFICIENTS);
        self.0.begin(span);
        while self.0.rest.0 > 0.0 {
            if self.coefficients() > bound || !self.state().is_finite() {
                return false;
            }
            let before = self.coefficients();
            if arm.has_friction() {
                let viscous = *arm.viscous();
                let effort = *effort;
                self.0.step(arm, &Damped { effort, viscous });
            } else {
                self.0.step(arm, effort);
            }
            piece.spend(self.coefficients() - before).await;
        }
        self.state().is_finite()
    }
}
