//! `/arm_sim/integration_step`: integrates `x'' = f(t)`, independent of the live arm.
//!
//! **Invariant:** the formula is parsed with the computation, and not when the request is read.

use std::time::Duration;

use bytes::Bytes;

use super::{NUMBER_BYTES, Work};
use crate::math::expression::Expression;
use crate::math::integrator::Method;
use crate::math::particle::{MAX_STEPS, Particle, ParticleError};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, RejectedField, Rejections};
use crate::services::{Address, Ask};

/// Expression nodes evaluated between two checks of the clock: some hundred microseconds.
const NODES_PER_LOOK: u64 = 50_000;
/// Largest memory of a parsed expression per byte of its text.
const EXPRESSION_BYTES: usize = 32;

/// Integrates a particle of one degree of freedom. One bad field rejects the whole request.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct IntegrationStep {
    /// Its acceleration as a formula \[m/s²\], of t in s.
    pub function: Option<String>,
    /// Initial position \[m\].
    pub x0: Option<f64>,
    /// Initial velocity \[m/s\]; 0 by default.
    pub xdot0: Option<f64>,
    /// Length of a step \[s\], greater than 0.
    pub dt: Option<f64>,
    /// The number of steps.
    pub steps: Option<u64>,
    /// The method that takes the steps.
    pub method: Option<Method>,
    /// Fields that were not valid.
    pub rejected: Rejections,
}

/// Why there was no integration.
#[derive(Debug, thiserror::Error)]
pub enum NotIntegrated {
    /// Fields were rejected.
    #[error("{0}")]
    Rejected(Rejections),
    /// The fields do not fit together.
    #[error(transparent)]
    Particle(#[from] ParticleError),
}

/// A particle in progress.
pub enum Integrating {
    /// The request, before the formula is parsed.
    Asked(IntegrationStep),
    /// Steps are being taken.
    Stepping(Box<Particle>),
    /// The answer has been returned.
    Done,
}

impl Work<Result<Box<Particle>, NotIntegrated>> for Integrating {
    fn most_bytes(&self) -> usize {
        let Self::Asked(ask) = self else {
            return 0;
        };
        let steps = usize::try_from(ask.steps.unwrap_or_default()).unwrap_or(usize::MAX);
        let values = steps.saturating_add(1).saturating_mul(3 * NUMBER_BYTES);
        let function = ask.function.as_ref().map_or(0, String::len);
        values.saturating_add(EXPRESSION_BYTES * function)
    }

    fn advance(&mut self, _: fn() -> Duration) -> Option<Result<Box<Particle>, NotIntegrated>> {
        match std::mem::replace(self, Self::Done) {
            Self::Asked(ask) => match begin(ask) {
                Ok(particle) => *self = Self::Stepping(Box::new(particle)),
                Err(why) => return Some(Err(why)),
            },
            Self::Stepping(mut particle) => {
                if particle.advance(particle.steps_within(NODES_PER_LOOK)) == 0 {
                    return Some(Ok(particle));
                }
                *self = Self::Stepping(particle);
            }
            Self::Done => debug_assert!(false, "the particle has been given away"),
        }
        None
    }
}

/// Parses the formula. Every wrong field is named, in the order of the request, with the formula first.
fn begin(ask: IntegrationStep) -> Result<Particle, NotIntegrated> {
    let function = ask.function.as_deref().map(Expression::parse);
    let mut rejected = match &function {
        Some(Err(why)) => RejectedField::refused("function:", why).into(),
        _ => Rejections::default(),
    };
    rejected.append(ask.rejected);
    match (function, ask.x0, ask.dt, ask.steps, ask.method) {
        (Some(Ok(function)), Some(x0), Some(dt), Some(steps), Some(method))
            if rejected.is_empty() =>
        {
            let xdot0 = ask.xdot0.unwrap_or(0.0);
            Ok(Particle::new(function, x0, xdot0, dt, steps, method)?)
        }
        _ => Err(NotIntegrated::Rejected(rejected)),
    }
}

impl Ask for IntegrationStep {
    type Answer = Result<Box<Particle>, NotIntegrated>;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        Ok(Self {
            function: fields.text("function").map(std::borrow::Cow::into_owned),
            x0: fields.number("x0", Bound::Finite),
            xdot0: fields.number("xdot0", Bound::Finite),
            dt: fields.number("dt", Bound::Positive),
            steps: fields.count("steps", 1..=MAX_STEPS),
            method: fields.choice("integrator", &Method::ALL, Method::name),
            rejected: fields.finish(),
        })
    }

    fn write(answer: Result<Box<Particle>, NotIntegrated>, to: &Address) -> Bytes {
        to.outcome(answer.as_ref().map(|particle| {
            object! {
                times: particle.times().collect::<Vec<_>>(),
                positions: particle.positions(),
                velocities: particle.velocities(),
            }
        }))
    }
}
