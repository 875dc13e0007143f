//! `/arm_sim/integration_step`: the four methods on `x'' = f(t)`, done on the worker pool, apart from the live arm.
//!
//! The request is read, computed and encoded by a worker, in slices. A connection hands over one computation at a time.
//!
//! **Invariant:** nothing here knows the arm; whatever is asked, the arm and the other clients go on.

use std::time::Instant;

use actix::prelude::*;
use bytes::Bytes;

use super::budget::NoRoom;
use super::node::{Reply, ServiceCall};
use super::registry::Nodes;
use super::workers::{Computation, Progress, WorkerPool};
use crate::math::expression::Expression;
use crate::math::integrator::Method;
use crate::math::particle::{MAX_STEPS, Particle};
use crate::protocol::catalog::Service;
use crate::protocol::fields::{Bound, Fields};
use crate::protocol::op::Arguments;
use crate::protocol::streamed::StreamedResponse;

/// Expression nodes evaluated between two looks at the clock: some hundred microseconds.
const NODES_PER_LOOK: u64 = 50_000;
/// The longest number and the comma behind it, and the number itself while the answer is computed.
pub(super) const NUMBER_BYTES: usize = 25 + 8;
/// What a byte of an expression may cost once it has been read.
const EXPRESSION_BYTES: usize = 32;
/// Numbers encoded between two looks at the clock: some tens of microseconds.
const NUMBERS_PER_LOOK: usize = 1024;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The actor that takes the calls and hands them to the workers.
pub struct Integration {
    workers: WorkerPool,
}

impl Integration {
    /// An actor that computes on `workers`.
    #[must_use]
    pub fn new(workers: WorkerPool) -> Self {
        Self { workers }
    }

    /// Enters this node's service into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes
            .services
            .insert(Service::IntegrationStep, address.clone().recipient());
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl Actor for Integration {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Handler<ServiceCall> for Integration {
    type Result = ();

    fn handle(&mut self, call: ServiceCall, _: &mut Context<Self>) {
        let stage = Stage::Unread(call.arguments);
        self.workers.submit(Box::new(IntegrationStep {
            reply: call.reply,
            stage,
        }));
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

/// One call, on its way through the workers.
struct IntegrationStep {
    reply: Reply,
    stage: Stage,
}

enum Stage {
    Unread(Arguments),
    Stepping(Box<Particle>),
    Encoding(Box<Encoding>),
    Done,
}

impl Computation for IntegrationStep {
    fn advance(&mut self, deadline: Instant) -> Progress {
        loop {
            // Looked at first: an answer once given is not followed by another because the caller has left meanwhile.
            if matches!(self.stage, Stage::Done) {
                return Progress::Finished;
            }
            if self.reply.caller_is_gone() {
                self.refuse("the caller is gone");
            }
            self.stage = match std::mem::replace(&mut self.stage, Stage::Done) {
                Stage::Unread(arguments) => match self.begin(&arguments) {
                    Ok(particle) => Stage::Stepping(Box::new(particle)),
                    Err(None) => {
                        self.stage = Stage::Unread(arguments);
                        return Progress::Waiting;
                    }
                    Err(Some(why)) => {
                        self.reply.refuse(&why);
                        Stage::Done
                    }
                },
                Stage::Stepping(mut particle) => {
                    if particle.advance(particle.steps_within(NODES_PER_LOOK)) > 0 {
                        Stage::Stepping(particle)
                    } else {
                        Stage::Encoding(Box::new(Encoding::new(&self.reply, particle)))
                    }
                }
                Stage::Encoding(mut encoding) => match encoding.advance() {
                    None => Stage::Encoding(encoding),
                    Some(frame) => {
                        self.reply.answer_with(frame);
                        Stage::Done
                    }
                },
                Stage::Done => Stage::Done,
            };
            if Instant::now() >= deadline && !matches!(self.stage, Stage::Done) {
                return Progress::Unfinished;
            }
        }
    }

    fn refuse(&mut self, why: &str) {
        // The pool may end between the answer and the last look at the clock.
        if matches!(self.stage, Stage::Done) {
            return;
        }
        self.reply.refuse(why);
        self.stage = Stage::Done;
    }
}

impl IntegrationStep {
    /// Takes room for the answer, then reads the request; refused for the reason given, or without one put off.
    fn begin(&mut self, arguments: &Arguments) -> Result<Particle, Option<String>> {
        match self.reply.reserve(most_bytes(arguments)) {
            Ok(()) => read(arguments).map_err(Some),
            Err(NoRoom::Yet) => Err(None),
            Err(NoRoom::Now) => Err(Some(NoRoom::Now.to_string())),
        }
    }
}

/// The most bytes that the answer can have, and its computation beside it. Whatever is wrong with the request is found when it is read.
fn most_bytes(arguments: &Arguments) -> usize {
    let steps = Fields::read(arguments, Service::IntegrationStep)
        .ok()
        .and_then(|mut fields| fields.count("steps", MAX_STEPS))
        .unwrap_or_default();
    let samples = usize::try_from(steps)
        .unwrap_or(usize::MAX)
        .saturating_add(1);
    let values = samples.saturating_mul(3 * NUMBER_BYTES);
    values.saturating_add(EXPRESSION_BYTES * arguments.raw().get().len())
}

/// Reads the request; all or nothing, and every field that is wrong is named.
fn read(arguments: &Arguments) -> Result<Particle, String> {
    let mut fields =
        Fields::read(arguments, Service::IntegrationStep).map_err(|why| why.to_string())?;
    let function = fields.text("function").and_then(|text| {
        Expression::parse(&text)
            .map_err(|why| fields.refuse("function:", &why))
            .ok()
    });
    let x0 = fields.number("x0", Bound::Finite);
    let xdot0 = fields.number("xdot0", Bound::Finite);
    let dt = fields.number("dt", Bound::Positive);
    let steps = fields.count("steps", MAX_STEPS);
    let method = fields.choice("integrator", &Method::ALL, Method::name);
    match (function, x0, dt, steps, method) {
        (Some(function), Some(x0), Some(dt), Some(steps), Some(method)) if fields.accepted() => {
            let xdot0 = xdot0.unwrap_or(0.0);
            Particle::new(function, x0, xdot0, dt, steps, method).map_err(|why| why.to_string())
        }
        _ => Err(fields.status()),
    }
}

/// The answer, written a slice at a time: it may be 60 MB.
struct Encoding {
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

impl Encoding {
    fn new(reply: &Reply, particle: Box<Particle>) -> Self {
        let (name, id) = reply.address();
        let mut writer = StreamedResponse::new(name, id);
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
