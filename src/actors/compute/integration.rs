//! `/arm_sim/integration_step`: passes the calls to the worker pool.
//!
//! The request is parsed, computed and written by a worker. A connection hands over one computation at a time.
//!
//! **Invariant:** nothing here uses the arm. No request blocks the arm or other clients.

use actix::prelude::*;

use super::answering::answer;
use super::workers::WorkerPool;
use crate::actors::node::Call;
use crate::actors::wire::Nodes;
use crate::protocol::catalog::Service;
use crate::services::study::Integrating;
pub use crate::services::study::IntegrationStep;

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
