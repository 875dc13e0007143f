//! Reference motions: the same arm, another derivation, twice the digits, and a bound on their own error.
//!
//! An error, in the report, is a distance to one of these. The study's Taylor integrator computes a motion from the
//! equation of motion, in double-double arithmetic ([`ReferenceMotion::of`]). It does so twice, with different order
//! and tolerance. The distance of the two is [`ReferenceMotion::uncertainty`]. Control is either the law at every
//! instant, or its effort held from one control instant to the next as the live arm holds it. [`exact_steps`] takes the
//! steps of the methods in the same arithmetic: their truncation error without rounding.
//!
//! **Invariant:** nothing of the live arm's kernel or stepper is used, only its parameters.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

mod double_double;

pub use double_double::DoubleDouble;

use self::DoubleDouble as Real;
use crate::math::arm::{Arm, State};
use crate::math::count::{in_f64, length_in_f64};
use crate::math::integrator::{Method, increment};
use crate::math::pid::{Gains, INTEGRAL_LIMIT, Setpoint};
use crate::study::control_loop::no_control;
use crate::study::matrix::largest;
use crate::study::taylor::series::{PowerSeries, differences};
use crate::study::taylor::{Drive, Precision, Taylor};

/// Tolerance and order of the motion that is kept, and of the one that it is judged by.
const SETTINGS: [(f64, usize); 2] = [(1e-32, 30), (1e-30, 22)];

/// The drive of the joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law<const N: usize> {
    /// Constant efforts \[N m\]; zeros for a free swing.
    Constant([f64; N]),
    /// The control law at every instant, its integral unbounded.
    Continuous(Gains<N>, Setpoint<N>),
    /// The control law as shipped: asked once per period, its effort held until the next.
    Held {
        /// Gains of the law.
        gains: Gains<N>,
        /// The setpoint that it holds to.
        setpoint: Setpoint<N>,
        /// Time between two control instants \[s\].
        period: f64,
    },
}

impl<const N: usize> Law<N> {
    /// No effort at all.
    pub const FREE: Self = Self::Constant([0.0; N]);
}

/// Joint angles \[rad\] and rates \[rad/s\] with 106 bits.
type Exact<const N: usize> = ([Real; N], [Real; N]);

/// A control law with its integral \[rad s\] at the start of a step.
struct ExactLaw<const N: usize> {
    gains: Gains<N>,
    setpoint: Setpoint<N>,
    integral: [Real; N],
}

impl<const N: usize> ExactLaw<N> {
    fn new(gains: Gains<N>, setpoint: Setpoint<N>) -> Self {
        Self {
            gains,
            setpoint,
            integral: [Real::ZERO; N],
        }
    }

    fn error(&self, position: &[Real; N]) -> [Real; N] {
        std::array::from_fn(|i| Real::from(self.setpoint.position[i]) - position[i])
    }

    fn effort(&self, error: &[Real; N], integral: &[Real; N], rate: &[Real; N]) -> [Real; N] {
        let Gains { kp, ki, kd } = &self.gains;
        std::array::from_fn(|i| error[i] * kp[i] + integral[i] * ki[i] + rate[i] * kd[i])
    }

    fn rate(&self, velocity: &[Real; N]) -> [Real; N] {
        std::array::from_fn(|i| Real::from(self.setpoint.velocity[i]) - velocity[i])
    }

    /// The shipped law at a control instant: moves the integral on by a period \[s\], and returns the effort.
    fn held(&mut self, (position, velocity): &Exact<N>, period: f64) -> [Real; N] {
        let error = self.error(position);
        self.integral =
            std::array::from_fn(|i| (self.integral[i] + error[i] * period).clamp(INTEGRAL_LIMIT));
        self.effort(&error, &self.integral, &self.rate(velocity))
    }

