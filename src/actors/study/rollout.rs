//! `/study/rollout`: an offline run of the arm, sample by sample, with its cost and its error.
//!
//! The run is made once by itself, against a worker's clock. If a reference is asked for, it is made again beside the
//! reference, which costs far more than the run: so `wall_time` is that of the run alone, whatever else was asked.
//!
//! **Invariant:** the samples are the live arm's own steps, and a run in slices gives the same bits as one at once.

use std::time::{Duration, Instant};

use bytes::Bytes;

use super::{Work, read_arm, read_gains, read_joints};
use crate::actors::arm_sim::Present;
use crate::actors::integration::NUMBER_BYTES;
use crate::actors::node::Reply;
use crate::math::arm::State;
use crate::math::integrator::Method;
use crate::math::pid::Setpoint;
use crate::protocol::catalog::Service;
use crate::protocol::fields::{Bound, Fields};
use crate::protocol::op::Arguments;
use crate::protocol::streamed::StreamedResponse;
use crate::study::linear::no_control;
use crate::study::rollout::{Deviation, MAX_SAMPLES, Plan, Rollout};

/// How long a run is unless it is said \[s\].
const DEFAULT_DURATION: f64 = 10.0;
/// Samples of a run unless it is said, if there are as many steps: enough for a smooth curve.
const DEFAULT_SAMPLES: u64 = 1001;
/// Evaluations of the dynamics between two looks at the clock: some hundred microseconds.
const EVALUATIONS_PER_LOOK: u64 = 2000;
/// Samples encoded between two looks at the clock: some tens of microseconds.
const SAMPLES_PER_LOOK: usize = 256;

/// A call of the service.
pub(super) enum RolloutWork<const N: usize> {
    Unread(Arguments, Box<Present<N>>),
    Running(Box<Timed<N>>),
    Comparing(Box<Rollout<N>>, Duration),
    Encoding(Box<Encoding<N>>),
}

/// A run by itself, with the time that it took so far.
pub(super) struct Timed<const N: usize> {
    run: Rollout<N>,
    took: Duration,
    /// The plan to run again beside a reference, if that is wanted.
    again: Option<Plan<N>>,
}

impl<const N: usize> RolloutWork<N> {
    pub(super) fn new(arguments: Arguments, present: Present<N>) -> Self {
        Self::Unread(arguments, Box::new(present))
    }

    /// What follows; none once the call is answered.
    fn next(self, reply: &mut Reply) -> Option<Self> {
        Some(match self {
            Self::Unread(arguments, present) => match begin(&arguments, &present) {
                Ok(timed) => Self::Running(Box::new(timed)),
                Err(why) => {
                    reply.refuse(&why);
                    return None;
                }
            },
            Self::Running(mut timed) => {
                let began = Instant::now();
                let steps = timed.run.advance(EVALUATIONS_PER_LOOK);
                timed.took += began.elapsed();
                let Timed { run, took, again } = *timed;
                if steps > 0 {
                    Self::Running(Box::new(Timed { run, took, again }))
                } else if let Some(Ok(beside)) = again.map(Rollout::new) {
                    Self::Comparing(Box::new(beside), took)
                } else {
                    Self::Encoding(Box::new(Encoding::new(reply, run, took)))
                }
            }
            Self::Comparing(mut run, took) => {
                if run.advance(EVALUATIONS_PER_LOOK) > 0 {
                    Self::Comparing(run, took)
                } else {
                    Self::Encoding(Box::new(Encoding::new(reply, *run, took)))
                }
            }
            Self::Encoding(mut encoding) => match encoding.advance() {
                None => Self::Encoding(encoding),
                Some(frame) => {
                    reply.answer_with(frame);
                    return None;
                }
            },
        })
    }
}

/// None once it is answered.
impl<const N: usize> Work for Option<RolloutWork<N>> {
    fn most_bytes(&self) -> usize {
        let Some(RolloutWork::Unread(arguments, _)) = self else {
            return 0;
        };
        // Whatever is wrong with the request is found when it is read.
        let samples = Fields::read(arguments, Service::Rollout)
            .ok()
            .and_then(|mut fields| fields.count("samples", MAX_SAMPLES))
            .unwrap_or(DEFAULT_SAMPLES);
        let numbers = 3 * N + COLUMNS.len();
        usize::try_from(samples)
            .unwrap_or(usize::MAX)
            .saturating_mul(numbers * NUMBER_BYTES)
    }

    fn advance(&mut self, reply: &mut Reply) -> bool {
        *self = self.take().and_then(|work| work.next(reply));
        self.is_none()
    }
}

/// Reads the request and makes the run, which checks what concerns several fields.
fn begin<const N: usize>(arguments: &Arguments, present: &Present<N>) -> Result<Timed<N>, String> {
    let plan = read(arguments, present)?;
    let alone = Plan {
        reference: false,
        ..plan
    };
    let run = Rollout::new(alone).map_err(|why| why.to_string())?;
    Ok(Timed {
        run,
        took: Duration::ZERO,
        again: plan.reference.then_some(plan),
    })
}

/// Reads the request; all or nothing, and every field that is wrong is named.
fn read<const N: usize>(arguments: &Arguments, present: &Present<N>) -> Result<Plan<N>, String> {
    let mut fields = Fields::read(arguments, Service::Rollout).map_err(|why| why.to_string())?;
    let q0 = read_joints(&mut fields, "q0");
    let qdot0 = read_joints(&mut fields, "qdot0");
    let duration = fields.number("duration", Bound::Positive);
    let timestep = fields.number("timestep", Bound::Positive);
    let method = fields.choice("integrator", &Method::ALL, Method::name);
    let arm = read_arm(&mut fields, &present.control.arm);
    // A part of the law that is left out is switched off, as the whole law is where all are.
    let gains = read_gains(&mut fields, &no_control());
    let setpoint = read_joints(&mut fields, "setpoint").map(|position| Setpoint {
        position,
        velocity: [0.0; N],
    });
    let samples = fields.count("samples", MAX_SAMPLES);
    let reference = fields.boolean("reference");
    match arm {
        Some(arm) if fields.accepted() => Ok(Plan {
            arm,
            start: State {
                position: q0.unwrap_or([0.0; N]),
                velocity: qdot0.unwrap_or([0.0; N]),
            },
            duration: duration.unwrap_or(DEFAULT_DURATION),
            timestep: timestep.unwrap_or(present.timestep),
            method: method.unwrap_or(present.control.method),
            gains,
            setpoint: setpoint.unwrap_or(present.control.setpoint),
            samples: samples.unwrap_or(DEFAULT_SAMPLES),
            reference: reference.unwrap_or(false),
        }),
        _ => Err(fields.status()),
    }
}

/// The answer, written a slice at a time: it may be 30 MB.
pub(super) struct Encoding<const N: usize> {
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

impl<const N: usize> Encoding<N> {
    fn new(reply: &Reply, run: Rollout<N>, took: Duration) -> Self {
        let (name, id) = reply.address();
        Self {
            run,
            took,
            writer: StreamedResponse::new(name, id),
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
        let error = self
            .run
            .deviation()
            .filter(|deviation| deviation.errors.len() == self.run.times().len())
            .map_or(f64::NAN, Deviation::largest);
        let writer = &mut self.writer;
        writer.raw(&format!(
            "],\"evaluations\":{},\"wall_time\":",
            self.run.evaluations()
        ));
        writer.number(self.took.as_secs_f64());
        writer.raw(",\"error\":");
        writer.number(error);
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
