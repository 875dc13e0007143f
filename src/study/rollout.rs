//! An offline run of the arm, sample by sample, with its error against a reference.
//!
//! The run is the live loop, [`Simulation`](crate::math::simulation::Simulation), from any state, or the same loop by a
//! method of one's own. Its reference has the same control law, evaluated at the same instants and held for the same
//! period. In between it follows the arm to rounding ([`TaylorReference`]). The difference is therefore the error of the
//! method alone. [`Rollout::from_ideal`] has the error of the held effort too.
//!
//! Three more references estimate the uncertainty of the first. Their arms differ in the last digits, and one of them
//! takes steps half as long. On a chaotic swing the reference is usable for some twenty seconds. All errors are along
//! the one growing direction. Two references may be close by chance, but four hardly ever are. The reference is
//! therefore within `SPREAD` times the largest distance between any two of them.
//!
//! **Invariant:** an accepted request bounds the steps, samples and work of its run. Its other numbers are checked
//! where they are read.

use super::beside::Steppable;
use super::continuous::ContinuousLoop;
use super::control_loop::ControlLoop;
use super::matrix::{largest, largest_difference};
use super::own_run::{OwnRun, Recorded};
use super::paused::{PieceWork, at_once};
use super::tableau::Pair;
use super::taylor::TaylorReference;
use crate::math::arm::{Arm, State};
use crate::math::count::{in_f64, steps_in, whole};
use crate::math::dynamics::energy;
use crate::math::integrator::Method;
use crate::math::pid::Pid;
use crate::math::shown::{Shown, shown_against};
use crate::math::simulation::{Divergence, Hold};

/// Most steps of one run: a few seconds of one core, or up to two minutes with a reference under control.
pub const MAX_STEPS: u64 = 10_000_000;

/// Most samples of one run, some 30 MB of JSON.
pub const MAX_SAMPLES: u64 = 100_000;

/// The request for a run: its loop, its start, its length and its samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RolloutRequest<const N: usize> {
    /// The loop of the run.
    pub control: ControlLoop<N>,
    /// The arm's state at the start.
    pub start: State<N>,
    /// Duration \[s\]; the run has the nearest number of steps.
    pub duration: f64,
    /// The number of samples, with start and end; fewer if the run has fewer steps.
    pub samples: u64,
    /// Whether to compute a reference too.
    pub reference: bool,
}

/// What a run may have beside its request. By default it has nothing of it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Course<const N: usize> {
    /// The steps after which there are samples, in order, instead of evenly spaced ones. They are within the run.
    pub sampled: Vec<u64>,
    /// The effort of each control period \[N m\] in place of the controller's. The last one also acts in all further
    /// periods.
    pub efforts: Vec<[f64; N]>,
    /// Whether the result has the samples of the reference.
    pub keeps_reference: bool,
    /// A method of one's own in place of the loop's.
    pub own: Option<Pair>,
}

impl<const N: usize> Course<N> {
    /// The step of a sample: the given one, or the nearest step for evenly spaced samples.
    fn due(&self, index: u64, steps: u64, intervals: u64) -> u64 {
        let given = usize::try_from(index)
            .ok()
            .and_then(|at| self.sampled.get(at));
        // The product is at most 1e5 times 1e7.
        given
            .copied()
            .unwrap_or((2 * index * steps + intervals) / (2 * intervals))
    }

    /// The effort in the step after `step` steps, if the controller has none, and the number of steps up to another one.
    fn effort(&self, step: u64, period: u64) -> Option<([f64; N], u64)> {
        let last = self.efforts.len().checked_sub(1)?;
        let at = usize::try_from(step / period).map_or(last, |at| at.min(last));
        let left = if at < last {
            period - step % period
        } else {
            u64::MAX
        };
        self.efforts.get(at).map(|effort| (*effort, left))
    }
}

