//! The questions to `study` in JSON, and the responses; a rollout's is written a slice at a time.
//!
//! **Invariant:** one bad field refuses the whole question, and each that is bad is named.

use std::time::Duration;

use actix::prelude::*;
use bytes::Bytes;
use serde::Serialize;

use super::{
    NotPlanned, NotRun, NotSuggested, PlanRun, PlannedRun, PredictStability, Predicted, Ran,
    RunOffline, Study, SuggestGains, Suggested,
};
use crate::actors::arm::sim::{FieldByField as _, SetGains, SetParams};
use crate::actors::wire::{Address, Answered, Callable, Nodes, Streamed};
use crate::math::arm::ArmError;
use crate::math::integrator::Method;
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::protocol::wire::streamed::StreamedResponse;
use crate::study::motion::Motion;
use crate::study::rollout::{Deviation, MAX_SAMPLES, Rollout};
use crate::study::stability::{ADVISED_PART, Limits};

/// Samples encoded between two looks at the clock: some tens of microseconds.
const SAMPLES_PER_LOOK: usize = 256;

impl<const N: usize> Study<N> {
    /// Enters this node's services into the registry's table.
    pub fn attach(address: &Addr<Self>, nodes: &mut Nodes) {
        nodes.serve::<PredictStability<N>>(Service::Stability, address.clone());
        nodes.serve_long::<RunOffline<N>>(Service::Rollout, address.clone());
        nodes.serve::<SuggestGains<N>>(Service::SuggestGains, address.clone());
        nodes.serve::<PlanRun<N>>(Service::Plan, address.clone());
    }
}

// ---- stability ------------------------------------------------------------------------------------------------------

impl<const N: usize> Callable for PredictStability<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let ask = Self {
            method: fields.choice("integrator", &Method::ALL, Method::name),
            gains: fields.object("gains", SetGains::of),
            params: fields.object("params", SetParams::of),
            setpoint: fields.array("setpoint", Bound::Finite),
        };
        taken(ask, fields)
    }
}

impl<const N: usize> Answered for PredictStability<N> {
    fn write(answer: Result<Box<Predicted<N>>, ArmError>, to: &Address) -> Bytes {
        match answer {
            Ok(predicted) => {
                let Predicted { limits, motion } = *predicted;
                to.response(&StabilityValues::new(limits, motion), "")
            }
            Err(why) => to.failure(&format!("params {why}")),
        }
    }
}

#[derive(Serialize)]
struct StabilityValues {
    timestep_limit_held: Option<f64>,
    timestep_limit_continuous: Option<f64>,
    equilibrium: Vec<f64>,
    equilibrium_kind: &'static str,
    minimum_over_poses_held: Option<f64>,
    minimum_over_poses_continuous: Option<f64>,
    minimum_over_poses_bound: Option<f64>,
    certified: bool,
    worst_pose: Option<Vec<f64>>,
    critical: Option<CriticalValues>,
    timestep_limit_motion: Option<f64>,
    motion_speed: f64,
    advised_timestep: Option<f64>,
}

#[derive(Serialize)]
struct CriticalValues {
    growth_per_step: f64,
    frequency: f64,
    joint: usize,
}

impl StabilityValues {
    fn new<const N: usize>(limits: Limits<N>, motion: Motion) -> Self {
        let bears = Some(motion.timestep).filter(|timestep| timestep.is_finite());
        let advised = [
            limits.advised,
            bears.map(|timestep| ADVISED_PART * timestep),
        ];
        Self {
            timestep_limit_held: limits.held,
            timestep_limit_continuous: limits.continuous,
            equilibrium: limits.equilibrium.to_vec(),
            equilibrium_kind: limits.rest.name(),
            minimum_over_poses_held: limits.minimum_held,
            minimum_over_poses_continuous: limits.minimum_continuous,
            minimum_over_poses_bound: limits.bound,
            certified: limits.certified,
            worst_pose: limits.worst_pose.map(|pose| pose.to_vec()),
            critical: limits.critical.map(|critical| CriticalValues {
                growth_per_step: critical.growth_per_step,
                frequency: critical.frequency,
                joint: critical.joint,
            }),
            timestep_limit_motion: bears,
            motion_speed: motion.speed,
            advised_timestep: advised.into_iter().flatten().reduce(f64::min),
        }
    }
}