    /// Moves the integral on by a step \[s\] from `position`.
    fn integrate(&mut self, position: &[Real; N], series: &PowerSeries<Real, N>, step: Real) {
        let angles = series.angle[1..=series.order()]
            .iter()
            .rev()
            .map(differences);
        // ∫ q dt beyond the position at the start, by Horner's rule.
        let mut order = length_in_f64(series.order() + 1);
        let moved = angles.fold([Real::ZERO; N], |sum, angle| {
            let next = std::array::from_fn(|i| (sum[i] + angle[i] / Real::from(order)) * step);
            order -= 1.0;
            next
        });
        let error = self.error(position);
        self.integral = std::array::from_fn(|i| self.integral[i] + (error[i] - moved[i]) * step);
    }
}

impl<const N: usize> Drive<Real, N> for ExactLaw<N> {
    fn efforts(&self, position: &[Real; N], velocity: &[Real; N]) -> [Real; N] {
        self.effort(&self.error(position), &self.integral, &self.rate(velocity))
    }

    fn coefficient(&self, start: &[Real; N], series: &PowerSeries<Real, N>, k: usize) -> [Real; N] {
        let of = |angle: &[Real; N]| differences(angle).map(|angle| -angle);
        // The integral's coefficients are those of the error before, divided by their order.
        let before = match k {
            1 => self.error(start),
            _ => of(&series.angle[k - 1]),
        };
        let integral = before.map(|error| error / Real::from(length_in_f64(k)));
        self.effort(&of(&series.angle[k]), &integral, &of(&series.rate[k]))
    }
}

fn exact<const N: usize>(start: &State<N>) -> Exact<N> {
    (
        start.position.map(Real::from),
        start.velocity.map(Real::from),
    )
}

/// A step of a motion: when it begins \[s\], the joint angles then \[rad\], and the coefficients of their change.
type PathPiece<const N: usize> = (Real, [Real; N], Vec<[Real; N]>);

/// A motion that is followed.
struct Followed<'a, const N: usize> {
    arm: &'a Arm<N>,
    taylor: Taylor<Real, N>,
    law: ExactLaw<N>,
}

impl<'a, const N: usize> Followed<'a, N> {
    fn new(
        arm: &'a Arm<N>,
        start: &State<N>,
        law: &Law<N>,
        (tolerance, order): (f64, usize),
    ) -> Self {
        let (position, velocity) = exact(start);
        let (gains, setpoint) = match law {
            Law::Constant(_) => (no_control(), Setpoint::default()),
            Law::Continuous(gains, setpoint)
            | Law::Held {
                gains, setpoint, ..
            } => (*gains, *setpoint),
        };
        Self {
            arm,
            taylor: Taylor::new(position, velocity, tolerance, order),
            law: ExactLaw::new(gains, setpoint),
        }
    }

    fn state(&self) -> Exact<N> {
        (self.taylor.position, self.taylor.velocity)
    }

    /// Follows the motion for a time \[s\], and shows every step.
    fn advance(
        &mut self,
        law: &Law<N>,
        time: f64,
        mut show: impl FnMut(Real, &[Real; N], &Taylor<Real, N>),
    ) {
        let held = match law {
            Law::Constant(effort) => Some(effort.map(Real::from)),
            Law::Held { period, .. } => Some(self.law.held(&self.state(), *period)),
            Law::Continuous(..) => None,
        };
        let left = |taylor: &Taylor<Real, N>| {
            let (rest, lost) = taylor.rest();
            Real::from(rest) + Real::from(lost)
        };
        self.taylor.begin(time);
        while self.taylor.rest().0 > 0.0 {
            let (before, position) = (left(&self.taylor), self.taylor.position);
            match &held {
                Some(effort) => self.taylor.step(self.arm, effort),
                None => self.taylor.step(self.arm, &self.law),
            }
            let step = before - left(&self.taylor);
            if held.is_none() {
                self.law.integrate(&position, &self.taylor.series, step);
            }
            show(Real::from(time) - before, &position, &self.taylor);
            // A motion too wild to be followed would not end.
            if step == Real::ZERO {
                break;
            }
        }
    }
}

