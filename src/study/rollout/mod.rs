//! An offline run of the arm, sample by sample, with its error against a reference.
//!
//! The run is the live loop, [`Simulation`], from any state. Its reference obeys the same control law, evaluated at the
//! same instants and held for the same timestep, and follows the arm in between to rounding ([`Follower`]). So the
//! difference is the error of the method alone. (Against a law that acts at every instant, holding the effort would
//! cost an error of first order that no method can mend.) A second reference, in steps half as long and of an arm that
//! differs in its last digits, says how far the first can be trusted, which is some twenty seconds on a chaotic swing.
//!
//! **Invariant:** steps, samples and work are bounded when a run is made, and a run cut into slices gives the same bits
//! as one made at once.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

mod request;

pub use request::{MAX_SAMPLES, MAX_STEPS, RolloutError, RolloutRequest};

use super::follower::Follower;
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::energy;
use crate::math::pid::Pid;
use crate::math::simulation::{Divergence, Simulation};

/// Longest span that a reference without control is asked to follow at once \[s\].
const MAX_SPAN: f64 = 0.05;

/// How far the samples are from the reference: an entry per sample, or fewer if the reference was lost on the way.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Deviation {
    /// Largest error of a joint position, per sample \[rad\].
    pub errors: Vec<f64>,
    /// How far two references are apart, per sample \[rad\]; an error below this says nothing.
    pub uncertainties: Vec<f64>,
}

/// How many times its uncertainty a known error is at least: in a smaller one the reference's own error would show.
const ABOVE_UNCERTAINTY: f64 = 4.0;

impl Deviation {
    /// The largest error \[rad\], if the references know it: `None` if it is about as large as their difference.
    #[must_use]
    pub fn known(&self) -> Option<f64> {
        let error = self.largest();
        (error >= ABOVE_UNCERTAINTY * self.largest_uncertainty()).then_some(error)
    }

    /// The largest error \[rad\].
    #[must_use]
    pub fn largest(&self) -> f64 {
        self.errors.iter().copied().fold(0.0, f64::max)
    }

    /// The largest uncertainty \[rad\].
    #[must_use]
    pub fn largest_uncertainty(&self) -> f64 {
        self.uncertainties.iter().copied().fold(0.0, f64::max)
    }
}

/// A run in progress, with its samples so far.
#[derive(Debug, Clone)]
pub struct Rollout<const N: usize> {
    simulation: Simulation<N>,
    steps: u64,
    samples: u64,
    references: Option<[Reference<N>; 2]>,
    times: Vec<f64>,
    positions: Vec<[f64; N]>,
    velocities: Vec<[f64; N]>,
    efforts: Vec<[f64; N]>,
    energy: Vec<f64>,
    deviation: Deviation,
}

impl<const N: usize> Rollout<N> {
    /// A run that is about to make its first step; the start is its first sample.
    ///
    /// # Errors
    /// The first value that is out of bounds.
    pub fn new(request: RolloutRequest<N>) -> Result<Self, RolloutError> {
        let steps = request.check()?;
        let simulation = request.control.simulation(request.start);
        let references = request.reference.then(|| {
            [1, 2].map(|cuts| Reference {
                arm: if cuts == 1 {
                    request.control.arm
                } else {
                    neighbour(&request.control.arm)
                },
                follower: Follower::new(request.start).cut(cuts),
                pid: simulation.pid().clone(),
                lost: false,
                behind: Behind::default(),
            })
        });
        let mut rollout = Self {
            simulation,
            steps,
            samples: request.samples.min(steps + 1),
            references,
            times: vec![],
            positions: vec![],
            velocities: vec![],
            efforts: vec![],
            energy: vec![],
            deviation: Deviation::default(),
        };
        rollout.sample();
        Ok(rollout)
    }

