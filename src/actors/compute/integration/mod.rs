//! `/arm_sim/integration_step`: integrates `x'' = f(t)` on the worker pool, independent of the live arm.
//!
//! The request is parsed, computed and written by a worker. A connection hands over one computation at a time.
//!
//! **Invariant:** nothing here uses the arm. No request blocks the arm or other clients.

mod services;

use std::time::Duration;

use actix::prelude::*;

pub use self::services::{IntegrationStep, NotIntegrated};
use super::answering::answer;
use super::workers::WorkerPool;
use crate::actors::node::Call;
use crate::actors::wire::Nodes;
use crate::math::expression::Expression;
use crate::math::particle::Particle;
use crate::protocol::catalog::Service;
use crate::protocol::op::fields::{RejectedField, Rejections};
use crate::services::study::{NUMBER_BYTES, Work};

/// Expression nodes evaluated between two checks of the clock: some hundred microseconds.
const NODES_PER_LOOK: u64 = 50_000;
/// Largest memory of a parsed expression per byte of its text.
const EXPRESSION_BYTES: usize = 32;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The actor that passes the calls to the workers.
pub struct Integration {
    workers: WorkerPool,
}

impl Integration {
    /// An actor that computes on `workers`.
    #[must_use]
    pub fn new(workers: WorkerPool) -> Self {
        Self { workers }
    }

    /// Adds this node's service to the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<IntegrationStep>(Service::IntegrationStep, address.clone());
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl Actor for Integration {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl Handler<Call<IntegrationStep>> for Integration {
    type Result = ();

    fn handle(&mut self, call: Call<IntegrationStep>, _: &mut Context<Self>) {
        answer(&self.workers, call.reply, Integrating::Asked(call.ask));
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

/// A particle in progress.
enum Integrating {
    Asked(IntegrationStep),
    Stepping(Box<Particle>),
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