// ---- advice ---------------------------------------------------------------------------------------------------------

impl<const N: usize> Callable for SuggestGains<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let ask = Self {
            settling_time: fields.number("settling_time", Bound::Positive),
            margin: fields.number("margin", Bound::Positive),
            timestep: fields.number("timestep", Bound::Positive),
            method: fields.choice("integrator", &Method::ALL, Method::name),
            params: fields.object("params", SetParams::of),
        };
        if ask.margin.is_some_and(|margin| margin < 1.0) {
            fields.refuse("margin", &"must be at least 1");
        }
        taken(ask, fields)
    }
}

impl<const N: usize> Answered for SuggestGains<N> {
    fn write(answer: Result<Suggested<N>, NotSuggested>, to: &Address) -> Bytes {
        #[derive(Serialize)]
        struct Values {
            kp: Vec<f64>,
            ki: Vec<f64>,
            kd: Vec<f64>,
            timestep_limit: Option<f64>,
            certified: bool,
            margin: Option<f64>,
            settled_after: f64,
        }
        to.outcome(answer.map(|Suggested { found, timestep }| Values {
            kp: found.gains.kp.to_vec(),
            ki: found.gains.ki.to_vec(),
            kd: found.gains.kd.to_vec(),
            timestep_limit: found.limit,
            certified: found.certified,
            margin: found.limit.map(|limit| limit / timestep),
            settled_after: found.settled_after,
        }))
    }
}

impl<const N: usize> Callable for PlanRun<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let ask = Self {
            // The catalog requires it: where it is not there, the question is rejected.
            error: fields.number("error", Bound::Positive).unwrap_or(f64::NAN),
            duration: fields.number("duration", Bound::Positive),
            servo: fields.boolean("servo").unwrap_or(false),
            q0: fields.array("q0", Bound::Finite),
            qdot0: fields.array("qdot0", Bound::Finite),
            params: fields.object("params", SetParams::of),
            gains: fields.object("gains", SetGains::of),
            setpoint: fields.array("setpoint", Bound::Finite),
        };
        taken(ask, fields)
    }
}

impl<const N: usize> Answered for PlanRun<N> {
    fn write(answer: Result<PlannedRun, NotPlanned>, to: &Address) -> Bytes {
        to.outcome(answer.map(PlanValues::from))
    }
}

#[derive(Serialize)]
struct PlanValues {
    integrator: &'static str,
    timestep: f64,
    control_period: Option<f64>,
    evaluations_per_second: f64,
    error: f64,
    error_uncertainty: f64,
    methods: Vec<&'static str>,
    timesteps: Vec<f64>,
    evaluations: Vec<u64>,
    errors: Vec<f64>,
}

impl From<PlannedRun> for PlanValues {
    fn from(run: PlannedRun) -> Self {
        let PlannedRun {
            best,
            planned,
            controlled,
        } = run;
        let all = || planned.candidates.iter().rev();
        Self {
            integrator: best.method.name(),
            timestep: best.timestep,
            control_period: controlled.then_some(best.timestep),
            evaluations_per_second: f64::from(best.method.evaluations()) / best.timestep,
            error: best.error,
            error_uncertainty: planned.uncertainty,
            methods: all().map(|one| one.method.name()).collect(),
            timesteps: all().map(|one| one.timestep).collect(),
            evaluations: all().map(|one| one.evaluations).collect(),
            errors: all().map(|one| one.error).collect(),
        }
    }
}

// ---- rollout --------------------------------------------------------------------------------------------------------