/// A motion at chosen times.
#[derive(Debug, Clone)]
pub struct ReferenceMotion<const N: usize> {
    /// Joint angles \[rad\] and rates \[rad/s\] of every sample.
    pub samples: Vec<([DoubleDouble; N], [DoubleDouble; N])>,
    /// How far the angles of each sample may be off: the largest difference between two settings \[rad\].
    pub uncertainty: Vec<f64>,
}

impl<const N: usize> ReferenceMotion<N> {
    /// The motion from `start` under `law`, at multiples of `spacing` \[s\]: `count` samples, the start not among them.
    ///
    /// With a held effort the samples are the control instants nearest to these times. A spacing of less than a control
    /// period gives one sample per period.
    #[must_use]
    pub fn of(arm: &Arm<N>, start: &State<N>, law: &Law<N>, spacing: f64, count: usize) -> Self {
        Self::between(arm, start, law, &vec![spacing; count])
    }

    /// The motion after each of these `intervals` \[s\], one after the other.
    #[must_use]
    pub fn between(arm: &Arm<N>, start: &State<N>, law: &Law<N>, intervals: &[f64]) -> Self {
        let motion = |setting| -> Vec<Exact<N>> {
            let mut followed = Followed::new(arm, start, law, setting);
            let sample = |&interval| {
                let (count, span) = match law {
                    Law::Held { period, .. } => (whole_periods(interval, *period), *period),
                    Law::Constant(_) | Law::Continuous(..) => (1, interval),
                };
                (0..count).for_each(|_| followed.advance(law, span, |_, _, _| ()));
                followed.state()
            };
            intervals.iter().map(sample).collect()
        };
        let [fine, coarse] = SETTINGS.map(motion);
        let off = |(a, b): (&Exact<N>, &Exact<N>)| distance(&a.0, &b.0);
        Self {
            uncertainty: fine.iter().zip(&coarse).map(off).collect(),
            samples: fine,
        }
    }

    /// The state of sample `index`, rounded to doubles.
    #[must_use]
    pub fn state(&self, index: usize) -> Option<State<N>> {
        let (position, velocity) = self.samples.get(index)?;
        let (position, velocity) = (position.map(Real::to_f64), velocity.map(Real::to_f64));
        Some(State { position, velocity })
    }

    /// The largest angle error of `position` against sample `index` \[rad\].
    #[must_use]
    pub fn angle_error(&self, index: usize, position: &[f64; N]) -> Option<f64> {
        let (exact, _) = self.samples.get(index)?;
        Some(largest_difference(exact, position))
    }
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a ratio of two positive times; a cast saturates"
)]
fn whole_periods(interval: f64, period: f64) -> u64 {
    ((interval / period).round() as u64).max(1)
}

/// A reference motion at any instant: the series of its steps, kept.
#[derive(Debug, Clone)]
pub struct ReferencePath<const N: usize> {
    pieces: Vec<PathPiece<N>>,
    uncertainty: f64,
}

impl<const N: usize> ReferencePath<N> {
    /// The motion from `start` under the law at every instant, or under a constant effort, for `duration` \[s\].
    #[must_use]
    pub fn new(arm: &Arm<N>, start: &State<N>, law: &Law<N>, duration: f64) -> Self {
        /// Instants at which two settings are compared.
        const COMPARED: u64 = 64;
        let [fine, coarse] = SETTINGS.map(|setting| {
            let mut pieces: Vec<PathPiece<N>> = Vec::new();
            let mut followed = Followed::new(arm, start, law, setting);
            followed.advance(law, duration, |begins, position, Taylor { series, .. }| {
                let angles = series.angle[1..=series.order()].iter();
                pieces.push((begins, *position, angles.map(differences).collect()));
            });
            pieces
        });
        let spacing = Real::from(duration / in_f64(COMPARED));
        let times = (1..=COMPARED).map(|index| spacing * in_f64(index));
        let off = times.map(|time| distance(&position(&fine, time), &position(&coarse, time)));
        Self {
            uncertainty: off.fold(0.0, f64::max),
            pieces: fine,
        }
    }

