//! The largest stable timestep, predicted.
//!
//! A method steps the linear system of [`Linear`] by a matrix, `x ↦ (I + h E) x`. The loop is stable at the timestep
//! `h` as long as no eigenvalue `1 + h μ` of that matrix leaves the unit circle: `2 Re μ + h |μ|² ≤ 0` for every
//! eigenvalue μ of `E`. `E` is formed without subtracting the identity, so growth of one part in 10¹² is resolved at
//! any timestep.
//!
//! | control | what is stepped | `E` |
//! | --- | --- | --- |
//! | in every stage | the loop `ẋ = A x` | Runge-Kutta of order p: `A + h/2 A² + … + h^(p-1)/p! A^p` |
//! | held over the step | the arm with constant efforts, then the law closes the loop | monodromy matrix of a period |
//!
//! Verlet steps positions (and integrals) by `A + h/2 A²`, velocities by the mean of the accelerations at the start and
//! at the predicted state. The held law is the live arm's: the integral is updated with the error before it is used.
//!
//! Source: Hairer and Wanner, *Solving Ordinary Differential Equations II* (1996), ch. IV.2; for sampled control,
//! Åström and Wittenmark, *Computer-Controlled Systems* (1997), ch. 2 and 3.
//!
//! **Invariant:** the result is the end of the stable interval that begins at zero. Stable intervals beyond it are
//! ignored.

use super::control_loop::ControlLoop;
pub use super::critical::{BEYOND, Critical};
pub use super::limits::{ADVISED_PART, Limits, Rest, limit_held, limits, search_limits};
use super::linear::Linear;
use super::matrix::{Complex, Matrix, largest, largest_above};
use super::paused::{at_once, pause};
pub use super::proof::most_bytes;
use super::slow_modes;
use crate::math::integrator::Method;

/// Growth within rounding error, relative to the fastest eigenvalue. The computed eigenvalues of graded 9×9 matrices
/// have errors of some 1e-13.
pub(super) const NEUTRAL: f64 = 1e-11;

/// Modes below this part of the fastest rate say nothing about the timestep: the square root of [`NEUTRAL`]. Rounding
/// spreads a double eigenvalue at zero, such as that of a joint that drifts, to the square root of its size, so such a
/// mode may only seem to grow. The growth that a timestep causes is below [`NEUTRAL`] for all of them, and [`slow_modes`]
/// finds growth in continuous time.
const DOUBTFUL: f64 = 3.2e-6;

/// Start of the search, in units of the fastest time constant. An undamped swing already grows measurably here under
/// Euler (1e-3) and midpoint (2.5e-10).
const SEARCH_START: f64 = 1e-3;

/// Up to here the search doubles the timestep: far below the limit of the fast mode, growth changes slowly and
/// regularly.
const SEARCH_FINE: f64 = 0.1;

/// Factor between the timesteps of the search beyond. It may miss an unstable interval that is narrower.
const SEARCH_STEP: f64 = 1.05;

/// End of the search, in the same units. No limit of the explicit methods exceeds 3.
const SEARCH_END: f64 = 30.0;

/// When the control law is evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Sampling {
    /// Once a step; the effort is held through all stages, as in the live arm.
    Held,
    /// In every stage, as if the law were part of the arm.
    Continuous,
}

impl Sampling {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Held, Self::Continuous];
}

/// The largest stable timestep of a linear loop \[s\]: see [`Limits`] for `None` and zero.
pub fn largest_timestep(linear: &Linear, method: Method, sampling: Sampling) -> Option<f64> {
    Stepping::new(linear, method, sampling).limit()
}

/// The step matrix itself, over one step of `h` \[s\]; states as in [`Linear::flow`].
pub fn step_matrix(linear: &Linear, method: Method, sampling: Sampling, h: f64) -> Matrix {
    Stepping::new(linear, method, sampling).matrix(h)
}

/// The loop in continuous time.
pub(super) struct Modes {
    eigenvalues: Vec<Complex>,
    /// The fastest rate \[1/s\].
    rate: f64,
    /// Whether a mode grows so slowly that rounding hides it in its eigenvalue.
    slow_growth: bool,
}