impl<const N: usize> Callable for RunOffline<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let ask = Self {
            q0: fields.array("q0", Bound::Finite),
            qdot0: fields.array("qdot0", Bound::Finite),
            duration: fields.number("duration", Bound::Positive),
            timestep: fields.number("timestep", Bound::Positive),
            method: fields.choice("integrator", &Method::ALL, Method::name),
            params: fields.object("params", SetParams::of),
            gains: fields.object("gains", SetGains::of),
            setpoint: fields.array("setpoint", Bound::Finite),
            samples: fields.count("samples", MAX_SAMPLES),
            reference: fields.boolean("reference"),
        };
        taken(ask, fields)
    }
}

impl<const N: usize> Streamed for RunOffline<N> {
    type Writer = Result<RolloutWriter<N>, Bytes>;

    fn begin(answer: Result<Box<Ran<N>>, NotRun>, to: &Address) -> Self::Writer {
        match answer {
            Ok(ran) => Ok(RolloutWriter::new(*ran, to)),
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

/// All or nothing.
fn taken<A>(ask: A, fields: Fields<'_>) -> Result<A, Rejections> {
    if fields.accepted() {
        Ok(ask)
    } else {
        Err(fields.finish())
    }
}

/// The answer, written a slice at a time: it may be 30 MB.
pub struct RolloutWriter<const N: usize> {
    run: Rollout<N>,
    took: Duration,
    writer: StreamedResponse,
    /// Which of the arrays is being written.
    column: usize,
    /// Its next entry.
    entry: usize,
}

/// The arrays, in the order in which they are written.
const COLUMNS: [&str; 5] = [
    "{\"times\":[",
    "],\"positions\":[",
    "],\"velocities\":[",
    "],\"efforts\":[",
    "],\"energy\":[",
];

impl<const N: usize> RolloutWriter<N> {
    fn new(Ran { run, took }: Ran<N>, to: &Address) -> Self {
        Self {
            run,
            took,
            writer: StreamedResponse::new(to.name(), to.id()),
            column: 0,
            entry: 0,
        }
    }

    /// Writes some more; the frame, once it is whole.
    fn advance(&mut self) -> Option<Bytes> {
        let Some(head) = COLUMNS.get(self.column) else {
            return Some(self.finish());
        };
        if self.entry == 0 {
            self.writer.raw(head);
        }
        let samples = self.run.times().len();
        let end = samples.min(self.entry + SAMPLES_PER_LOOK);
        for entry in self.entry..end {
            if entry > 0 {
                self.writer.raw(",");
            }
            let run = &self.run;
            match self.column {
                0 => number(&mut self.writer, run.times().get(entry)),
                1 => row(&mut self.writer, run.positions().get(entry)),
                2 => row(&mut self.writer, run.velocities().get(entry)),
                3 => row(&mut self.writer, run.efforts().get(entry)),
                _ => number(&mut self.writer, run.energy().get(entry)),
            }
        }
        self.entry = end;
        if end == samples {
            self.column += 1;
            self.entry = 0;
        }
        None
    }

    fn finish(&mut self) -> Bytes {
        // An error that is known for a part of the samples only is none that could be compared with another method's.
        let followed = self
            .run
            .deviation()
            .filter(|deviation| deviation.errors.len() == self.run.times().len());
        let error = followed.and_then(Deviation::known).unwrap_or(f64::NAN);
        let uncertainty = followed.map_or(f64::NAN, Deviation::largest_uncertainty);
        let writer = &mut self.writer;
        writer.raw(&format!(
            "],\"evaluations\":{},\"wall_time\":",
            self.run.evaluations()
        ));
        writer.number(self.took.as_secs_f64());
        writer.raw(",\"error\":");
        writer.number(error);
        writer.raw(",\"error_uncertainty\":");
        writer.number(uncertainty);
        writer.raw("}");
        std::mem::take(writer).finish(true, "")
    }
}

fn number(writer: &mut StreamedResponse, value: Option<&f64>) {
    writer.number(value.copied().unwrap_or(f64::NAN));
}

fn row<const N: usize>(writer: &mut StreamedResponse, values: Option<&[f64; N]>) {
    for (joint, value) in values.into_iter().flatten().enumerate() {
        writer.raw(if joint == 0 { "[" } else { "," });
        writer.number(*value);
    }
    writer.raw("]");
}