/// Why a request is rejected.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum RolloutError {
    /// A time that is infinite, NaN or not positive.
    #[error("{field} must be finite and greater than 0, got {}", Shown(*.value))]
    NotPositive {
        /// `duration` or `timestep`.
        field: &'static str,
        /// The given time \[s\].
        value: f64,
    },
    /// Less than one step.
    #[error(
        "duration must be at least the timestep {}, got {}",
        shown_against(*.timestep, *.duration),
        shown_against(*.duration, *.timestep)
    )]
    TooShort {
        /// The given time \[s\].
        duration: f64,
        /// The given time \[s\].
        timestep: f64,
    },
    /// More steps than [`MAX_STEPS`].
    #[error(
        "duration / timestep must be at most {MAX_STEPS:e} steps, got {}",
        shown_against(*.0, in_f64(MAX_STEPS))
    )]
    TooManySteps(f64),
    /// Fewer than 2 samples, or more than [`MAX_SAMPLES`].
    #[error("samples must be between 2 and {MAX_SAMPLES}, got {0}")]
    Samples(u64),
}

impl<const N: usize> RolloutRequest<N> {
    /// The number of steps that is nearest to the duration.
    ///
    /// # Errors
    /// A time that is not positive, a duration of no step or of too many, or a number of samples that is out of bounds.
    pub fn steps(&self) -> Result<u64, RolloutError> {
        let (duration, timestep) = (self.duration, self.control.timestep);
        for (field, value) in [("duration", duration), ("timestep", timestep)] {
            if !value.is_finite() || value <= 0.0 {
                return Err(RolloutError::NotPositive { field, value });
            }
        }
        let steps = steps_in(duration, timestep);
        if steps < 1.0 {
            return Err(RolloutError::TooShort { duration, timestep });
        }
        let steps = steps.round();
        if steps > in_f64(MAX_STEPS) {
            return Err(RolloutError::TooManySteps(steps));
        }
        if !(2..=MAX_SAMPLES).contains(&self.samples) {
            return Err(RolloutError::Samples(self.samples));
        }
        Ok(whole(steps))
    }
}

/// Longest span of one call of a reference without control \[s\].
const MAX_SPAN: f64 = 0.05;

/// The distance of a run from a reference.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Deviation {
    /// Samples at which the reference was known. Fewer than those of the run if the reference was lost.
    pub samples: usize,
    /// Largest error of a joint position \[rad\].
    pub error: f64,
    /// Uncertainty of the errors \[rad\], at least one unit in the last place.
    pub uncertainty: f64,
}

/// References of a run.
const REFERENCES: usize = 4;

/// Uncertainty of the first reference, relative to the largest distance between two references.
const SPREAD: f64 = 3.0;

/// Least ratio of a known error to its uncertainty. A smaller error could be that of the reference.
const ABOVE_UNCERTAINTY: f64 = 4.0;

impl Deviation {
    /// The largest error \[rad\]; `None` if it is not clearly larger than its uncertainty.
    pub fn known(&self) -> Option<f64> {
        (self.error >= ABOVE_UNCERTAINTY * self.uncertainty).then_some(self.error)
    }

    fn take(&mut self, error: f64, uncertainty: f64) {
        self.samples += 1;
        self.error = largest([self.error, error].into_iter());
        self.uncertainty = largest([self.uncertainty, uncertainty].into_iter());
    }
}

/// A run with its samples. It ends early if a step diverges.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Rollout<const N: usize> {
    /// Times of the samples \[s\].
    pub times: Vec<f64>,
    /// Joint positions of the samples \[rad\].
    pub positions: Vec<[f64; N]>,
    /// Joint velocities of the samples \[rad/s\].
    pub velocities: Vec<[f64; N]>,
    /// Efforts of the last steps before the samples \[N m\]; zeros at the start.
    pub efforts: Vec<[f64; N]>,
    /// Kinetic plus potential energy of the samples \[J\].
    pub energy: Vec<f64>,
    /// Steps made.
    pub steps: u64,
    /// Evaluations of the dynamics by the run itself, without its references.
    pub evaluations: u64,
    /// Errors against the reference, if one was requested.
    pub deviation: Option<Deviation>,
    /// Errors of the method and of the held effort, against the loop with a continuous-time law, up to the first effort at
    /// a limit of the motors. `None` without a control law, or if no reference was requested.
    pub from_ideal: Option<Deviation>,
    /// The step that diverged, if one did.
    pub divergence: Option<Divergence>,
    /// The samples of the reference, if they were requested; NaN once it is lost.
    pub reference: Vec<State<N>>,
}

