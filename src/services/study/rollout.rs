//! `/study/rollout`: an offline run of the arm, sample by sample, with its cost and its error.
//!
//! The run is first made alone and timed with a worker's clock, so `took` is the time of the run alone. If a
//! reference is requested, the run is repeated beside the reference, which costs far more.
//!
//! **Invariant:** the samples are the live arm's own steps. A run in slices gives the same bits as one without.

use std::time::Duration;

use bytes::Bytes;

use super::reading::{taken, with_period};
use super::{Computed, NUMBER_BYTES, Present, Work};
use crate::math::arm::{ArmError, State};
use crate::math::integrator::Method;
use crate::math::pid::Setpoint;
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::protocol::wire::streamed::StreamedResponse;
use crate::services::arm::{SetGains, SetParams};
use crate::services::field_by_field::FieldByField as _;
use crate::services::{Address, Ask, Callable, ResponseWriter, Streamed};
use crate::study::control_loop::ControlLoop;
use crate::study::linear::no_control;
use crate::study::paused::Paused;
use crate::study::rollout::{
    MAX_SAMPLES, Rollout, RolloutError, RolloutRequest, most_bytes, rollout,
};

// ---- question -------------------------------------------------------------------------------------------------------

/// Runs the arm offline.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RunOffline<const N: usize> {
    /// Initial positions \[rad\]; 0 by default.
    pub q0: Option<[f64; N]>,
    /// Initial velocities \[rad/s\]; 0 by default.
    pub qdot0: Option<[f64; N]>,
    /// Duration \[s\], greater than 0.
    pub duration: Option<f64>,
    /// Length of a step \[s\], greater than 0.
    pub timestep: Option<f64>,
    /// The time between two runs of the control law \[s\], not negative; 0 for every step.
    pub control_period: Option<f64>,
    /// The method that takes the steps.
    pub method: Option<Method>,
    /// Changed parameters of the arm.
    pub params: Option<SetParams<N>>,
    /// The gains. Without them the arm is free. A missing member counts as 0.
    pub gains: Option<SetGains<N>>,
    /// The setpoint \[rad\], at rest.
    pub setpoint: Option<[f64; N]>,
    /// The number of samples.
    pub samples: Option<u64>,
    /// Whether to run a reference too.
    pub reference: Option<bool>,
}

impl<const N: usize> Ask for RunOffline<N> {
    type Answer = Result<Box<Ran<N>>, NotRun>;
}

/// A finished run.
pub struct Ran<const N: usize> {
    /// The run.
    pub run: Rollout<N>,
    /// The worker's time for the run alone.
    pub took: Duration,
}

