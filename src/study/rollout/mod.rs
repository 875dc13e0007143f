//! An offline run of the arm, sample by sample, with its error against a reference.
//!
//! The run is the live loop, [`Simulation`], from any state. Its reference obeys the same control law, evaluated at the
//! same instants and held for the same period, and follows the arm in between to rounding ([`TaylorReference`]). So the
//! difference is the error of the method alone. Against a law that acts at every instant ([`Rollout::from_ideal`])
//! holding the effort costs an error of first order in the control period, which no method can mend.
//!
//! Three more references, of arms that differ in their last digits, one of them in steps half as long, say how far
//! the first can be trusted. On a chaotic swing that is some twenty seconds. All of them err along the one direction
//! that grows. Two may come near each other by chance; four hardly do, so that `SPREAD` times the largest distance
//! between any two of them holds the truth.
//!
//! **Invariant:** steps, samples and work are bounded when a run is made, and a run cut into slices gives the same bits
//! as one made at once.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

mod ideal;
mod request;

pub use request::{MAX_SAMPLES, MAX_STEPS, RolloutError, RolloutRequest};

use self::ideal::Ideal;
use super::matrix::largest;
use super::taylor::TaylorReference;
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::energy;
use crate::math::pid::Pid;
use crate::math::simulation::{Divergence, Held, Hold, Simulation};

/// Longest span that a reference without control is asked to follow at once \[s\].
const MAX_SPAN: f64 = 0.05;

/// How far the samples are from the reference: an entry per sample, or fewer if the reference was lost on the way.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Deviation {
    /// Largest error of a joint position, per sample \[rad\].
    pub errors: Vec<f64>,
    /// How far the errors may be off, per sample \[rad\]: the distance between the references, at least a last
    /// digit.
    pub uncertainties: Vec<f64>,
}

/// References of a run.
const REFERENCES: usize = 4;

/// How many times the largest distance between two references the first one may be off.
const SPREAD: f64 = 3.0;

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
        largest(self.errors.iter().copied())
    }

    /// The largest uncertainty \[rad\].
    #[must_use]
    pub fn largest_uncertainty(&self) -> f64 {
        largest(self.uncertainties.iter().copied())
    }
}

