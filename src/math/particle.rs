//! A particle of unit mass on a line, pushed by a force that depends on time alone: `ẍ = f(t)`, from `t = 0`.
//!
//! `/arm_sim/integration_step` computes this. It uses the same [`increment`] as the live arm and shares nothing else
//! with it. Sample `k` is at the time `k dt`, a product and not a running sum. The same holds for the start times of
//! steps. Position and velocity are summed with compensation (Kahan 1965, Knuth's branch-free two-sum), so that a
//! million steps lose no more digits than one.
//!
//! **Invariant:** steps and work are bounded when a particle is created. A computation in slices gives the same bits
//! as one without.

use super::count::length_in_f64;
use super::expression::{Expression, Stack};
use super::integrator::{Method, increment, two_sum};
use super::shown::Shown;

/// Most steps of one computation. A million samples are about 60 MB of JSON.
pub const MAX_STEPS: u64 = 1_000_000;

/// Most work of one computation, in expression nodes times evaluations: from some seconds to a minute of one core.
pub const MAX_WORK: u64 = 2_000_000_000;

/// Why a computation is refused. The field names are those of the request.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ParticleError {
    /// A starting value or a timestep that is NaN or infinite.
    #[error("{field} must be finite, got {}", Shown(*.value))]
    NotFinite {
        /// `x0`, `xdot0` or `dt`.
        field: &'static str,
        /// The value given.
        value: f64,
    },
    /// A timestep that is zero or negative.
    #[error("dt must be greater than 0, got {}", Shown(*.dt))]
    Timestep {
        /// The value given \[s\].
        dt: f64,
    },
    /// No steps.
    #[error("steps must be at least 1, got 0")]
    NoSteps,
    /// More steps than [`MAX_STEPS`].
    #[error("steps must be at most {MAX_STEPS}, got {steps}")]
    TooManySteps {
        /// The value given.
        steps: u64,
    },
    /// More work than [`MAX_WORK`].
    #[error(
        "function has {nodes} nodes and would be evaluated {evaluations} times, \
         the product must be at most {MAX_WORK}, got {}",
        nodes.saturating_mul(*evaluations)
    )]
    TooMuchWork {
        /// Nodes of the expression.
        nodes: u64,
        /// The number of evaluations.
        evaluations: u64,
    },
}

/// The number of force evaluations in `steps` steps. Saturates.
#[must_use]
pub fn evaluations(steps: u64, method: Method) -> u64 {
    steps.saturating_mul(u64::from(method.evaluations()))
}

/// A computation in progress. It has done a whole number of steps, and keeps every result.
#[derive(Debug, Clone)]
pub struct Particle {
    function: Expression,
    stack: Stack,
    method: Method,
    /// Timestep \[s\].
    dt: f64,
    /// Steps to be made.
    steps: usize,
    /// Evaluations made so far.
    evaluations: u64,
    position: CompensatedSum,
    velocity: CompensatedSum,
    /// Positions so far \[m\], one more than the steps made.
    positions: Vec<f64>,
    /// Velocities so far \[m/s\], as many as positions.
    velocities: Vec<f64>,
}

impl Particle {
    /// A particle at `x0` \[m\] with the velocity `xdot0` \[m/s\], about to make `steps` steps of `dt` \[s\] each.
    ///
    /// # Errors
    /// The first value that is out of bounds, or too much work in total.
    pub fn new(
        function: Expression,
        x0: f64,
        xdot0: f64,
        dt: f64,
        steps: u64,
        method: Method,
    ) -> Result<Self, ParticleError> {
        for (field, value) in [("x0", x0), ("xdot0", xdot0), ("dt", dt)] {
            if !value.is_finite() {
                return Err(ParticleError::NotFinite { field, value });
            }
        }
        if dt <= 0.0 {
            return Err(ParticleError::Timestep { dt });
        }
        if steps == 0 {
            return Err(ParticleError::NoSteps);
        }
        let whole_steps = usize::try_from(steps).ok().filter(|_| steps <= MAX_STEPS);
        let Some(whole_steps) = whole_steps else {
            return Err(ParticleError::TooManySteps { steps });
        };
        let nodes = function.nodes() as u64;
        let evaluations = evaluations(steps, method);
        if nodes.saturating_mul(evaluations) > MAX_WORK {
            return Err(ParticleError::TooMuchWork { nodes, evaluations });
        }
        Ok(Self {
            stack: function.stack(),
            function,
            method,
            dt,
            steps: whole_steps,
            evaluations: 0,
            position: CompensatedSum::new(x0),
            velocity: CompensatedSum::new(xdot0),
            positions: vec![x0],
            velocities: vec![xdot0],
        })
    }

    /// Makes at most `max_steps` of the steps that remain. Returns how many it made: 0 once all are made.
    pub fn advance(&mut self, max_steps: usize) -> usize {
        let count = max_steps.min(self.remaining());
        self.positions.reserve(count);
        self.velocities.reserve(count);
        for _ in 0..count {
            self.step();
        }
        count
    }

    fn step(&mut self) {
        let t = self.time(self.done());
        let Self {
            function,
            stack,
            evaluations,
            ..
        } = self;
        let ([dx], [dv]) = increment(
            self.method,
            |t, _: &[f64; 1], _: &[f64; 1]| {
                *evaluations += 1;
                [function.evaluate_in(stack, t)]
            },
            t,
            &[self.position.value],
            &[self.velocity.value],
            self.dt,
        );
        self.position.add(dx);
        self.velocity.add(dv);
        self.positions.push(self.position.value);
        self.velocities.push(self.velocity.value);
    }

    /// The number of steps that cost at most `work` nodes times evaluations, but at least one: a slice for a worker
    /// before it turns to another task.
    #[must_use]
    pub fn steps_within(&self, work: u64) -> usize {
        let step = (self.function.nodes() as u64).saturating_mul(evaluations(1, self.method));
        usize::try_from(work / step.max(1))
            .unwrap_or(usize::MAX)
            .max(1)
    }

    /// Steps made.
    #[must_use]
    pub fn done(&self) -> usize {
        self.positions.len() - 1
    }

    /// Steps still to be made.
    #[must_use]
    pub fn remaining(&self) -> usize {
        self.steps - self.done()
    }

    /// The number of force evaluations so far.
    #[must_use]
    pub fn evaluations(&self) -> u64 {
        self.evaluations
    }

    /// The time of sample `k` \[s\].
    #[must_use]
    pub fn time(&self, k: usize) -> f64 {
        length_in_f64(k) * self.dt
    }

    /// The times of the samples so far \[s\], the start first.
    pub fn times(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        (0..self.positions.len()).map(|k| self.time(k))
    }

    /// The positions so far \[m\], the start first.
    #[must_use]
    pub fn positions(&self) -> &[f64] {
        &self.positions
    }

    /// The velocities so far \[m/s\], the start first.
    #[must_use]
    pub fn velocities(&self) -> &[f64] {
        &self.velocities
    }
}

/// A sum with its rounding error (compensated summation).
#[derive(Debug, Clone, Copy)]
struct CompensatedSum {
    value: f64,
    /// The rounding error of the value, which the next addition corrects.
    lost: f64,
}

impl CompensatedSum {
    fn new(value: f64) -> Self {
        Self { value, lost: 0.0 }
    }

    fn add(&mut self, term: f64) {
        let (sum, lost) = two_sum(self.value, term + self.lost);
        self.value = sum;
        // If a sum overflows, its rounding error is NaN; an infinite sum must stay infinite, as in ordinary arithmetic.
        self.lost = if lost.is_finite() { lost } else { 0.0 };
    }
}
