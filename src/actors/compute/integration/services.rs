//! The question to `integration`, how it is read, and how its answer is written.
//!
//! **Invariant:** a worker parses the formula's text, and writes the response. No actor's thread does.

use bytes::Bytes;
use serde::Serialize;

use crate::actors::node::Ask;
use crate::actors::wire::{Address, Answered, Callable};
use crate::math::integrator::Method;
use crate::math::particle::{MAX_STEPS, Particle, ParticleError};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};

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

impl Ask for IntegrationStep {
    type Answer = Result<Box<Particle>, NotIntegrated>;
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

impl Callable for IntegrationStep {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        Ok(Self {
            function: fields.text("function").map(std::borrow::Cow::into_owned),
            x0: fields.number("x0", Bound::Finite),
            xdot0: fields.number("xdot0", Bound::Finite),
            dt: fields.number("dt", Bound::Positive),
            steps: fields.count("steps", MAX_STEPS),
            method: fields.choice("integrator", &Method::ALL, Method::name),
            rejected: fields.finish(),
        })
    }
}

impl Answered for IntegrationStep {
    fn write(answer: Result<Box<Particle>, NotIntegrated>, to: &Address) -> Bytes {
        /// The samples, in the order of the documentation.
        #[derive(Serialize)]
        struct Samples<'a> {
            times: Vec<f64>,
            positions: &'a [f64],
            velocities: &'a [f64],
        }
        let particle = match answer {
            Ok(particle) => particle,
            Err(why) => return to.failure(&why.to_string()),
        };
        let positions = particle.positions();
        let samples = Samples {
            times: (0..positions.len()).map(|at| particle.time(at)).collect(),
            positions,
            velocities: particle.velocities(),
        };
        to.response(&samples, "")
    }
}