    /// The joint angles after `steps` steps of `timestep` \[s\] \[rad\]; beyond the end those at the end.
    #[must_use]
    pub fn after(&self, steps: u64, timestep: f64) -> [DoubleDouble; N] {
        position(&self.pieces, Real::from(timestep) * in_f64(steps))
    }

    /// How far the angles may be off: the largest difference between two settings \[rad\].
    #[must_use]
    pub fn uncertainty(&self) -> f64 {
        self.uncertainty
    }
}

/// The joint angles at `time` \[s\].
fn position<const N: usize>(pieces: &[PathPiece<N>], time: Real) -> [Real; N] {
    let after = pieces.partition_point(|piece| (piece.0 - time).to_f64() <= 0.0);
    let Some((begins, position, angles)) = pieces.get(after.saturating_sub(1)) else {
        return [Real::from(f64::NAN); N];
    };
    let after = time - *begins;
    let change = angles.iter().rev().fold([Real::ZERO; N], |sum, angle| {
        std::array::from_fn(|i| (sum[i] + angle[i]) * after)
    });
    plus(position, &change)
}

fn plus<const N: usize>(x: &[Real; N], y: &[Real; N]) -> [Real; N] {
    std::array::from_fn(|i| x[i] + y[i])
}

/// The largest difference of two poses \[rad\].
pub(super) fn distance<const N: usize>(a: &[Real; N], b: &[Real; N]) -> f64 {
    largest(a.iter().zip(b).map(|(a, b)| (*a - *b).magnitude()))
}

/// Joint accelerations \[rad/s²\] under the efforts `tau` \[N m\], with 106 bits.
#[must_use]
pub fn exact_acceleration<const N: usize>(
    arm: &Arm<N>,
    state: &State<N>,
    tau: &[f64; N],
) -> [DoubleDouble; N] {
    let (position, velocity) = exact(state);
    Real::acceleration(arm, &position, &velocity, &tau.map(Real::from))
}

/// `max |exact - value|`, the difference rounded only once it is taken; NaN if a value is.
#[must_use]
pub fn largest_difference<const N: usize>(exact: &[DoubleDouble; N], values: &[f64; N]) -> f64 {
    let both = exact.iter().zip(values);
    largest(both.map(|(exact, value)| exact.minus(*value).abs()))
}

/// Joint angles \[rad\] and rates \[rad/s\] after every `every` steps of `h` \[s\] with `method`, `count` samples in
/// all. The maps are those of `math::integrator`; under [`Law::Held`] the period is taken to be `h`.
#[must_use]
pub fn exact_steps<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    law: &Law<N>,
    method: Method,
    h: f64,
    every: u64,
    count: usize,
) -> Vec<([DoubleDouble; N], [DoubleDouble; N])> {
    let mut state = exact(start);
    let mut held = Followed::new(arm, start, law, SETTINGS[0]).law;
    let step = |state: &mut Exact<N>| {
        let effort = match law {
            Law::Constant(effort) => effort.map(Real::from),
            Law::Continuous(..) | Law::Held { .. } => held.held(state, h),
        };
        let acceleration = |_, q: &[Real; N], v: &[Real; N]| Real::acceleration(arm, q, v, &effort);
        let (q, v) = &state;
        let (dq, dv) = increment(method, acceleration, Real::ZERO, q, v, Real::from(h));
        *state = (plus(q, &dq), plus(v, &dv));
    };
    let mut step = step;
    let sample = |_| {
        (0..every).for_each(|_| step(&mut state));
        state
    };
    (0..count).map(sample).collect()
}
