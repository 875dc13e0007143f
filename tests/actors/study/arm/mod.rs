//! The arm's requests to the study, in virtual time, with a substitute for the study.

mod limits;

use std::ops::Deref;

use super::*;
use crate::arm_steps::{enable, pause};
use crate::stage::{Stage, asked};
use crate::virtual_time::Client;
use pendularm::actors::arm::sim::ArmSim;
use pendularm::actors::node::{Ask, Call};

/// The requests to a substitute for the study, and the limit that it answers.
#[derive(Clone, Default)]
struct Oracle {
    asked: Rc<RefCell<Vec<ControlLoop<2>>>>,
    limit: Rc<Cell<f64>>,
}

/// An arm with a substitute for the study, and a client that receives the arm's messages.
struct Consulting {
    stage: Stage<2>,
    client: Client,
    oracle: Oracle,
}

impl Deref for Consulting {
    type Target = Stage<2>;

    fn deref(&self) -> &Stage<2> {
        &self.stage
    }
}

impl Consulting {
    async fn new(limit: f64) -> Self {
        let oracle = Oracle::default();
        oracle.limit.set(limit);
        let stage = Stage::start().await;
        let Oracle { asked, limit } = oracle.clone();
        let study = stand_in(move |HeldLimit(control): HeldLimit<2>| {
            asked.borrow_mut().push(control);
            Some(ClockLimits {
                period: Some(f64::INFINITY),
                timestep: Some(limit.get()),
            })
        });
        let study = Some(study);
        let goal_reporters = Vec::new();
        let nodes = AttachNodes {
            study,
            goal_reporters,
        };
        stage.arm.send(nodes).await.unwrap();
        Self {
            client: stage.connect(),
            stage,
            oracle,
        }
    }

    async fn ask<A: Ask>(&self, ask: A) -> A::Answer
    where
        ArmSim<2>: Handler<Call<A>>,
    {
        asked(&self.stage.arm, ask).await
    }

    /// Requests to the study since the last query, after enough time for a request.
    async fn questions(&self) -> Vec<ControlLoop<2>> {
        sleep(Duration::from_millis(150)).await;
        std::mem::take(&mut self.oracle.asked.borrow_mut())
    }

    /// Messages on a topic since the last query of any topic.
    async fn told(&mut self, topic: &str) -> Vec<Value> {
        self.client.settle().await;
        let told = self.client.messages(topic);
        self.client.received.clear();
        told
    }
}

fn integrator(timestep: Option<f64>, method: Option<Method>) -> SetIntegrator {
    SetIntegrator {
        timestep,
        method,
        ..SetIntegrator::default()
    }
}

fn value<'a>(message: &'a Value, key: &str) -> &'a str {
    let values = message["status"][0]["values"].as_array().unwrap();
    let entry = values.iter().find(|entry| entry["key"] == key).unwrap();
    entry["value"].as_str().unwrap()
}