    /// Goes on until about `work` evaluations of the dynamics are made, a coefficient of a reference counted as one,
    /// and says how many that were: 0 once the run is over.
    pub fn advance(&mut self, work: u64) -> u64 {
        let before = self.all_evaluations();
        let bound = before.saturating_add(work.max(1));
        while !self.is_over() {
            if !self.is_behind() {
                // The run goes to the next sample, or, if a reference has to look at every step, so far that the work
                // stays in bounds.
                let ahead = self.next_sample().saturating_sub(self.simulation.steps());
                let wanted = ahead.min(self.stride()).max(1);
                let taken = self.simulation.advance(wanted);
                let timestep = self.simulation.timestep();
                for reference in self.references.iter_mut().flatten() {
                    reference.fall_behind(timestep, taken);
                }
            }
            let mut left = bound.saturating_sub(self.all_evaluations());
            for reference in self.references.iter_mut().flatten() {
                left = left.saturating_sub(reference.follow(left));
            }
            let at_sample = self.simulation.steps() == self.next_sample();
            if at_sample && !self.is_behind() && self.simulation.divergence().is_none() {
                self.sample();
            }
            if self.all_evaluations() >= bound {
                break;
            }
        }
        self.all_evaluations() - before
    }

    /// Whether a reference has not come to where the run is.
    fn is_behind(&self) -> bool {
        let mut references = self.references.iter().flatten();
        references.any(|one| one.behind.steps > 0)
    }

    /// Steps that are made in one go: a reference without control is asked for spans of [`MAX_SPAN`] at most, and
    /// nothing runs for longer than a slice may last. It depends on the request
    /// alone, so that slices don't change bits.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "bounded below by 1 and above by 1000"
    )]
    fn stride(&self) -> u64 {
        if self.references.is_some() && self.simulation.pid().is_enabled() {
            1
        } else {
            (MAX_SPAN / self.simulation.timestep()).clamp(1.0, 1000.0) as u64
        }
    }

    /// The step at which the next sample is due: the samples are spread evenly, start and end among them.
    fn next_sample(&self) -> u64 {
        let index = self.times.len() as u64;
        let intervals = self.samples.saturating_sub(1).max(1);
        // At most 1e5 times 1e7.
        index * self.steps / intervals
    }

    fn sample(&mut self) {
        let state = *self.simulation.state();
        self.times.push(self.simulation.time());
        self.positions.push(state.position);
        self.velocities.push(state.velocity);
        self.efforts.push(*self.simulation.effort());
        self.energy.push(energy(self.simulation.arm(), &state));
        if let Some([first, second]) = &self.references
            && !first.lost
            && !second.lost
        {
            let (first, second) = (first.follower.state(), second.follower.state());
            self.deviation.errors.push(apart(&state, first));
            self.deviation.uncertainties.push(apart(first, second));
        }
    }

    /// Whether all steps are made, or the run has diverged, and the references have come as far.
    #[must_use]
    pub fn is_over(&self) -> bool {
        let is_last = self.simulation.steps() >= self.steps;
        (is_last || self.simulation.divergence().is_some()) && !self.is_behind()
    }

    /// Steps made.
    #[must_use]
    pub fn done(&self) -> u64 {
        self.simulation.steps()
    }

    /// Steps of the whole run.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// How often the run itself, without its references, has evaluated the dynamics.
    #[must_use]
    pub fn evaluations(&self) -> u64 {
        self.simulation.steps() * u64::from(self.simulation.method().evaluations())
    }

    fn all_evaluations(&self) -> u64 {
        let references = self.references.iter().flatten();
        self.evaluations()
            + references
                .map(|one| one.follower.coefficients())
                .sum::<u64>()
    }

    /// Times of the samples \[s\].
    #[must_use]
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Joint positions of the samples \[rad\].
    #[must_use]
    pub fn positions(&self) -> &[[f64; N]] {
        &self.positions
    }

    /// Joint velocities of the samples \[rad/s\].
    #[must_use]
    pub fn velocities(&self) -> &[[f64; N]] {
        &self.velocities
    }

    /// Efforts of the steps that led to the samples \[N m\]; zeros at the start.
    #[must_use]
    pub fn efforts(&self) -> &[[f64; N]] {
        &self.efforts
    }

    /// Kinetic plus potential energy of the samples \[J\].
    #[must_use]
    pub fn energy(&self) -> &[f64] {
        &self.energy
    }

    /// Errors against the reference, if one was asked for.
    #[must_use]
    pub fn deviation(&self) -> Option<&Deviation> {
        self.references.as_ref().map(|_| &self.deviation)
    }

    /// The place at which a step led out of the finite numbers, if one did; the samples end before.
    #[must_use]
    pub fn divergence(&self) -> Option<Divergence> {
        self.simulation.divergence()
    }
}