impl Modes {
    pub(super) fn of(linear: &Linear) -> Self {
        Self::of_flow(&linear.flow())
    }

    /// The modes of `ẋ = flow · x`.
    pub(super) fn of_flow(flow: &Matrix) -> Self {
        let eigenvalues = flow.eigenvalues();
        let rate = largest(eigenvalues.iter().map(|mode| mode.modulus()));
        Self {
            slow_growth: slow_modes::grows(flow, &eigenvalues, rate, DOUBTFUL * rate),
            rate,
            eigenvalues,
        }
    }

    /// A timestep far below the fastest time constant \[s\].
    pub(super) fn tiny(&self) -> f64 {
        SEARCH_START / self.rate
    }

    /// The fastest growth of any mode, or the slowest decay \[1/s\].
    pub(super) fn growth(&self) -> f64 {
        let growth = self.eigenvalues.iter().map(|mode| mode.re);
        growth.fold(f64::NEG_INFINITY, f64::max)
    }

    /// A period \[s\] far above the slowest time constant of the modes that are not [`DOUBTFUL`], and above that of the
    /// fastest mode in each of the `steps`.
    pub(super) fn long(&self, steps: u32) -> f64 {
        let rates = self.eigenvalues.iter().map(|mode| mode.modulus());
        let slowest = rates
            .filter(|it| *it >= DOUBTFUL * self.rate)
            .fold(self.rate / f64::from(steps), f64::min);
        SEARCH_END / slowest
    }

    /// The number of modes that are [`DOUBTFUL`] and do not clearly decay.
    fn slow(&self) -> usize {
        let least = DOUBTFUL * self.rate;
        let decays = |mode: &Complex| mode.re < -0.5 * mode.modulus();
        let slow = |mode: &&Complex| mode.modulus() < least && !decays(mode);
        self.eigenvalues.iter().filter(slow).count()
    }

    /// Whether a mode clearly grows, also if rounding has spread a double eigenvalue near zero.
    pub(super) fn clearly_grow(&self) -> bool {
        let least = DOUBTFUL * self.rate;
        let grows = |mode: &Complex| mode.modulus() >= least && mode.re > 0.1 * NEUTRAL * self.rate;
        self.slow_growth || self.eigenvalues.iter().any(grows)
    }

    /// Whether a mode is unstable at every timestep. It grows, or is so close to neutral that rounding decides its
    /// sign: a double eigenvalue near zero has an error of the square root of the rounding error.
    pub(super) fn run_away(&self) -> bool {
        let noise = 0.1 * NEUTRAL * self.rate;
        let grows = |mode: &Complex| {
            let is_doubtful = mode.modulus() > 0.0 && mode.modulus() < DOUBTFUL * self.rate;
            mode.re > if is_doubtful { -noise } else { noise } || mode.re.is_nan()
        };
        self.slow_growth || self.eigenvalues.iter().any(grows)
    }
}

/// A linear loop with the method, sampling and number of steps per period.
pub struct Stepping<'a> {
    linear: &'a Linear,
    method: Method,
    sampling: Sampling,
    /// Steps of the method in one control period.
    substeps: u32,
    /// The number of periods after which a held effort acts.
    delay: u8,
    /// The matrix of the stepped system: the loop, or the arm with constant efforts.
    stepped: Matrix,
}

impl<'a> Stepping<'a> {
    pub(super) fn new(linear: &'a Linear, method: Method, sampling: Sampling) -> Self {
        Self {
            linear,
            method,
            sampling,
            substeps: 1,
            delay: 0,
            stepped: match sampling {
                Sampling::Continuous => linear.flow(),
                Sampling::Held => linear.plant(),
            },
        }
    }

    /// The law once in a control period of `substeps` steps; its effort acts `delay` periods late, as with a bus or a
    /// slow controller.
    pub fn held(linear: &'a Linear, method: Method, substeps: u32, delay: u8) -> Self {
        Self {
            substeps: substeps.max(1),
            delay,
            ..Self::new(linear, method, Sampling::Held)
        }
    }