/// The most memory of [`rollout`] without its samples, in bytes.
pub const fn most_bytes<const N: usize>() -> usize {
    size_of::<[Reference<N>; REFERENCES]>() + size_of::<[Ideal<N>; 2]>()
}

/// Simulates a run, in pieces. The start is the first sample.
///
/// # Errors
/// The reason of [`RolloutRequest::steps`].
pub async fn rollout<const N: usize>(
    request: RolloutRequest<N>,
) -> Result<Rollout<N>, RolloutError> {
    let run = request.control.simulation(request.start);
    recorded(request, Course::default(), run).await
}

/// Does what [`rollout`] does, with samples at other steps, with efforts that are given, or by a method of
/// one's own. The reference has the same efforts.
///
/// # Errors
/// The reason of [`RolloutRequest::steps`].
pub async fn rollout_along<const N: usize>(
    request: RolloutRequest<N>,
    course: Course<N>,
) -> Result<Rollout<N>, RolloutError> {
    let RolloutRequest { control, start, .. } = request;
    match course.own.clone() {
        Some(pair) => recorded(request, course, OwnRun::new(control, pair, start)).await,
        None => recorded(request, course, control.simulation(start)).await,
    }
}

/// The `run` of a request. A program without methods of one's own has no code of theirs.
async fn recorded<const N: usize>(
    request: RolloutRequest<N>,
    course: Course<N>,
    mut run: impl Recorded<N>,
) -> Result<Rollout<N>, RolloutError> {
    let RolloutRequest { control, start, .. } = request;
    let steps = request.steps()?;
    let samples = match course.sampled.len() as u64 {
        0 => request.samples.min(steps + 1),
        given => given,
    };
    let period = control.period.steps(control.timestep);
    let intervals = samples.saturating_sub(1).max(1);
    // On the heap, so that a run that has not begun has no memory for them.
    let references = |index| Reference::new(&control, start, index);
    let mut references: Option<Box<[Reference<N>; REFERENCES]>> = request
        .reference
        .then(|| Box::new(std::array::from_fn(references)));
    let has_law = !control.is_free() && course.efforts.is_empty();
    let mut ideals = (request.reference && has_law)
        .then(|| [1, 2].map(|cuts| Ideal::new(&control, start, cuts)));
    let mut made = Rollout {
        deviation: references.as_ref().map(|_| Deviation::default()),
        from_ideal: ideals.as_ref().map(|_| Deviation::default()),
        ..Rollout::default()
    };
    // With a law, references follow every step. Without one, short spans keep the pieces short.
    let stride = if ideals.is_some() {
        1
    } else {
        whole(MAX_SPAN / control.timestep).clamp(1, 1000)
    };
    let mut piece = PieceWork::default();
    let mut counted = 0;
    for index in 0..samples {
        let due = course.due(index, steps, intervals);
        while run.steps() < due && run.divergence().is_none() {
            let mut ahead = (due - run.steps()).min(stride);
            let driven = course.effort(run.steps(), period);
            if let Some((effort, left)) = driven {
                run.drive(effort);
                ahead = ahead.min(left);
            }
            let taken = run.advance(ahead);
            let applied = driven.map(|(effort, _)| control.limits.applied(effort));
            let before = std::mem::replace(&mut counted, run.evaluations());
            piece.spend(counted - before).await;
            for reference in references.as_deref_mut().into_iter().flatten() {
                reference.follow(taken, applied, &mut piece).await;
            }
            let is_limited = run.is_at_limit();
            for ideal in ideals.iter_mut().flatten() {
                ideal.run.take_if(|_| is_limited);
                ideal.follow(taken, &mut piece).await;
            }
        }
        if run.divergence().is_some() {
            break;
        }
        made.sample(&control.arm, &run, references.as_deref(), ideals.as_ref());
        if let (true, Some([first, ..])) = (course.keeps_reference, references.as_deref()) {
            let lost = State {
                position: [f64::NAN; N],
                velocity: [f64::NAN; N],
            };
            made.reference
                .push(if first.is_lost { lost } else { *first.state() });
        }
    }
    made.steps = run.steps();
    made.evaluations = run.evaluations();
    made.divergence = run.divergence();
    Ok(made)
}

