//! Error against cost: the same scenes for every method, each against one reference.
//!
//! A [`Scene`] is an arm (or the particle of `/arm_sim/integration_step`), a start, a control law and a duration. A run
//! takes any number of equal steps. Its error is the largest distance of a joint to the reference, over all steps, or
//! about [`MOST_LOOKS`] of them. The reference is known at any instant. Cost is counted in evaluations
//! of the dynamics here. For seconds, time [`Scene::replay`], which takes the same steps and does no more.
//!
//! **Invariant:** nothing is chosen per method: same starts, same timesteps, same reference, same measure.

use super::reference::{DoubleDouble, Law, ReferencePath, largest_difference};
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::expression::Expression;
use crate::math::integrator::Method;
use crate::math::particle::{MAX_STEPS, Particle};
use crate::math::pid::{Gains, Setpoint};
use crate::study::beside::Steppable;
use crate::study::continuous::ContinuousLoop;
use crate::study::control_loop::ControlLoop;
use crate::study::linear::Linear;
use crate::study::stability::{Sampling, largest_timestep};

/// Steps of the coarsest run of a row: a power of two, so that the timesteps of a duration that is one too are exact.
pub const OUTPUTS: u64 = 64;

/// Steps after which a run is compared, at most twice as many: a millisecond apart in two seconds, where no peak of an
/// error hides in between.
pub const MOST_LOOKS: u64 = 2048;

/// A run whose angles are off by a whole turn \[rad\] shows nothing any more, and counts as diverged.
pub const LOST: f64 = std::f64::consts::TAU;

/// Gains of the reach: soft enough that timesteps of tens of milliseconds are on both sides of the stability edge.
pub const REACH_GAINS: Gains<2> = Gains {
    kp: [200.0, 100.0],
    ki: [0.0; 2],
    kd: [30.0, 12.0],
};

/// Target of the reach, from the starting pose.
pub const REACH_SETPOINT: Setpoint<2> = Setpoint {
    position: [0.8, -0.6],
    velocity: [0.0; 2],
};

/// The reach in words.
pub const REACH: &str = "a reach of 2 links to (0.8, -0.6) with kp 200, 100 and kd 30, 12";

/// The outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunOutcome {
    /// Steps that were to be taken.
    pub steps: u64,
    /// Length of each \[s\].
    pub timestep: f64,
    /// Evaluations of the dynamics, counted.
    pub evaluations: u64,
    /// Largest angle error over all comparisons and joints \[rad\] (\[m\] for the particle).
    pub error: f64,
    /// The last angles, summed \[rad\].
    pub end: f64,
    /// The time at which the run was lost or left the finite numbers \[s\], if it was.
    pub diverged: Option<f64>,
}

impl RunOutcome {
    fn new(steps: u64, duration: f64) -> Self {
        Self {
            steps,
            timestep: duration / in_f64(steps),
            evaluations: 0,
            error: 0.0,
            end: f64::NAN,
            diverged: None,
        }
    }

    /// Takes in the error after a step; `false` once it exceeds `most`, where the run is lost.
    fn take(&mut self, step: u64, error: f64, most: f64) -> bool {
        // NaN is lost too.
        let is_known = error <= most;
        if is_known {
            self.error = self.error.max(error);
        } else {
            self.error = f64::INFINITY;
            self.diverged = Some(self.timestep * in_f64(step));
        }
        is_known
    }
}

/// Something to be computed by every method.
pub struct Scene {
    /// Short name, as files and tables use it.
    pub name: &'static str,
    /// The scene in words, for a heading.
    pub title: &'static str,
    /// Parameters in one line.
    pub about: String,
    /// How the effort is found: `none`, `continuous` or `held`.
    pub control: &'static str,
    /// Unit of its errors.
    pub unit: &'static str,
    /// Simulated time \[s\].
    pub duration: f64,
    /// How far the reference itself may be off \[rad\].
    pub uncertainty: f64,
    /// Most steps of one run.
    pub most_steps: u64,
    /// The largest stable timestep of each method \[s\] as predicted for the control at its setpoint, if it has one.
    limits: [Option<f64>; Method::ALL.len()],
    run: Box<dyn SceneRun>,
}

/// The runs of a scene.
trait SceneRun {
    /// Takes the steps of `outcome` and compares; ends where an error exceeds `most`.
    fn compare(&self, method: Method, outcome: RunOutcome, most: f64) -> RunOutcome;
    /// The same steps without counting or comparing: [`RunOutcome::end`].
    fn replay(&self, method: Method, steps: u64) -> f64;
}

