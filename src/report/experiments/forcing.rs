//! Forces that are hard on a method, through the computation behind `/arm_sim/integration_step`, against closed forms.
//!
//! | force | what it is hard on |
//! | --- | --- |
//! | smooth | nothing: every method has its order |
//! | kink | the order: at `|t - c|` no derivative beyond the first exists, and what is left is order 2 |
//! | jump | the order: at a step of the force what is left is order 1 |
//! | fast | nothing but patience: it looks stiff, but nothing feeds back, and no timestep is unstable |
//! | aliased | the sampling: where a period falls on whole steps every step sees the same force |
//! | growing | nothing, in parts of what it has grown to |
//!
//! The place of a kink within its step decides about its error, so several kinks are tried and the mean of squares is
//! taken.
//!
//! **Invariant:** what is run is the service's own computation, expression and all.

use crate::math::count::{in_f64, length_in_f64};
use crate::math::expression::Expression;
use crate::math::integrator::Method;
use crate::math::particle::Particle;

/// How long the force acts \[s\].
pub const DURATION: f64 = 2.0;

/// Steps of the coarsest run.
pub const COARSEST: u64 = 16;

/// Frequency of the aliased force \[1/s\]: one period in 1/64 s.
const ALIASED: f64 = 64.0 * std::f64::consts::TAU;

/// Frequency of the fast force \[rad/s\].
const FAST: f64 = 20.0;

/// Kinks and jumps that are tried.
const TRIES: u32 = 32;

/// One kind of force.
#[derive(Debug, Clone, Copy)]
pub struct Force {
    /// Its name.
    pub name: &'static str,
    /// As a formula, `c` being a time.
    pub formula: &'static str,
    /// The order that is left of a method's own.
    pub order: fn(Method) -> u32,
    /// The function for the service, with this `c`.
    function: fn(f64) -> String,
    /// Position of the particle, from rest at 0, with this `c` \[m\].
    exact: fn(f64, f64) -> f64,
    /// Whether `c` matters.
    varied: bool,
}

/// All kinds.
pub const FORCES: [Force; 6] = [
    Force {
        name: "smooth",
        formula: "cos(2 t)",
        order: Method::order,
        function: |_| "cos(2*t)".to_owned(),
        exact: |t, _| 0.5 * t.sin() * t.sin(),
        varied: false,
    },
    Force {
        name: "kink",
        formula: "|t - c|",
        order: |method| method.order().min(2),
        function: |c| format!("abs(t-{c})"),
        exact: |t, c| {
            let after = (t - c).max(0.0);
            0.5 * c * t * t - t * t * t / 6.0 + after * after * after / 3.0
        },
        varied: true,
    },
    Force {
        name: "jump",
        formula: "|t - c| / (t - c)",
        order: |_| 1,
        function: |c| format!("abs(t-{c})/(t-{c})"),
        exact: |t, c| {
            let after = (t - c).max(0.0);
            after * after - 0.5 * t * t
        },
        varied: true,
    },
    Force {
        name: "fast",
        formula: "10⁴ sin(20 t)",
        order: Method::order,
        function: |_| format!("1e4*sin({FAST}*t)"),
        exact: |t, _| 1e4 / (FAST * FAST) * (FAST * t - (FAST * t).sin()),
        varied: false,
    },
    Force {
        name: "aliased",
        formula: "cos(2π 64 t)",
        order: Method::order,
        function: |_| format!("cos({ALIASED}*t)"),
        exact: |t, _| {
            let half = (0.5 * ALIASED * t).sin();
            2.0 * half * half / (ALIASED * ALIASED)
        },
        varied: false,
    },
    Force {
        name: "growing",
        formula: "2^(10 t)",
        order: Method::order,
        function: |_| "2^(10*t)".to_owned(),
        exact: |t, _| {
            let rate = 10.0 * std::f64::consts::LN_2;
            ((rate * t).exp_m1() - rate * t) / (rate * rate)
        },
        varied: false,
    },
];

impl Force {
    /// The largest error over a run of `steps` steps, in parts of the farthest that the particle truly comes; `None`
    /// if it cannot be run.
    #[must_use]
    pub fn error(&self, method: Method, steps: u64) -> Option<f64> {
        let tries = if self.varied { TRIES } else { 1 };
        let mut squares = 0.0;
        for index in 0..tries {
            // Steps of the golden ratio: evenly spread within a step, whatever its length.
            let c = 0.5 + (0.618_033_988_749_894_9 * f64::from(index + 1)).fract();
            let error = self.error_with(c, method, steps)?;
            squares += error * error;
        }
        Some((squares / f64::from(tries)).sqrt())
    }

    fn error_with(&self, c: f64, method: Method, steps: u64) -> Option<f64> {
        let function = Expression::parse(&(self.function)(c)).ok()?;
        let dt = DURATION / in_f64(steps);
        let mut particle = Particle::new(function, 0.0, 0.0, dt, steps, method).ok()?;
        particle.advance(usize::MAX);
        let exact = |t: f64| (self.exact)(t, c);
        let off =
            |(index, position): (usize, &f64)| (position - exact(length_in_f64(index) * dt)).abs();
        let worst = particle.positions().iter().enumerate().map(off);
        // Not at the steps: where they fall on whole periods the particle is where it began at all of them.
        let largest = (0..=1000).map(|part| exact(DURATION * f64::from(part) / 1000.0).abs());
        let most = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, f64::max);
        Some(most(&mut worst.into_iter()) / most(&mut largest.into_iter()))
    }
}
