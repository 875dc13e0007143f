//! `/study/*`: predictions and offline runs of the arm, done on the worker pool, apart from the live arm.
//!
//! What a request leaves out is asked of the arm when the computation begins; nothing is ever told to it. A connection
//! hands over one computation at a time.
//!
//! **Invariant:** a call is answered once, and neither the arm nor another client waits for it.

mod rollout;
mod stability;

use std::time::Instant;

use actix::prelude::*;
use tokio::sync::oneshot;

use self::rollout::RolloutWork;
use self::stability::StabilityWork;
use super::arm_sim::{ArmSettings, ControlLoop, HeldLimit};
use super::budget::NoRoom;
use super::node::{Reply, ServiceCall};
use super::registry::Nodes;
use super::workers::{Computation, Progress, WorkerPool};
use crate::math::arm::{Arm, ArmError};
use crate::math::pid::Gains;
use crate::protocol::catalog::{Node, Service};
use crate::protocol::fields::{Bound, Fields};
use crate::study::stability::limit_held;

// ---- state ----------------------------------------------------------------------------------------------------------

/// The node `study` for an arm of `N` links.
pub struct Study<const N: usize> {
    arm: Recipient<ArmSettings<N>>,
    workers: WorkerPool,
}

impl<const N: usize> Study<N> {
    /// A node that asks `arm` and computes on `workers`.
    #[must_use]
    pub fn new(arm: Recipient<ArmSettings<N>>, workers: WorkerPool) -> Self {
        Self { arm, workers }
    }

    /// Enters this node's services into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        for service in Service::ALL {
            if service.owner() == Node::Study {
                nodes.services.insert(service, address.clone().recipient());
            }
        }
    }
}

// ---- life cycle -----------------------------------------------------------------------------------------------------

impl<const N: usize> Actor for Study<N> {
    type Context = Context<Self>;
}

// ---- handlers -------------------------------------------------------------------------------------------------------

impl<const N: usize> Handler<ServiceCall> for Study<N> {
    type Result = ();

    fn handle(&mut self, call: ServiceCall, ctx: &mut Context<Self>) {
        let present = self.arm.send(ArmSettings).into_actor(self);
        ctx.spawn(present.map(move |present, study, _| {
            let ServiceCall {
                service,
                arguments,
                mut reply,
            } = call;
            let Ok(present) = present else {
                return reply.refuse("arm_sim does not answer");
            };
            let work: Box<dyn Work> = if service == Service::Rollout {
                Box::new(Some(RolloutWork::new(arguments, present)))
            } else {
                Box::new(StabilityWork::new(arguments, present))
            };
            study.workers.submit(Box::new(Answering {
                reply,
                has_room: false,
                work: Some(work),
            }));
        }));
    }
}

impl<const N: usize> Handler<HeldLimit<N>> for Study<N> {
    type Result = ResponseFuture<Option<f64>>;

    fn handle(&mut self, HeldLimit(control): HeldLimit<N>, _: &mut Context<Self>) -> Self::Result {
        let (answer, answered) = oneshot::channel();
        let answer = Some(answer);
        self.workers.submit(Box::new(Limiting { control, answer }));
        Box::pin(async move { answered.await.ok() })
    }
}

// ---- helpers --------------------------------------------------------------------------------------------------------

/// What a call asks for, done piece by piece.
trait Work: Send {
    /// The most bytes that the answer can have, and its computation beside it; asked before it begins.
    fn most_bytes(&self) -> usize {
        0
    }

    /// Does a piece, a fraction of a slice; true once it has answered.
    fn advance(&mut self, reply: &mut Reply) -> bool;
}

/// A call on its way through the workers.
struct Answering {
    reply: Reply,
    /// Room for the answer has been taken.
    has_room: bool,
    /// None once it is answered.
    work: Option<Box<dyn Work>>,
}

impl Computation for Answering {
    fn advance(&mut self, deadline: Instant) -> Progress {
        while let Some(work) = &mut self.work {
            if self.reply.caller_is_gone() {
                self.refuse("the caller is gone");
            } else if !self.has_room {
                match self.reply.reserve(work.most_bytes()) {
                    Ok(()) => self.has_room = true,
                    Err(NoRoom::Yet) => return Progress::Waiting,
                    Err(NoRoom::Now) => self.refuse(&NoRoom::Now.to_string()),
                }
            } else if work.advance(&mut self.reply) {
                self.work = None;
            } else if Instant::now() >= deadline {
                return Progress::Unfinished;
            }
        }
        Progress::Finished
    }

    fn refuse(&mut self, why: &str) {
        if self.work.take().is_some() {
            self.reply.refuse(why);
        }
    }
}

/// The arm's question for its limit: one slice.
struct Limiting<const N: usize> {
    control: ControlLoop<N>,
    /// Dropped unused, it says that there is no answer.
    answer: Option<oneshot::Sender<f64>>,
}

impl<const N: usize> Computation for Limiting<N> {
    fn advance(&mut self, _: Instant) -> Progress {
        let ControlLoop {
            arm,
            gains,
            setpoint,
            method,
        } = &self.control;
        let limit = limit_held(arm, gains, setpoint, *method).unwrap_or(f64::INFINITY);
        if let Some(answer) = self.answer.take() {
            // The arm may have ended meanwhile.
            let _ = answer.send(limit);
        }
        Progress::Finished
    }

    fn refuse(&mut self, _: &str) {
        self.answer = None;
    }
}

/// The arm that a request's `params` describe; members that it leaves out are those of the present one.
fn read_arm<const N: usize>(fields: &mut Fields<'_>, present: &Arm<N>) -> Option<Arm<N>> {
    let given = fields.object("params", |params| {
        let gravity = params.number("gravity", Bound::NonNegative);
        let masses = array(params.numbers("masses", N, Bound::Positive));
        let lengths = array(params.numbers("lengths", N, Bound::Positive));
        let arm: Result<Arm<N>, ArmError> = Arm::new(
            lengths.unwrap_or(*present.lengths()),
            masses.unwrap_or(*present.masses()),
            gravity.unwrap_or(present.gravity()),
        );
        arm
    });
    match given {
        None => Some(*present),
        Some(Ok(arm)) => Some(arm),
        // The members were checked with the same bounds; should the two ever differ, the arm's word counts.
        Some(Err(why)) => {
            fields.refuse("params", &why);
            None
        }
    }
}

/// The gains that a request's `gains` give, if there are any; members that it leaves out are those of `present`.
fn read_gains<const N: usize>(fields: &mut Fields<'_>, present: &Gains<N>) -> Option<Gains<N>> {
    fields.object("gains", |given| {
        let mut gains = *present;
        for (name, values) in [
            ("kp", &mut gains.kp),
            ("ki", &mut gains.ki),
            ("kd", &mut gains.kd),
        ] {
            if let Some(given) = array(given.numbers(name, N, Bound::NonNegative)) {
                *values = given;
            }
        }
        gains
    })
}

/// An array of one finite number per joint, if it is there and good.
fn read_joints<const N: usize>(fields: &mut Fields<'_>, name: &'static str) -> Option<[f64; N]> {
    array(fields.numbers(name, N, Bound::Finite))
}

/// The values as an array; the reader has checked how many they are.
fn array<const N: usize>(values: Option<Vec<f64>>) -> Option<[f64; N]> {
    values?.try_into().ok()
}