    /// A loop whose law runs in every step, with the delay of `control`, or in every stage.
    pub(super) fn of<const N: usize>(
        linear: &'a Linear,
        control: &ControlLoop<N>,
        sampling: Sampling,
    ) -> Self {
        Self {
            delay: control.period.delay,
            ..Self::new(linear, control.method, sampling)
        }
    }

    /// The largest stable period \[s\]: see [`Limits`] for `None` and zero.
    pub fn limit(&self) -> Option<f64> {
        self.search(&Modes::of(self.linear))
    }

    /// The matrix by which one period \[s\] changes a deviation; states as in [`Linear::flow`].
    pub fn matrix(&self, period: f64) -> Matrix {
        self.generator(period).scaled(period).plus_diagonal(1.0)
    }

    /// `E` of `x ↦ (I + T E) x` over the period `T` \[s\].
    pub(super) fn generator(&self, period: f64) -> Matrix {
        let h = period / f64::from(self.substeps);
        let free = if self.method == Method::Verlet {
            self.verlet(h)
        } else {
            runge_kutta(&self.stepped, self.method.order(), h)
        };
        match self.sampling {
            Sampling::Continuous => free,
            Sampling::Held if self.delay > 0 || self.linear.differences => {
                let arm = repeated(&free, h, self.substeps);
                self.linear.closed_late(&arm, period, self.delay)
            }
            Sampling::Held => {
                let arm = repeated(&free, h, self.substeps);
                self.linear.closed(&arm, period)
            }
        }
    }

    /// Velocity Verlet, its predictor and one correction, on the states in [`Linear`]'s order.
    fn verlet(&self, h: f64) -> Matrix {
        let (n, a) = (self.linear.joints(), &self.stepped);
        // The rows of velocities, and all others.
        let rows = |others: &Matrix, velocities: &Matrix| {
            Matrix::from_fn(a.size(), |row, column| {
                let matrix = if (n..2 * n).contains(&row) {
                    velocities
                } else {
                    others
                };
                matrix[(row, column)]
            })
        };
        let second = a.clone().plus(0.5 * h, &a.product(a));
        let predicted = rows(&second, a);
        rows(&second, &a.clone().plus(0.5 * h, &a.product(&predicted)))
    }

    /// Fastest growth of any mode in a period \[s\], as of [`growth`].
    pub(super) fn growth(&self, period: f64) -> f64 {
        let slow_modes = || Modes::of(self.linear).slow();
        growth(&self.generator(period), period, slow_modes)
    }

    /// Whether no mode grows at this period. NaN counts as unstable.
    pub(super) fn is_stable(&self, period: f64) -> bool {
        self.growth(period) <= NEUTRAL
    }

    /// The first unstable period, as of [`first_unstable`].
    pub(super) fn search(&self, modes: &Modes) -> Option<f64> {
        at_once(first_unstable(modes, |period| self.growth(period)))
    }
}

/// Fastest growth of any mode of `x ↦ (I + T E) x`, `max (2 Re μ + T |μ|²)`, relative to the largest `|μ|`; NaN if not
/// finite. `slow_modes` counts the modes of the loop in continuous time that are [`DOUBTFUL`]: that many of those that
/// seem to grow here say nothing.
pub(super) fn growth(generator: &Matrix, period: f64, slow_modes: impl FnOnce() -> usize) -> f64 {
    let mut values = generator.eigenvalues();
    let fastest = largest(values.iter().map(|mu| mu.modulus()));
    if fastest == 0.0 {
        return 0.0;
    }
    let growth = |mu: &Complex| (2.0 * mu.re + period * mu.modulus() * mu.modulus()) / fastest;
    let is_doubtful = |mu: &&Complex| mu.modulus() < DOUBTFUL * fastest;
    values.sort_by(|one, other| one.modulus().total_cmp(&other.modulus()));
    let doubtful = values.iter().take_while(is_doubtful);
    // Near its limit a fast mode has a small `|μ|` too.
    let mut silent = match doubtful.filter(|mu| growth(mu) > 0.0).count() {
        0 => 0,
        growing => growing.min(slow_modes()),
    };
    let growths = values.iter().map(growth).map(|growth| {
        if growth > 0.0 && silent > 0 {
            silent -= 1;
            return 0.0;
        }
        growth
    });
    largest_above(f64::NEG_INFINITY, growths)
}

