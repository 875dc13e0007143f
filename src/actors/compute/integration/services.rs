//! The request to `integration`, its reader, and the writer of its answer, in slices.
//!
//! **Invariant:** a worker parses the formula's text, and writes the response. No actor's thread does.

use bytes::Bytes;

use crate::actors::node::Ask;
use crate::actors::wire::{Address, Callable, ResponseWriter, Streamed};
use crate::math::integrator::Method;
use crate::math::particle::{MAX_STEPS, Particle, ParticleError};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::protocol::wire::streamed::StreamedResponse;
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

/// Numbers encoded between two checks of the clock: some tens of microseconds.
const NUMBERS_PER_LOOK: usize = 1024;

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

impl Streamed for IntegrationStep {
    fn begin(
        answer: Result<Box<Particle>, NotIntegrated>,
        to: &Address,
    ) -> Box<dyn ResponseWriter> {
        match answer {
            Ok(particle) => Box::new(SamplesWriter::new(particle, to)),
            Err(why) => Box::new(Some(to.failure(&why.to_string()))),
        }
    }
}

/// The answer, written in slices. It may have 60 MB.
struct SamplesWriter {
    particle: Box<Particle>,
    writer: StreamedResponse,
    array: Array,
    entry: usize,
}

/// The index of the array that is being written, of three.
#[derive(Clone, Copy)]
enum Array {
    Times,
    Positions,
    Velocities,
}

impl SamplesWriter {
    fn new(particle: Box<Particle>, to: &Address) -> Self {
        let mut writer = StreamedResponse::new(to.name(), to.id());
        writer.raw("{\"times\":[");
        Self {
            particle,
            writer,
            array: Array::Times,
            entry: 0,
        }
    }

    fn value(&self, entry: usize) -> f64 {
        match self.array {
            Array::Times => self.particle.time(entry),
            Array::Positions => self
                .particle
                .positions()
                .get(entry)
                .copied()
                .unwrap_or(f64::NAN),
            Array::Velocities => self
                .particle
                .velocities()
                .get(entry)
                .copied()
                .unwrap_or(f64::NAN),
        }
    }
}

impl ResponseWriter for SamplesWriter {
    fn advance(&mut self) -> Option<Bytes> {
        let samples = self.particle.positions().len();
        let end = samples.min(self.entry + NUMBERS_PER_LOOK);
        for entry in self.entry..end {
            if entry > 0 {
                self.writer.raw(",");
            }
            self.writer.number(self.value(entry));
        }
        self.entry = end;
        if end < samples {
            return None;
        }
        self.entry = 0;
        self.array = match self.array {
            Array::Times => {
                self.writer.raw("],\"positions\":[");
                Array::Positions
            }
            Array::Positions => {
                self.writer.raw("],\"velocities\":[");
                Array::Velocities
            }
            Array::Velocities => {
                self.writer.raw("]}");
                return Some(std::mem::take(&mut self.writer).finish(true, ""));
            }
        };
        None
    }
}