impl<const N: usize> Rollout<N> {
    fn sample(
        &mut self,
        arm: &Arm<N>,
        run: &impl Recorded<N>,
        references: Option<&[Reference<N>; REFERENCES]>,
        ideals: Option<&[Ideal<N>; 2]>,
    ) {
        let state = run.state();
        self.times.push(run.time());
        self.positions.push(state.position);
        self.velocities.push(state.velocity);
        self.efforts.push(run.effort());
        self.energy.push(energy(arm, state));
        let last_digit = f64::EPSILON * largest(state.position.iter().map(|q| q.abs())).max(1.0);
        if let (Some(deviation), Some(references)) = (&mut self.deviation, references)
            && references.iter().all(|one| !one.is_lost)
        {
            let poses = references.each_ref().map(|it| it.state().position);
            let apart = |one| largest(poses.iter().map(|other| largest_difference(one, other)));
            let spread = SPREAD * largest(poses.iter().map(|one| apart(one)));
            let error = largest_difference(&state.position, &poses[0]);
            deviation.take(error, spread.max(last_digit));
        }
        if let (Some(deviation), Some([first, second])) = (&mut self.from_ideal, ideals)
            && let (Some(first), Some(second)) = (&first.run, &second.run)
        {
            let [first, second] = [&first.state.position, &second.state.position];
            let uncertainty = largest_difference(first, second).max(last_digit);
            deviation.take(largest_difference(&state.position, second), uncertainty);
        }
    }

    /// The largest error of a deviation of this run and its uncertainty \[rad\], if they are known for all samples and the
    /// run did not diverge. An error over some of the samples is not comparable with that of another run.
    pub fn known(&self, deviation: Option<&Deviation>) -> (Option<f64>, Option<f64>) {
        let whole = deviation
            .filter(|deviation| deviation.samples == self.times.len() && self.divergence.is_none());
        let uncertainty = whole.map(|deviation| deviation.uncertainty);
        (whole.and_then(Deviation::known), uncertainty)
    }
}

/// Longest step of Runge-Kutta 4 in an ideal loop \[s\]. The error is then some 1e-12 rad for the default arms.
const LONGEST_STEP: f64 = 2.5e-4;

/// Most of its steps per step of the run. If those are long, its own are longer, which their uncertainty shows.
const MOST_STEPS: u64 = 256;

/// Most steps of an ideal loop: some ten seconds of one core. [`MAX_STEPS`] short steps take half of them.
const MAX_IDEAL_STEPS: u64 = 4 * MAX_STEPS;

/// The loop with a continuous-time law. Its timestep divides that of the run.
struct Ideal<const N: usize> {
    /// `None` once it has diverged, or an effort is at its limit: this loop has no limits.
    run: Option<ContinuousLoop<N>>,
    parts: u64,
}

impl<const N: usize> Ideal<N> {
    /// The loop from `start` on, with steps divided by `cuts`.
    fn new(control: &ControlLoop<N>, start: State<N>, cuts: u64) -> Self {
        let parts = whole((control.timestep / LONGEST_STEP).ceil());
        let parts = parts.clamp(1, MOST_STEPS) * cuts;
        let timestep = control.timestep / in_f64(parts);
        let control = control.with_method(Method::Rk4).with_timestep(timestep);
        Self {
            run: Some(ContinuousLoop::new(control, start, [0.0; N])),
            parts,
        }
    }

