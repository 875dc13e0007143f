//! The question in JSON, and the response, which is written a slice at a time.
//!
//! **Invariant:** the formula passes through as text, which a worker parses; a response is never written on an actor's
//! thread.

use actix::prelude::*;
use bytes::Bytes;

use super::{Integration, IntegrationStep, NotIntegrated};
use crate::actors::wire::{Address, Callable, Nodes, Streamed};
use crate::math::integrator::Method;
use crate::math::particle::{MAX_STEPS, Particle};
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::protocol::wire::streamed::StreamedResponse;

/// Numbers encoded between two looks at the clock: some tens of microseconds.
const NUMBERS_PER_LOOK: usize = 1024;

impl Integration {
    /// Enters this node's service into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve_long::<IntegrationStep>(Service::IntegrationStep, address.clone());
    }
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

impl Streamed for IntegrationStep {
    type Writer = Result<SamplesWriter, Bytes>;

    fn begin(answer: Result<Box<Particle>, NotIntegrated>, to: &Address) -> Self::Writer {
        match answer {
            Ok(particle) => Ok(SamplesWriter::new(particle, to)),
            Err(why) => Err(to.failure(&why.to_string())),
        }
    }

    fn advance(writer: &mut Self::Writer) -> Option<Bytes> {
        match writer {
            Ok(encoding) => encoding.advance(),
            Err(failure) => Some(failure.clone()),
        }
    }
}

/// The answer, written a slice at a time: it may be 60 MB.
pub struct SamplesWriter {
    particle: Box<Particle>,
    writer: StreamedResponse,
    array: Array,
    entry: usize,
}

/// Which of the three arrays is being written.
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

    /// Writes some more; the frame, once it is whole.
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
