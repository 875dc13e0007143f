//! Reference motions: the same arm, another derivation, twice the digits, and a bound on their own error.
//!
//! An error, in the study, is a distance to one of these. A motion is expanded in Taylor series of high order in
//! double-double arithmetic from the Lagrangian ([`ReferenceMotion::of`]), twice with different order and tolerance;
//! the distance of the two is [`ReferenceMotion::uncertainty`]. Control is either the law at every instant, or its
//! effort held from one control instant to the next as the live arm holds it. [`exact_steps`] takes the steps of the
//! methods in the same arithmetic: their truncation error without rounding.
//!
//! **Invariant:** nothing of the live arm's kernel or stepper is used, only its parameters.

mod double_double;
mod lagrangian;
mod path;
mod steps;
mod taylor;

pub use double_double::DoubleDouble;
pub use path::ReferencePath;
pub use steps::exact_steps;

use crate::math::arm::{Arm, State};
use crate::math::pid::{Gains, INTEGRAL_LIMIT, Setpoint};
use lagrangian::Lagrangian;
use taylor::{Exact, JointDrive, Setting, Taylor};

/// The setting whose motion is kept.
const FINE: Setting = Setting {
    order: 30,
    tolerance: 1e-32,
};

/// The setting that it is judged by: other order, other steps.
const COARSE: Setting = Setting {
    order: 22,
    tolerance: 1e-30,
};

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

/// A motion at chosen times.
#[derive(Debug, Clone)]
pub struct ReferenceMotion<const N: usize> {
    /// Joint angles \[rad\] and rates \[rad/s\].
    samples: Vec<([DoubleDouble; N], [DoubleDouble; N])>,
    uncertainty: Vec<f64>,
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
        Self::judged(|setting| motion(arm, start, law, intervals, setting))
    }

    fn judged(motion: impl Fn(Setting) -> Vec<Exact<N>>) -> Self {
        let (fine, coarse) = (motion(FINE), motion(COARSE));
        let uncertainty = fine.iter().zip(&coarse).map(|(a, b)| {
            a.position
                .iter()
                .zip(&b.position)
                .map(|(a, b)| (*a - *b).abs().to_f64())
                .fold(0.0, f64::max)
        });
        Self {
            uncertainty: uncertainty.collect(),
            samples: fine.iter().map(|e| (e.position, e.velocity)).collect(),
        }
    }

    /// How many samples there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// How far the angles of each sample may be off: the largest difference between two settings \[rad\].
    #[must_use]
    pub fn uncertainty(&self) -> &[f64] {
        &self.uncertainty
    }

    /// Joint angles \[rad\] and rates \[rad/s\] of every sample.
    #[must_use]
    pub fn samples(&self) -> &[([DoubleDouble; N], [DoubleDouble; N])] {
        &self.samples
    }

    /// The state of sample `index`, rounded to doubles.
    #[must_use]
    pub fn state(&self, index: usize) -> Option<State<N>> {
        let (position, velocity) = self.samples.get(index)?;
        Some(State {
            position: position.map(DoubleDouble::to_f64),
            velocity: velocity.map(DoubleDouble::to_f64),
        })
    }

    /// The largest angle error of `position` against sample `index` \[rad\].
    #[must_use]
    pub fn angle_error(&self, index: usize, position: &[f64; N]) -> Option<f64> {
        let (exact, _) = self.samples.get(index)?;
        Some(largest_difference(exact, position))
    }
}

/// Joint accelerations \[rad/s²\] under the efforts `tau` \[N m\], from the Lagrangian with 106 bits.
#[must_use]
pub fn exact_acceleration<const N: usize>(
    arm: &Arm<N>,
    state: &State<N>,
    tau: &[f64; N],
) -> [DoubleDouble; N] {
    let real = |values: &[f64; N]| values.map(DoubleDouble::from);
    Lagrangian::new(arm).acceleration(&real(&state.position), &real(&state.velocity), &real(tau))
}

/// `max |exact - value|`, the difference rounded only once it is taken; NaN if a value is.
#[must_use]
pub fn largest_difference<const N: usize>(exact: &[DoubleDouble; N], values: &[f64; N]) -> f64 {
    exact.iter().zip(values).fold(0.0, |largest, (e, value)| {
        let difference = e.minus(*value).abs();
        if difference <= largest {
            largest
        } else {
            difference
        }
    })
}

fn motion<const N: usize>(
    arm: &Arm<N>,
    start: &State<N>,
    law: &Law<N>,
    intervals: &[f64],
    setting: Setting,
) -> Vec<Exact<N>> {
    let mut taylor = Taylor::new(arm, setting);
    let mut state = exact(start);
    let mut samples = Vec::with_capacity(intervals.len());
    for &interval in intervals {
        if let Some(drive) = continuous_drive(law) {
            taylor.advance(&mut state, &drive, interval);
        } else if let Law::Held {
            gains,
            setpoint,
            period,
        } = law
        {
            for _ in 0..whole_periods(interval, *period) {
                let effort = held(gains, setpoint, &mut state, *period);
                taylor.advance(&mut state, &JointDrive::Constant(effort), *period);
            }
        }
        samples.push(state);
    }
    samples
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a ratio of two positive times; a cast saturates"
)]
fn whole_periods(interval: f64, period: f64) -> u64 {
    ((interval / period).round() as u64).max(1)
}

fn exact<const N: usize>(start: &State<N>) -> Exact<N> {
    Exact {
        position: start.position.map(DoubleDouble::from),
        velocity: start.velocity.map(DoubleDouble::from),
        integral: [DoubleDouble::ZERO; N],
    }
}

/// The drive of a law that acts at every instant.
fn continuous_drive<const N: usize>(law: &Law<N>) -> Option<JointDrive<N>> {
    match law {
        Law::Constant(effort) => Some(JointDrive::Constant(effort.map(DoubleDouble::from))),
        Law::Continuous(gains, setpoint) => Some(JointDrive::Law {
            kp: gains.kp.map(DoubleDouble::from),
            ki: gains.ki.map(DoubleDouble::from),
            kd: gains.kd.map(DoubleDouble::from),
            position: setpoint.position.map(DoubleDouble::from),
            velocity: setpoint.velocity.map(DoubleDouble::from),
        }),
        Law::Held { .. } => None,
    }
}

/// The shipped law at a control instant: moves the integral on, answers the effort.
#[allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]
fn held<const N: usize>(
    gains: &Gains<N>,
    setpoint: &Setpoint<N>,
    state: &mut Exact<N>,
    period: f64,
) -> [DoubleDouble; N] {
    let real = DoubleDouble::from;
    std::array::from_fn(|i| {
        let error = real(setpoint.position[i]) - state.position[i];
        state.integral[i] = (state.integral[i] + error * real(period)).clamp(INTEGRAL_LIMIT);
        real(gains.kp[i]) * error
            + real(gains.ki[i]) * state.integral[i]
            + real(gains.kd[i]) * (real(setpoint.velocity[i]) - state.velocity[i])
    })
}
