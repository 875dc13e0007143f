//! `/study/rollout`: an offline run of the arm, sample by sample, with its cost and its error.
//!
//! The run is first made with two samples and timed with a worker's clock, so `took` is the time of the steps. Then it is
//! repeated with all samples, and beside a reference if one is requested, which costs far more.
//!
//! **Invariant:** the samples are the live arm's own steps. A run in slices gives the same bits as one without.

use std::time::Duration;

use bytes::Bytes;
use serde::{Serialize, Serializer};

use super::{Beside, Changed, Computed, NUMBER_BYTES, Present, Refused, Work};
use crate::math::arm::ArmError;
use crate::math::pid::Gains;
use crate::protocol::op::fields::{Bound, Fields, Rejections};
use crate::services::Address;
use crate::study::control_loop::no_control;
use crate::study::paused::Paused;
use crate::study::rollout::{
    Course, MAX_SAMPLES, Rollout, RolloutError, RolloutRequest, most_bytes, rollout, rollout_along,
};

// ---- question -------------------------------------------------------------------------------------------------------

request! {
    whole
    /// Runs the arm offline.
    #[derive(Debug, Clone, PartialEq, Default)]
    pub struct RunOffline<N> -> RunAnswer<N>, |fields| {
        /// Changes of the present loop and state. Without gains the arm is free. A missing member of gains is that of a
        /// new arm.
        changed: Changed<N> = Changed::read(&mut fields),
        /// Duration \[s\], greater than 0.
        duration: Option<f64> = fields.number("duration", Bound::Positive),
        /// The number of samples.
        samples: Option<u64> = fields.count("samples", 2..=MAX_SAMPLES),
        /// Whether to run a reference too.
        reference: Option<bool> = fields.boolean("reference"),
    }

    fn write(answer: RunAnswer<N>, to: &Address) -> Bytes {
        let Ran { run, took } = match answer {
            Ok(ran) => *ran,
            Err(why) => return to.failure(&why.to_string()),
        };
        let method = run.known(run.deviation.as_ref());
        let sampling = run.known(run.from_ideal.as_ref());
        let values = object! {
            times: &run.times,
            positions: Rows(&run.positions),
            velocities: Rows(&run.velocities),
            efforts: Rows(&run.efforts),
            energy: &run.energy,
            evaluations: run.evaluations,
            wall_time: took.as_secs_f64(),
            error: method.0,
            error_uncertainty: method.1,
            sampling_error: sampling.0,
            sampling_error_uncertainty: sampling.1,
            divergence: run.divergence.map(|lost| object! { step: lost.step, time: lost.time }),
        };
        to.response(&values, "")
    }
}

/// A run, or the reason why there is none.
pub type RunAnswer<const N: usize> = Result<Box<Ran<N>>, Refused<RolloutError>>;

/// A finished run.
pub struct Ran<const N: usize> {
    /// The run.
    pub run: Rollout<N>,
    /// The worker's time for the steps, without samples and references.
    pub took: Duration,
}

// ---- reading and writing --------------------------------------------------------------------------------------------

/// A list for each sample, with a number for each joint.
struct Rows<'a, const N: usize>(&'a [[f64; N]]);

impl<const N: usize> Serialize for Rows<'_, N> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(<[f64; N]>::as_slice))
    }
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
    /// The steps alone; `None` once they are finished.
    alone: Option<Paused<Result<Rollout<N>, Refused<RolloutError>>>>,
    /// Its time so far.
    took: Duration,
    /// The same run with its samples, and beside a reference if one is requested.
    sampled: Paused<Result<Rollout<N>, Refused<RolloutError>>>,
}

impl<const N: usize> RolloutWork<N> {
    /// The computation for `ask` and the `present` arm.
    #[must_use]
    pub fn new(ask: &RunOffline<N>, present: Present<N>) -> Self {
        Self::by(ask, present, rollout)
    }

    /// The same by another function than [`rollout`].
    fn by<F>(
        ask: &RunOffline<N>,
        present: Present<N>,
        made: impl Fn(RolloutRequest<N>) -> F + Clone + Send + 'static,
    ) -> Self
    where
        F: Future<Output = Result<Rollout<N>, RolloutError>> + Send,
    {
        let samples = usize::try_from(ask.samples.unwrap_or(DEFAULT_SAMPLES));
        let run = |is_alone: bool| {
            let (ask, made) = (ask.clone(), made.clone());
            Paused::new(async move {
                let mut request = ask.request(&present)?;
                if is_alone {
                    (request.samples, request.reference) = (2, false);
                }
                made(request).await.map_err(Refused::Study)
            })
        };
        Self {
            most_bytes: samples
                .unwrap_or(usize::MAX)
                .saturating_mul((3 * N + COLUMNS) * NUMBER_BYTES)
                .saturating_add(most_bytes::<N>()),
            alone: Some(run(true)),
            took: Duration::ZERO,
            sampled: run(false),
        }
    }
}

impl<const N: usize> Computed<N> for RunOffline<N> {
    type Work = RolloutWork<N>;

    fn work(self, present: Present<N>) -> Self::Work {
        RolloutWork::new(&self, present)
    }
}

impl<const N: usize> Computed<N> for Beside<RunOffline<N>> {
    type Work = RolloutWork<N>;

    fn work(self, present: Present<N>) -> Self::Work {
        let own = self.own;
        RolloutWork::by(&self.ask, present, move |request| {
            let own = own.clone();
            rollout_along(
                request,
                Course {
                    own,
                    ..Course::default()
                },
            )
        })
    }
}

impl<const N: usize> Work<RunAnswer<N>> for RolloutWork<N> {
    fn most_bytes(&self) -> usize {
        self.most_bytes
    }

    fn advance(&mut self, clock: fn() -> Duration) -> Option<RunAnswer<N>> {
        if let Some(alone) = &mut self.alone {
            let began = clock();
            let run = alone.advance();
            self.took += clock().saturating_sub(began);
            let is_refused = run?.is_err();
            self.alone = None;
            if !is_refused {
                return None;
            }
        }
        let run = self.sampled.advance()?;
        let took = self.took;
        Some(run.map(|run| Box::new(Ran { run, took })))
    }
}

impl<const N: usize> RunOffline<N> {
    /// The request for the run, with the present settings for missing fields.
    pub(crate) fn request(&self, present: &Present<N>) -> Result<RolloutRequest<N>, ArmError> {
        let (control, free) = (&present.control, no_control());
        let changed = &self.changed;
        Ok(RolloutRequest {
            control: changed.with_gains(control, free, &Gains::default())?,
            start: changed.state(&present.state),
            duration: self.duration.unwrap_or(DEFAULT_DURATION),
            samples: self.samples.unwrap_or(DEFAULT_SAMPLES),
            reference: self.reference.unwrap_or(false),
        })
    }
}