/// The motion that the run ought to have.
#[derive(Debug, Clone)]
struct Reference<const N: usize> {
    arm: Arm<N>,
    follower: Follower<N>,
    pid: Pid<N>,
    /// Whether the motion was too wild to be followed.
    lost: bool,
    behind: Behind<N>,
}

/// The stretches that a reference has to follow, to come to where the run is.
#[derive(Debug, Clone)]
struct Behind<const N: usize> {
    /// Stretches that are left, each under one effort: steps under control, or all of them at once.
    steps: u64,
    /// Length of each \[s\].
    stretch: f64,
    /// Whether the stretch is being followed.
    begun: bool,
    /// The effort that drives the arm in it.
    effort: [f64; N],
}

impl<const N: usize> Default for Behind<N> {
    fn default() -> Self {
        Self {
            steps: 0,
            stretch: 0.0,
            begun: false,
            effort: [0.0; N],
        }
    }
}

impl<const N: usize> Reference<N> {
    /// Notes that the run has gone on by `steps` steps of `timestep` \[s\]: one at a time if there is a law to obey,
    /// else all at once.
    fn fall_behind(&mut self, timestep: f64, steps: u64) {
        if self.lost || steps == 0 {
            return;
        }
        (self.behind.steps, self.behind.stretch) = if self.pid.is_enabled() {
            (steps, timestep)
        } else {
            (1, in_f64(steps) * timestep)
        };
    }

    /// Follows the run with about `work` coefficients at most, and says with how many.
    fn follow(&mut self, work: u64) -> u64 {
        let before = self.follower.coefficients();
        let bound = before.saturating_add(work);
        while self.behind.steps > 0 {
            if !self.behind.begun {
                let timestep = self.behind.stretch;
                if self.pid.is_enabled() {
                    let control = self.pid.control(self.follower.state(), timestep);
                    self.behind.effort = control.effort;
                    self.pid.commit(control.integral);
                }
                self.follower.begin(timestep);
                self.behind.begun = true;
            }
            match self.follower.go_on(&self.arm, &self.behind.effort, bound) {
                None => break,
                Some(false) => {
                    self.lost = true;
                    self.behind.steps = 0;
                }
                Some(true) => self.behind.steps -= 1,
            }
            self.behind.begun = false;
        }
        self.follower.coefficients() - before
    }
}

/// An arm that differs in the last digit of a length and a mass. The equations of motion lose as much by rounding their
/// constants, and lose the same in every step, so that steps of another length would not show it.
fn neighbour<const N: usize>(arm: &Arm<N>) -> Arm<N> {
    let (mut lengths, mut masses) = (*arm.lengths(), *arm.masses());
    if let (Some(length), Some(mass)) = (lengths.first_mut(), masses.last_mut()) {
        (*length, *mass) = (length.next_up(), mass.next_up());
    }
    Arm::new(lengths, masses, arm.gravity()).unwrap_or(*arm)
}

/// Largest difference of a joint position \[rad\].
fn apart<const N: usize>(a: &State<N>, b: &State<N>) -> f64 {
    super::matrix::largest((0..N).map(|i| (a.position[i] - b.position[i]).abs()))
}