/// A run in progress, with its samples so far.
#[derive(Debug, Clone)]
pub struct Rollout<const N: usize> {
    simulation: Simulation<N>,
    steps: u64,
    samples: u64,
    references: Option<[Reference<N>; REFERENCES]>,
    /// The loop whose law acts at every instant, twice: in longer and in shorter steps.
    ideals: Option<[Ideal<N>; 2]>,
    times: Vec<f64>,
    positions: Vec<[f64; N]>,
    velocities: Vec<[f64; N]>,
    efforts: Vec<[f64; N]>,
    energy: Vec<f64>,
    deviation: Deviation,
    from_ideal: Deviation,
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
            std::array::from_fn(|index| Reference {
                arm: neighbour(&request.control.arm, index),
                taylor: TaylorReference::new(request.start).cut(if index == 1 { 2 } else { 1 }),
                pid: simulation.pid().clone(),
                hold: Hold::new(
                    Held {
                        period: request.control.period,
                        ..Held::default()
                    },
                    request.control.timestep,
                ),
                lost: false,
                behind: 0,
                stretch: 0.0,
                begun: false,
                effort: [0.0; N],
            })
        });
        let mut rollout = Self {
            simulation,
            steps,
            samples: request.samples.min(steps + 1),
            references,
            ideals: (request.reference && !request.control.is_free())
                .then(|| [1, 2].map(|cuts| Ideal::new(&request.control, request.start, cuts))),
            times: vec![],
            positions: vec![],
            velocities: vec![],
            efforts: vec![],
            energy: vec![],
            deviation: Deviation::default(),
            from_ideal: Deviation::default(),
        };
        rollout.sample();
        Ok(rollout)
    }

    /// Goes on until about `work` evaluations of the dynamics are made; a coefficient of a reference counts as one.
    /// Returns how many they were: 0 once the run is over.
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
                for ideal in self.ideals.iter_mut().flatten() {
                    ideal.fall_behind(taken);
                }
            }
            let mut left = bound.saturating_sub(self.all_evaluations());
            for reference in self.references.iter_mut().flatten() {
                left = left.saturating_sub(reference.follow(left));
            }
            for ideal in self.ideals.iter_mut().flatten() {
                left = left.saturating_sub(ideal.follow(left));
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
        references.any(|one| one.behind > 0) || self.ideals.iter().flatten().any(Ideal::is_behind)
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

    /// The step at which the next sample is due: the one nearest to its place. The places are spread evenly, start and
    /// end among them.
    fn next_sample(&self) -> u64 {
        let index = self.times.len() as u64;
        let intervals = self.samples.saturating_sub(1).max(1);
        // At most 1e5 times 1e7.
        (2 * index * self.steps + intervals) / (2 * intervals)
    }

    fn sample(&mut self) {
        let state = *self.simulation.state();
        self.times.push(self.simulation.time());
        self.positions.push(state.position);
        self.velocities.push(state.velocity);
        self.efforts.push(*self.simulation.effort());
        self.energy.push(energy(self.simulation.arm(), &state));
        let last_digit = last_digit(&state);
        if let Some(references) = &self.references
            && references.iter().all(|one| !one.lost)
        {
            let states = references.each_ref().map(|one| one.taylor.state());
            let spread = SPREAD * largest_distance(&states);
            self.deviation.errors.push(apart(&state, states[0]));
            self.deviation.uncertainties.push(spread.max(last_digit));
        }
        if let Some([first, second]) = &self.ideals
            && let (Some(first), Some(second)) = (first.state(), second.state())
        {
            let uncertainty = apart(first, second).max(last_digit);
            self.from_ideal.errors.push(apart(&state, second));
            self.from_ideal.uncertainties.push(uncertainty);
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
            + references.map(|one| one.taylor.coefficients()).sum::<u64>()
            + self
                .ideals
                .iter()
                .flatten()
                .map(Ideal::evaluations)
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

    /// Errors of the method, and of holding the effort, against the loop whose law acts at every instant. There are
    /// some if there is a law and a reference was asked for.
    #[must_use]
    pub fn from_ideal(&self) -> Option<&Deviation> {
        self.ideals.as_ref().map(|_| &self.from_ideal)
    }

    /// The largest error of a deviation of this run and its uncertainty \[rad\], where they are known for all samples.
    /// An error of some of them can't be compared with another run's.
    #[must_use]
    pub fn known(&self, deviation: Option<&Deviation>) -> (Option<f64>, Option<f64>) {
        let whole = deviation.filter(|deviation| deviation.errors.len() == self.times.len());
        (
            whole.and_then(Deviation::known),
            whole.map(Deviation::largest_uncertainty),
        )
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
    taylor: TaylorReference<N>,
    pid: Pid<N>,
    hold: Hold<N>,
    /// Whether the motion was too wild to be followed.
    lost: bool,
    /// Stretches that are left to come to where the run is, each under one effort: steps under control, or all of them
    /// at once.
    behind: u64,
    /// Length of each \[s\].
    stretch: f64,
    /// Whether the stretch is being followed.
    begun: bool,
    /// The effort that drives the arm in it \[N m\].
    effort: [f64; N],
}

impl<const N: usize> Reference<N> {
    /// Notes that the run has gone on by `steps` steps of `timestep` \[s\]: one at a time if there is a law to obey,
    /// else all at once.
    fn fall_behind(&mut self, timestep: f64, steps: u64) {
        if self.lost || steps == 0 {
            return;
        }
        (self.behind, self.stretch) = if self.pid.is_enabled() {
            (steps, timestep)
        } else {
            (1, in_f64(steps) * timestep)
        };
    }

    /// Follows the run with about `work` coefficients at most, and says with how many.
    fn follow(&mut self, work: u64) -> u64 {
        let before = self.taylor.coefficients();
        let bound = before.saturating_add(work);
        while self.behind > 0 {
            if !self.begun {
                if self.pid.is_enabled() {
                    let state = self.taylor.state();
                    let (control, held) = self.hold.begin_step(&self.pid, state);
                    self.effort = control.effort;
                    self.pid.commit(control.integral);
                    self.hold.commit(held);
                }
                self.taylor.begin(self.stretch);
                self.begun = true;
            }
            match self.taylor.go_on(&self.arm, &self.effort, bound) {
                None => break,
                Some(false) => {
                    self.lost = true;
                    self.behind = 0;
                }
                Some(true) => self.behind -= 1,
            }
            self.begun = false;
        }
        self.taylor.coefficients() - before
    }
}

/// An arm that differs in the last digit of a length and a mass, in another way for every index; that of index 0 does
/// not. The equations of motion lose as much by rounding their constants, and lose the same in every step, so that
/// steps of another length would not show it.
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
    Arm::new(lengths, masses, arm.gravity()).unwrap_or(*arm)
}

/// Largest distance of any two states in a joint position \[rad\]; NaN counts as the largest.
fn largest_distance<const N: usize>(states: &[&State<N>]) -> f64 {
    let pairs = states.iter().enumerate().flat_map(|(index, one)| {
        let others = &states[..index];
        others.iter().map(|other| apart(one, other))
    });
    largest(pairs)
}

/// The worth of the last digit of a joint position \[rad\].
fn last_digit<const N: usize>(state: &State<N>) -> f64 {
    let largest = largest(state.position.iter().map(|q| q.abs()));
    f64::EPSILON * largest.max(1.0)
}

/// Largest difference of a joint position \[rad\].
fn apart<const N: usize>(a: &State<N>, b: &State<N>) -> f64 {
    largest((0..N).map(|i| (a.position[i] - b.position[i]).abs()))
}