/// Why there was no run.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NotRun {
    /// The arm is not valid.
    #[error("params {0}")]
    Params(#[from] ArmError),
    /// The run is not valid.
    #[error(transparent)]
    Rollout(#[from] RolloutError),
}

// ---- reading and writing --------------------------------------------------------------------------------------------

/// Samples encoded between two checks of the clock: some tens of microseconds.
const SAMPLES_PER_LOOK: usize = 256;

impl<const N: usize> Callable for RunOffline<N> {
    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let mut fields = Fields::read(arguments, service)?;
        let ask = Self {
            q0: fields.array("q0", Bound::Finite),
            qdot0: fields.array("qdot0", Bound::Finite),
            duration: fields.number("duration", Bound::Positive),
            timestep: fields.number("timestep", Bound::Positive),
            control_period: fields.number("control_period", Bound::NonNegative),
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
    fn begin(answer: Result<Box<Ran<N>>, NotRun>, to: &Address) -> Box<dyn ResponseWriter> {
        match answer {
            Ok(ran) => Box::new(RolloutWriter::new(*ran, to)),
            Err(why) => Box::new(Some(to.failure(&why.to_string()))),
        }
    }
}

/// The answer, written a slice at a time: it may be 30 MB.
struct RolloutWriter<const N: usize> {
    run: Rollout<N>,
    took: Duration,
    writer: StreamedResponse,
    /// Index of the array that is being written.
    column: usize,
    /// Index of its next entry.
    entry: usize,
}

/// The arrays, in the order in which they are written.
const ARRAYS: [&str; 5] = [
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

    fn finish(&mut self) -> Bytes {
        let method = self.run.known(self.run.deviation.as_ref());
        let sampling = self.run.known(self.run.from_ideal.as_ref());
        let writer = &mut self.writer;
        writer.raw(&format!(
            "],\"evaluations\":{},\"wall_time\":",
            self.run.evaluations
        ));
        writer.number(self.took.as_secs_f64());
        for (name, value) in [
            ("error", method.0),
            ("error_uncertainty", method.1),
            ("sampling_error", sampling.0),
            ("sampling_error_uncertainty", sampling.1),
        ] {
            writer.raw(&format!(",\"{name}\":"));
            writer.number(value.unwrap_or(f64::NAN));
        }
        writer.raw("}");
        std::mem::take(writer).finish(true, "")
    }
}

impl<const N: usize> ResponseWriter for RolloutWriter<N> {
    fn advance(&mut self) -> Option<Bytes> {
        let Some(head) = ARRAYS.get(self.column) else {
            return Some(self.finish());
        };
        if self.entry == 0 {
            self.writer.raw(head);
        }
        let samples = self.run.times.len();
        let end = samples.min(self.entry + SAMPLES_PER_LOOK);
        for entry in self.entry..end {
            if entry > 0 {
                self.writer.raw(",");
            }
            let run = &self.run;
            match self.column {
                0 => number(&mut self.writer, run.times.get(entry)),
                1 => row(&mut self.writer, run.positions.get(entry)),
                2 => row(&mut self.writer, run.velocities.get(entry)),
                3 => row(&mut self.writer, run.efforts.get(entry)),
                _ => number(&mut self.writer, run.energy.get(entry)),
            }
        }
        self.entry = end;
        if end == samples {
            self.column += 1;
            self.entry = 0;
        }
        None
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
// ---- work -----------------------------------------------------------------------------------------------------------

/// Default duration of a run \[s\].
const DEFAULT_DURATION: f64 = 10.0;
/// Default number of samples, if there are as many steps: enough for a smooth curve.
const DEFAULT_SAMPLES: u64 = 1001;
/// Numbers in a sample of the answer besides those of the joints, and the same for brackets and commas.
const COLUMNS: usize = 5;

/// A run in progress.
pub struct RolloutWork<const N: usize> {
    most_bytes: usize,
    /// The run alone; `None` once it is finished.
    alone: Option<Paused<Result<Rollout<N>, NotRun>>>,
    /// Its time so far.
    took: Duration,
    /// The same run beside a reference, if one is requested.
    compared: Option<Paused<Result<Rollout<N>, NotRun>>>,
}

impl<const N: usize> RolloutWork<N> {
    /// The computation for `ask` and the `present` arm.
    #[must_use]
    pub fn new(ask: &RunOffline<N>, present: Present<N>) -> Self {
        let samples = usize::try_from(ask.samples.unwrap_or(DEFAULT_SAMPLES));
        let is_compared = ask.reference.unwrap_or(false);
        let run = |reference: bool| {
            let ask = ask.clone();
            Paused::new(async move {
                let request = request(&ask, &present, reference)?;
                Ok(rollout(request).await?)
            })
        };
        Self {
            most_bytes: samples
                .unwrap_or(usize::MAX)
                .saturating_mul((3 * N + COLUMNS) * NUMBER_BYTES)
                .saturating_add(most_bytes::<N>()),
            alone: Some(run(false)),
            took: Duration::ZERO,
            compared: is_compared.then(|| run(true)),
        }
    }
}

impl<const N: usize> Computed<N> for RunOffline<N> {
    type Work = RolloutWork<N>;

    fn work(self, present: Present<N>) -> Self::Work {
        RolloutWork::new(&self, present)
    }
}

impl<const N: usize> Work<Result<Box<Ran<N>>, NotRun>> for RolloutWork<N> {
    fn most_bytes(&self) -> usize {
        self.most_bytes
    }

    fn advance(&mut self, clock: fn() -> Duration) -> Option<Result<Box<Ran<N>>, NotRun>> {
        let run = if let Some(alone) = &mut self.alone {
            let began = clock();
            let run = alone.advance();
            self.took += clock().saturating_sub(began);
            let run = run?;
            self.alone = None;
            if run.is_ok() && self.compared.is_some() {
                return None;
            }
            run
        } else {
            self.compared.as_mut()?.advance()?
        };
        let took = self.took;
        Some(run.map(|run| Box::new(Ran { run, took })))
    }
}

/// The request for the run, with the present settings for missing fields.
fn request<const N: usize>(
    ask: &RunOffline<N>,
    present: &Present<N>,
    reference: bool,
) -> Result<RolloutRequest<N>, ArmError> {
    let control = &present.control;
    let arm = match &ask.params {
        None => control.arm,
        Some(params) => params.applied_to(&control.arm)?,
    };
    let gains = ask.gains.as_ref();
    let setpoint = ask.setpoint.map(Setpoint::at);
    Ok(RolloutRequest {
        control: ControlLoop {
            arm,
            // A missing member of the gains counts as 0. Without gains there is no control.
            gains: gains.map_or(no_control(), |gains| gains.applied_to(&no_control())),
            setpoint: setpoint.unwrap_or(control.setpoint),
            method: ask.method.unwrap_or(control.method),
            timestep: ask.timestep.unwrap_or(control.timestep),
            period: with_period(control.period, ask.control_period),
        },
        start: State {
            position: ask.q0.unwrap_or([0.0; N]),
            velocity: ask.qdot0.unwrap_or([0.0; N]),
        },
        duration: ask.duration.unwrap_or(DEFAULT_DURATION),
        samples: ask.samples.unwrap_or(DEFAULT_SAMPLES),
        reference,
    })
}