    /// Follows the run by this number of its steps.
    async fn follow(&mut self, steps: u64, piece: &mut PieceWork) {
        for _ in 0..steps * self.parts {
            self.run
                .take_if(|run| run.steps >= MAX_IDEAL_STEPS || run.is_at_limit() || !run.step());
            if self.run.is_none() {
                return;
            }
            piece.spend(Method::Rk4.evaluations().into()).await;
        }
    }
}

/// The reference motion of a run: the same law at the same instants, and between them the arm to rounding.
pub(super) struct Reference<const N: usize> {
    arm: Arm<N>,
    taylor: TaylorReference<N>,
    pid: Pid<N>,
    hold: Hold<N>,
    /// Length of a step of the run \[s\].
    timestep: f64,
    /// Calls of [`Reference::follow`]. Each counts as work, even if it is too short for a coefficient.
    spans: u64,
    /// Whether the motion changed too fast to be computed, or needed too much work.
    is_lost: bool,
}

impl<const N: usize> Reference<N> {
    /// One of several references of a loop, which differ by rounding.
    pub(super) fn new(control: &ControlLoop<N>, start: State<N>, index: usize) -> Self {
        Self {
            arm: neighbour(&control.arm, index),
            taylor: TaylorReference::new(start).cut(if index == 1 { 2 } else { 1 }),
            pid: control.simulation(start).pid().clone(),
            hold: control.hold(),
            timestep: control.timestep,
            spans: 0,
            is_lost: false,
        }
    }

    /// Follows the run by this number of its steps, which is 1 with a control law. An effort that is `applied` \[N m\]
    /// replaces that of the law.
    async fn follow(&mut self, steps: u64, applied: Option<[f64; N]>, piece: &mut PieceWork) {
        if self.is_lost {
            return;
        }
        self.spans += 1;
        let mut effort = applied.unwrap_or([0.0; N]);
        if applied.is_none() && self.pid.is_enabled() {
            let (control, held) = self.hold.begin_step(&self.pid, self.taylor.state());
            effort = control.effort;
            self.pid.commit(control.integral);
            self.hold.commit(held);
        }
        let span = in_f64(steps) * self.timestep;
        let followed = self
            .taylor
            .follow_in_pieces(&self.arm, &effort, span, piece);
        self.is_lost = !followed.await || self.taylor.coefficients() > MAX_RUN_COEFFICIENTS;
    }
}

/// Most series coefficients of a reference of a rollout: half a minute of one core. [`MAX_STEPS`] short steps take half of
/// them.
const MAX_RUN_COEFFICIENTS: u64 = 200_000_000;

/// Most series coefficients of a motion that is compared step by step: a few seconds of one core.
const MAX_COEFFICIENTS: u64 = 40_000_000;

impl<const N: usize> Steppable<N> for Reference<N> {
    fn advance(&mut self, steps: u64) -> u64 {
        let mut follow = || {
            at_once(self.follow(1, None, &mut PieceWork::default()));
            !self.is_lost && self.evaluations() <= MAX_COEFFICIENTS
        };
        (0..steps).take_while(|_| follow()).count() as u64
    }

    fn evaluations(&self) -> u64 {
        self.taylor.coefficients() + self.spans
    }

    fn state(&self) -> &State<N> {
        self.taylor.state()
    }
}

/// An arm with a length and a mass changed in the last digit, differently for every index above 0. Rounding the
/// constants of the equations of motion has an effect of this size. It is the same in every step, so a different step
/// length would not reveal it.
fn neighbour<const N: usize>(arm: &Arm<N>, index: usize) -> Arm<N> {
    let (mut lengths, mut masses) = (*arm.lengths(), *arm.masses());
    if let (Some(length), Some(mass)) = (lengths.first_mut(), masses.last_mut()) {
        (*length, *mass) = match index {
            0 => (*length, *mass),
            1 => (length.next_up(), mass.next_up()),
            2 => (length.next_down(), mass.next_up()),
            _ => (length.next_up(), mass.next_down()),
        };
    }
    let neighbour = Arm::new(lengths, masses, arm.gravity());
    let neighbour = neighbour.and_then(|one| one.with_friction(*arm.viscous()));
    neighbour.unwrap_or(*arm)
}