/// `((I + h E)^m - I) / (m h)` for the `m` substeps of a period, by repeated squaring.
pub(crate) fn repeated(step: &Matrix, h: f64, substeps: u32) -> Matrix {
    let mut sum = step.clone();
    // Each binary digit of `m` after the first doubles the number of steps, and a 1 adds one.
    for digit in (0..substeps.ilog2()).rev() {
        let square = sum.product(&sum);
        sum = sum.scaled(2.0).plus(h, &square);
        if substeps >> digit & 1 == 1 {
            let product = step.product(&sum);
            sum = sum.plus(1.0, step).plus(h, &product);
        }
    }
    sum.scaled(1.0 / f64::from(substeps))
}

/// Increases the period \[s\] from far below the fastest time constant to the first unstable one, then bisects. `growth`
/// is that of a period, as of [`growth`]. A piece has one evaluation of it.
pub(super) async fn first_unstable(modes: &Modes, growth: impl Fn(f64) -> f64) -> Option<f64> {
    first_unstable_until(modes, SEARCH_END / modes.rate, growth).await
}

/// The same up to the period `end` \[s\].
pub(super) async fn first_unstable_until(
    modes: &Modes,
    end: f64,
    growth: impl Fn(f64) -> f64,
) -> Option<f64> {
    let rate = modes.rate;
    if rate == 0.0 {
        return None;
    }
    // At timesteps at which the fast modes are stable, the stability of the slow ones does not depend on the
    // timestep.
    if modes.slow_growth {
        return Some(0.0);
    }
    let is_stable = |period: f64| growth(period) <= NEUTRAL;
    let start = modes.tiny();
    if !is_stable(start) {
        // A loop with almost no damping may still be stable at periods a thousand times shorter. It must decay
        // there. A loop that only seems neutral may grow too slowly to be detected, as an undamped swing does under
        // midpoint.
        let tiny = 1e-3 * start;
        return if growth(tiny) < -NEUTRAL {
            Some(bisect_in_pieces((tiny, start), 60, is_stable).await)
        } else {
            Some(0.0)
        };
    }
    let mut stable = start;
    while stable < end {
        let step = if stable * rate < SEARCH_FINE {
            2.0
        } else {
            SEARCH_STEP
        };
        let next = step * stable;
        pause().await;
        if !is_stable(next) {
            return Some(bisect_in_pieces((stable, next), 60, is_stable).await);
        }
        stable = next;
    }
    None
}

/// The boundary between a value for which a condition holds and a larger one for which it does not. The search ends at
/// a relative width of 1e-13, or after the given number of halvings of the logarithm.
pub(crate) fn bisect(range: (f64, f64), halvings: u32, holds: impl Fn(f64) -> bool) -> f64 {
    at_once(bisect_in_pieces(range, halvings, holds))
}

/// The same; a piece has one evaluation of the condition.
pub(super) async fn bisect_in_pieces(
    (mut holding, mut failing): (f64, f64),
    halvings: u32,
    holds: impl Fn(f64) -> bool,
) -> f64 {
    for _ in 0..halvings {
        let middle = (holding * failing).sqrt();
        if middle <= holding || middle >= failing || failing - holding < 1e-13 * holding {
            break;
        }
        pause().await;
        *(if holds(middle) {
            &mut holding
        } else {
            &mut failing
        }) = middle;
    }
    holding
}

/// `A + h/2 A² + … + h^(p-1)/p! A^p`, by Horner's rule.
pub(crate) fn runge_kutta(a: &Matrix, order: u32, h: f64) -> Matrix {
    let mut sum = a.clone();
    for k in (2..=order).rev() {
        sum = a.clone().plus(h / f64::from(k), &a.product(&sum));
    }
    sum
}
