//! Reference motions: the same arm, another derivation, twice the digits, and a bound on their own error.
//!
//! An error, in the report, is a distance to one of these. The study's Taylor integrator computes a motion from the
//! equation of motion, in double-double arithmetic ([`ReferenceMotion`]). It does so twice, with different order and
//! tolerance. The distance of the two is [`ReferenceMotion::uncertainty`]. Control is either the law at every instant,
//! or its effort held from one control instant to the next as the live arm holds it. [`exact_steps`] takes the steps of
//! the methods in the same arithmetic: their truncation error without rounding.
//!
//! **Invariant:** nothing of the live arm's kernel or stepper is used, only its parameters.

mod double_double;

pub use double_double::DoubleDouble;

use self::DoubleDouble as Real;
use crate::math::arm::{Arm, State};
use crate::math::count::{length_in_f64, steps_in};
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
type Exact<const N: usize> = State<N, Real>;

/// A control law with its integral \[rad s\] at the start of a step.
struct ExactLaw<const N: usize> {
    gains: Gains<N>,
    setpoint: Setpoint<N>,
    integral: [Real; N],
}

impl<const N: usize> ExactLaw<N> {
    fn of(law: &Law<N>) -> Self {
        let (gains, setpoint) = match law {
            Law::Constant(_) => (no_control(), Setpoint::default()),
            Law::Continuous(gains, setpoint)
            | Law::Held {
                gains, setpoint, ..
            } => (*gains, *setpoint),
        };
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
    fn held(&mut self, state: &Exact<N>, period: f64) -> [Real; N] {
        let error = self.error(&state.position);
        self.integral =
            std::array::from_fn(|i| (self.integral[i] + error[i] * period).clamp(INTEGRAL_LIMIT));
        self.effort(&error, &self.integral, &self.rate(&state.velocity))
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
    State {
        position: start.position.map(Real::from),
        velocity: start.velocity.map(Real::from),
    }
}

/// A step of a motion.
#[derive(Debug, Clone)]
struct Piece<const N: usize> {
    /// When it begins \[s\].
    begins: Real,
    /// The joint angles then \[rad\].
    position: [Real; N],
    /// The coefficients of their change, from the first order on.
    change: Vec<[Real; N]>,
}

/// A motion at any instant: the series of its steps, with both settings.
#[derive(Debug, Clone)]
pub struct ReferenceMotion<const N: usize> {
    fine: Vec<Piece<N>>,
    coarse: Vec<Piece<N>>,
}

impl<const N: usize> ReferenceMotion<N> {
    /// The motion from `start` under `law` for `duration` \[s\], or with a held effort for the number of control
    /// periods that is nearest to it.
    pub fn new(arm: &Arm<N>, start: &State<N>, law: &Law<N>, duration: f64) -> Self {
        let [fine, coarse] = SETTINGS.map(|setting| follow(arm, start, law, duration, setting));
        Self { fine, coarse }
    }

    /// The joint angles at `time` \[s\] \[rad\].
    pub fn angles(&self, time: impl Into<DoubleDouble>) -> [DoubleDouble; N] {
        angles(&self.fine, time.into())
    }

    /// The largest angle error of `position` at `time` \[s\] \[rad\].
    pub fn angle_error(&self, time: impl Into<DoubleDouble>, position: &[f64]) -> f64 {
        largest_difference(&self.angles(time), position)
    }

    /// How far the angles at `time` \[s\] may be off: the largest difference between two settings \[rad\].
    pub fn uncertainty(&self, time: f64) -> f64 {
        let [fine, coarse] = [&self.fine, &self.coarse].map(|pieces| angles(pieces, time.into()));
        largest_difference(&fine, &coarse)
    }
}

/// The steps of a motion with one tolerance and order.
fn follow<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    law: &Law<N>,
    duration: f64,
    (tolerance, order): (f64, usize),
) -> Vec<Piece<N>> {
    let left = |taylor: &Taylor<Real, N>| Real::from(taylor.rest.0) + taylor.rest.1;
    let mut taylor = Taylor::new(exact(start), tolerance, order);
    let mut exact_law = ExactLaw::of(law);
    let (spans, span) = match law {
        Law::Held { period, .. } => (steps_in(duration, *period).round().max(1.0), *period),
        Law::Constant(_) | Law::Continuous(..) => (1.0, duration),
    };
    let (mut pieces, mut done) = (Vec::new(), 0.0);
    while done < spans {
        done += 1.0;
        let end = Real::from(span) * done;
        let held = match law {
            Law::Constant(effort) => Some(effort.map(Real::from)),
            Law::Held { .. } => Some(exact_law.held(&taylor.state, span)),
            Law::Continuous(..) => None,
        };
        taylor.begin(span);
        while taylor.rest.0 > 0.0 {
            let (before, position) = (left(&taylor), taylor.state.position);
            match &held {
                Some(effort) => taylor.step(arm, effort),
                None => taylor.step(arm, &exact_law),
            }
            let (series, step) = (&taylor.series, before - left(&taylor));
            if held.is_none() {
                exact_law.integrate(&position, series, step);
            }
            let change = series.angle[1..=series.order()].iter().map(differences);
            pieces.push(Piece {
                begins: end - before,
                position,
                change: change.collect(),
            });
            // A motion too wild to be followed would not end.
            if step == Real::ZERO {
                break;
            }
        }
    }
    pieces
}

/// The joint angles at `time` \[s\].
fn angles<const N: usize>(pieces: &[Piece<N>], time: Real) -> [Real; N] {
    let begun = pieces.partition_point(|piece| (piece.begins - time).to_f64() <= 0.0);
    let piece = &pieces[begun.saturating_sub(1)];
    let after = time - piece.begins;
    let change = piece.change.iter().rev();
    let change = change.fold([Real::ZERO; N], |sum, term| {
        plus(&sum, term).map(|sum| sum * after)
    });
    plus(&piece.position, &change)
}

fn plus<const N: usize>(x: &[Real; N], y: &[Real; N]) -> [Real; N] {
    std::array::from_fn(|i| x[i] + y[i])
}

/// Joint accelerations \[rad/s²\] under the efforts `tau` \[N m\], with 106 bits.
pub fn exact_acceleration<const N: usize>(
    arm: &Arm<N>,
    state: &State<N>,
    tau: &[f64; N],
) -> [DoubleDouble; N] {
    let State { position, velocity } = exact(state);
    Real::acceleration(arm, &position, &velocity, &tau.map(Real::from))
}

/// `max |exact - value|`, of doubles or of exact values; the difference is rounded only once it is taken. NaN if a value
/// is.
pub fn largest_difference<T: Copy + Into<DoubleDouble>>(
    exact: &[DoubleDouble],
    values: &[T],
) -> f64 {
    let both = exact.iter().zip(values);
    largest(both.map(|(exact, value)| (*exact - (*value).into()).magnitude()))
}

/// Joint angles \[rad\] and rates \[rad/s\] after every `every` steps of `h` \[s\] with `method`, `count` samples in
/// all. The maps are those of `math::integrator`; under [`Law::Held`] the period is taken to be `h`.
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
    let mut held = ExactLaw::of(law);
    let mut step = |state: &mut Exact<N>| {
        let effort = match law {
            Law::Constant(effort) => effort.map(Real::from),
            Law::Continuous(..) | Law::Held { .. } => held.held(state, h),
        };
        let acceleration = |_, q: &[Real; N], v: &[Real; N]| Real::acceleration(arm, q, v, &effort);
        let (q, v) = (&state.position, &state.velocity);
        let (dq, dv) = increment(method, acceleration, Real::ZERO, q, v, Real::from(h));
        (state.position, state.velocity) = (plus(q, &dq), plus(v, &dv));
    };
    let sample = |_| {
        (0..every).for_each(|_| step(&mut state));
        (state.position, state.velocity)
    };
    (0..count).map(sample).collect()
}