impl Scene {
    /// Runs `steps` steps and compares.
    #[must_use]
    pub fn run(&self, method: Method, steps: u64) -> RunOutcome {
        self.run_within(method, steps, LOST)
    }

    /// As [`Scene::run`], but a run whose error exceeds `most` ends there and counts as diverged.
    #[must_use]
    pub fn run_within(&self, method: Method, steps: u64, most: f64) -> RunOutcome {
        let outcome = RunOutcome::new(steps, self.duration);
        self.run.compare(method, outcome, most)
    }

    /// The same steps without counting or comparing: [`RunOutcome::end`].
    #[must_use]
    pub fn replay(&self, method: Method, steps: u64) -> f64 {
        self.run.replay(method, steps)
    }

    /// The predicted limits of its control, of methods that have one.
    pub(crate) fn predicted_limits(&self) -> impl Iterator<Item = (Method, f64)> {
        let all = Method::ALL.into_iter().zip(self.limits);
        all.filter_map(|(method, limit)| Some((method, limit?)))
    }
}

/// All scenes, in the order in which they are shown.
#[must_use]
pub fn scenes() -> Vec<Scene> {
    let weightless = Arm::new([1.0; 2], [1.0; 2], 0.0).unwrap_or_default();
    let whirling = State {
        position: [0.0, 0.5],
        velocity: [10.0, 0.0],
    };
    vec![
        particle_scene(),
        swing::<2>(
            "swing-2",
            "Free swing, 2 links",
            Arm::default(),
            State::rest(),
        ),
        swing::<3>(
            "swing-3",
            "Free swing, 3 links",
            Arm::default(),
            State::rest(),
        ),
        swing(
            "whirl-2",
            "Whirl at 10 rad/s, no gravity",
            weightless,
            whirling,
        ),
        reach(
            "reach-continuous",
            "PD reach, law in every stage",
            Sampling::Continuous,
        ),
        reach(
            "reach-held",
            "PD reach, effort held for the step",
            Sampling::Held,
        ),
    ]
}

/// Simulated time of an arm's scene \[s\].
const ARM_DURATION: f64 = 2.0;

fn swing<const N: usize>(
    name: &'static str,
    title: &'static str,
    arm: Arm<N>,
    start: State<N>,
) -> Scene {
    let run = ArmRun::new(ControlLoop::free(arm), start, Sampling::Held);
    run.scene((name, title, "none"), "no control")
}

fn reach(name: &'static str, title: &'static str, sampling: Sampling) -> Scene {
    let Gains { kp, kd, .. } = REACH_GAINS;
    let (kind, goal) = (sampling.name(), REACH_SETPOINT.position);
    let law = format!(
        "effort {kind}, kp {kp:?}, kd {kd:?}, to {goal:?} rad, error against the law at every instant"
    );
    let control = ControlLoop::new(Arm::default(), REACH_GAINS, REACH_SETPOINT);
    let linear = Linear::at_setpoint(&control);
    Scene {
        limits: Method::ALL.map(|method| largest_timestep(&linear, method, sampling)),
        ..ArmRun::new(control, State::rest(), sampling).scene((name, title, kind), &law)
    }
}

/// An arm in motion. The steps are those of the live arm, bit for bit, wherever the live arm can take them. The
/// reference is the law at every instant; its integral gains are 0.
struct ArmRun<const N: usize> {
    control: ControlLoop<N>,
    start: State<N>,
    sampling: Sampling,
    reference: ReferencePath<N>,
}

impl<const N: usize> ArmRun<N> {
    fn new(control: ControlLoop<N>, start: State<N>, sampling: Sampling) -> Self {
        let law = Law::Continuous(control.gains, control.setpoint);
        Self {
            control,
            start,
            sampling,
            reference: ReferencePath::new(&control.arm, &start, &law, ARM_DURATION),
        }
    }

