//! The computation behind `/arm_sim/integration_step`: a unit mass pushed by `f(t)`.
//!
//! [`accuracy`] holds what the numbers must be, [`results`] how they come back, [`limits`] what is refused.
//!
//! **Invariant:** every expected number comes from the 50-digit oracle, a closed form, or the formula that the
//! specification gives; none from a run of this program.
mod accuracy;
mod limits;
mod results;

use pendularm::math::expression::Expression;
use pendularm::math::integrator::Method;
use pendularm::math::particle::Particle;

pub(crate) fn expression(text: &str) -> Expression {
    Expression::parse(text).unwrap()
}

/// A finished computation.
pub(crate) fn run(text: &str, start: (f64, f64), dt: f64, steps: u64, method: Method) -> Particle {
    let mut particle =
        Particle::new(expression(text), start.0, start.1, dt, steps, method).unwrap();
    particle.advance(usize::MAX);
    assert_eq!(particle.remaining(), 0);
    particle
}

pub(crate) fn last(samples: &[f64]) -> f64 {
    *samples.last().unwrap()
}