    fn scene(
        self,
        (name, title, control): (&'static str, &'static str, &'static str),
        law: &str,
    ) -> Scene {
        let arm = &self.control.arm;
        let State { position, velocity } = self.start;
        let about = format!(
            "{N} links of {:?} m, {:?} kg, gravity {} m/s²; from q = {position:?} rad, q̇ = {velocity:?} rad/s; {law}; \
             {ARM_DURATION} s",
            arm.lengths(),
            arm.masses(),
            arm.gravity(),
        );
        Scene {
            name,
            title,
            about,
            control,
            unit: "rad",
            duration: ARM_DURATION,
            uncertainty: self.reference.uncertainty(),
            most_steps: u64::MAX,
            limits: [None; Method::ALL.len()],
            run: Box::new(self),
        }
    }

    /// The arm before its first step.
    fn ready(&self, method: Method, timestep: f64) -> Box<dyn Steppable<N>> {
        let control = self.control.with_method(method).with_timestep(timestep);
        match self.sampling {
            Sampling::Continuous => Box::new(ContinuousLoop::new(control, self.start, [0.0; N])),
            Sampling::Held => Box::new(control.simulation(self.start)),
        }
    }
}

impl<const N: usize> SceneRun for ArmRun<N> {
    fn compare(&self, method: Method, mut outcome: RunOutcome, most: f64) -> RunOutcome {
        let RunOutcome {
            steps, timestep, ..
        } = outcome;
        let every = steps.div_ceil(MOST_LOOKS).max(1);
        let mut run = self.ready(method, timestep);
        let (mut done, mut is_known) = (0, true);
        while is_known && done < steps {
            let due = every.min(steps - done);
            let taken = run.advance(due);
            done += taken;
            outcome.end = run.state().position.iter().sum();
            is_known = if taken == due {
                let exact = self.reference.after(done, timestep);
                let error = largest_difference(&exact, &run.state().position);
                outcome.take(done, error, most)
            } else {
                outcome.take(done + 1, f64::NAN, most)
            };
        }
        outcome.evaluations = done * u64::from(method.evaluations());
        outcome
    }

    fn replay(&self, method: Method, steps: u64) -> f64 {
        let mut run = self.ready(method, ARM_DURATION / in_f64(steps));
        run.advance(steps);
        run.state().position.iter().sum()
    }
}

/// The 1-DOF service, expression and all, against its closed form with 106 bits: `ẍ = cos 2t`, so `x = x₀ + v₀ t + sin²
/// t / 2`.
struct ParticleRun;

const FUNCTION: &str = "cos(2*t)";
const X0: f64 = 0.5;
const V0: f64 = -0.25;
const DURATION: f64 = 8.0;

impl ParticleRun {
    fn particle(method: Method, steps: u64) -> Option<Particle> {
        let function = Expression::parse(FUNCTION).ok()?;
        Particle::new(function, X0, V0, DURATION / in_f64(steps), steps, method).ok()
    }
}

fn exact(t: f64) -> DoubleDouble {
    let real = DoubleDouble::from;
    let (sin, _) = real(t).sin_cos();
    real(X0) + real(V0) * real(t) + real(0.5) * sin * sin
}

fn particle_scene() -> Scene {
    Scene {
        name: "particle",
        title: "1-DOF service, closed form",
        about: format!("ẍ = {FUNCTION} from x = {X0} m, ẋ = {V0} m/s; {DURATION} s"),
        control: "none",
        unit: "m",
        duration: DURATION,
        // Rounding of a closed form of a few operations at 106 bits.
        uncertainty: 1e-30,
        most_steps: MAX_STEPS,
        limits: [None; Method::ALL.len()],
        run: Box::new(ParticleRun),
    }
}

impl SceneRun for ParticleRun {
    fn compare(&self, method: Method, mut outcome: RunOutcome, most: f64) -> RunOutcome {
        let steps = outcome.steps;
        let every = usize::try_from(steps.div_ceil(MOST_LOOKS)).unwrap_or(1);
        let Some(mut particle) = Self::particle(method, steps) else {
            return outcome;
        };
        let mut is_known = true;
        while is_known && particle.advance(every.max(1)) > 0 {
            let done = particle.done();
            outcome.end = particle.positions().last().copied().unwrap_or(f64::NAN);
            let error = exact(particle.time(done)).minus(outcome.end).abs();
            is_known = outcome.take(done as u64, error, most);
        }
        RunOutcome {
            evaluations: particle.evaluations(),
            ..outcome
        }
    }

    fn replay(&self, method: Method, steps: u64) -> f64 {
        let Some(mut particle) = Self::particle(method, steps) else {
            return f64::NAN;
        };
        particle.advance(usize::MAX);
        particle.positions().last().copied().unwrap_or(f64::NAN)
    }
}
