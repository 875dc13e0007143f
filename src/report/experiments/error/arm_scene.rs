//! An arm in motion: free, under the law in every stage, or under an effort that is held for the step.
//!
//! **Invariant:** the steps are those of the live arm, bit for bit, wherever the live arm can take them (all but the
//! law in every stage).

use super::scene::{RunOutcome, Scene, Worst, looks};
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::{energy, forward_dynamics, kinetic_energy, potential_energy};
use crate::math::integrator::{Method, increment, two_sum};
use crate::math::kinematics::forward;
use crate::math::pid::{Gains, Pid, Setpoint};
use crate::math::simulation::Simulation;
use crate::report::experiments::reference::{DoubleDouble, Law, ReferencePath, largest_difference};
use crate::study::control_loop::ControlLoop;
use crate::study::linear::Linear;
use crate::study::stability::{Sampling, largest_timestep};

/// How the effort of an arm's scene is found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Drive<const N: usize> {
    /// No effort.
    Free,
    /// The law in every stage of every step; its integral gains are 0.
    Continuous(Gains<N>, Setpoint<N>),
    /// As shipped: the law at the start of a step, its effort held for the step. The reference is the continuous law.
    Held(Gains<N>, Setpoint<N>),
}

/// An arm in motion.
#[derive(Debug)]
pub struct ArmScene<const N: usize> {
    name: &'static str,
    title: &'static str,
    arm: Arm<N>,
    start: State<N>,
    drive: Drive<N>,
    duration: f64,
    /// `None` where there is none: of a law that has no motion of its own.
    reference: Option<ReferencePath<N>>,
    energy_scale: f64,
}

impl<const N: usize> ArmScene<N> {
    /// A scene with its reference, which is computed here.
    #[must_use]
    pub fn new(
        name: &'static str,
        title: &'static str,
        arm: Arm<N>,
        start: State<N>,
        drive: Drive<N>,
        duration: f64,
    ) -> Self {
        let law = match drive {
            Drive::Free => Law::FREE,
            Drive::Continuous(gains, setpoint) | Drive::Held(gains, setpoint) => {
                Law::Continuous(gains, setpoint)
            }
        };
        let reference = ReferencePath::new(&arm, &start, &law, duration);
        let energy_scale = energy_scale(&arm, &start);
        Self {
            name,
            title,
            arm,
            start,
            drive,
            duration,
            reference,
            energy_scale,
        }
    }

    /// Takes `steps` steps and shows the state after each, until told to stop; `count` is called at every evaluation.
    fn march(
        &self,
        method: Method,
        steps: u64,
        mut count: impl FnMut(),
        mut show: impl FnMut(u64, &State<N>) -> bool,
    ) {
        let h = self.duration / in_f64(steps);
        let mut state = self.start;
        let mut carry = State::<N>::rest();
        for step in 1..=steps {
            let effort = match &self.drive {
                Drive::Held(gains, setpoint) => {
                    law(gains, setpoint, &state.position, &state.velocity)
                }
                Drive::Free | Drive::Continuous(..) => [0.0; N],
            };
            let acceleration = |_: f64, q: &[f64; N], v: &[f64; N]| {
                count();
                match &self.drive {
                    Drive::Continuous(gains, setpoint) => {
                        forward_dynamics(&self.arm, q, v, &law(gains, setpoint, q, v))
                    }
                    Drive::Free | Drive::Held(..) => forward_dynamics(&self.arm, q, v, &effort),
                }
            };
            let (dq, dv) = increment(
                method,
                acceleration,
                0.0,
                &state.position,
                &state.velocity,
                h,
            );
            add(&mut state.position, &mut carry.position, &dq);
            add(&mut state.velocity, &mut carry.velocity, &dv);
            if !show(step, &state) {
                return;
            }
        }
    }

    fn end_effector_distance(&self, exact: &[DoubleDouble; N], position: &[f64; N]) -> f64 {
        let end_effector = |q| forward(self.arm.lengths(), q).position;
        end_effector(&exact.map(DoubleDouble::to_f64)).distance(end_effector(position))
    }

    /// The control loop that the live arm would have.
    fn live_loop(&self) -> ControlLoop<N> {
        match self.drive {
            Drive::Held(gains, setpoint) => ControlLoop::new(self.arm, gains, setpoint),
            Drive::Free | Drive::Continuous(..) => ControlLoop::free(self.arm),
        }
    }

    /// The live arm's stepper at the start of this scene.
    fn simulation(&self, method: Method, steps: u64) -> Simulation<N> {
        self.live_loop()
            .with_method(method)
            .with_timestep(self.duration / in_f64(steps))
            .simulation(self.start)
    }
}

impl<const N: usize> Scene for ArmScene<N> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn title(&self) -> &'static str {
        self.title
    }

    fn about(&self) -> String {
        let law = match &self.drive {
            Drive::Free => "no control".to_owned(),
            Drive::Continuous(gains, setpoint) => {
                format!("law in every stage, {}", describe(gains, setpoint))
            }
            Drive::Held(gains, setpoint) => {
                format!(
                    "effort held for each step, {}, error against the continuous law",
                    describe(gains, setpoint)
                )
            }
        };
        format!(
            "{N} links of {:?} m, {:?} kg, gravity {} m/s²; from q = {:?} rad, q̇ = {:?} rad/s; {law}; {} s",
            self.arm.lengths(),
            self.arm.masses(),
            self.arm.gravity(),
            self.start.position,
            self.start.velocity,
            self.duration
        )
    }

    fn links(&self) -> usize {
        N
    }

    fn control(&self) -> &'static str {
        match self.drive {
            Drive::Free => "none",
            Drive::Continuous(..) => "continuous",
            Drive::Held(..) => "held",
        }
    }

    fn duration(&self) -> f64 {
        self.duration
    }

    fn uncertainty(&self) -> f64 {
        let reference = self.reference.as_ref();
        reference.map_or(f64::INFINITY, ReferencePath::uncertainty)
    }

    fn run_within(&self, method: Method, steps: u64, most: f64) -> RunOutcome {
        let start_energy = energy(&self.arm, &self.start);
        let timestep = self.duration / in_f64(steps);
        let looks = looks(steps);
        let mut evaluations = 0;
        let mut worst = Worst::within(most);
        let mut drift: f64 = 0.0;
        self.march(
            method,
            steps,
            || evaluations += 1,
            |step, state| {
                if !looks(step) {
                    return true;
                }
                let Some(reference) = &self.reference else {
                    return false;
                };
                let exact = &reference.after(step, timestep);
                drift = drift.max((energy(&self.arm, state) - start_energy).abs());
                worst.take(
                    timestep * in_f64(step),
                    largest_difference(exact, &state.position),
                    self.end_effector_distance(exact, &state.position),
                )
            },
        );
        let conserved = matches!(self.drive, Drive::Free) && worst.diverged.is_none();
        RunOutcome {
            steps,
            timestep,
            evaluations,
            error: worst.error,
            end_error: worst.end_error,
            end_effector_error: worst.end_effector_error,
            energy_drift: conserved.then_some(drift / self.energy_scale),
            diverged: worst.diverged,
        }
    }

    fn replay(&self, method: Method, steps: u64) -> f64 {
        if let Drive::Continuous(..) = self.drive {
            return self.judged_end(method, steps);
        }
        let mut simulation = self.simulation(method, steps);
        simulation.advance(steps);
        simulation.state().position.iter().sum()
    }

    fn predicted_limit(&self, method: Method) -> Option<f64> {
        let (gains, setpoint, sampling) = match &self.drive {
            Drive::Free => return None,
            Drive::Continuous(gains, setpoint) => (gains, setpoint, Sampling::Continuous),
            Drive::Held(gains, setpoint) => (gains, setpoint, Sampling::Held),
        };
        let linear = Linear::at_setpoint(&ControlLoop::new(self.arm, *gains, *setpoint));
        largest_timestep(&linear, method, sampling)
    }

    fn judged_end(&self, method: Method, steps: u64) -> f64 {
        let mut sum = f64::NAN;
        let count = || ();
        self.march(method, steps, count, |step, state| {
            if step == steps {
                sum = state.position.iter().sum();
            }
            true
        });
        sum
    }
}

/// The scale of energies \[J\]: twice the largest potential energy there can be, and the kinetic energy at the start.
/// Never the energy itself, which is 0 for an arm let go from the horizontal.
#[must_use]
pub fn energy_scale<const N: usize>(arm: &Arm<N>, start: &State<N>) -> f64 {
    let mut upright = [0.0; N];
    if let Some(first) = upright.first_mut() {
        *first = std::f64::consts::FRAC_PI_2;
    }
    2.0 * potential_energy(arm, &upright) + kinetic_energy(arm, &start.position, &start.velocity)
}

/// The proportional and derivative part of the law, at any instant.
fn law<const N: usize>(
    gains: &Gains<N>,
    setpoint: &Setpoint<N>,
    q: &[f64; N],
    v: &[f64; N],
) -> [f64; N] {
    let mut pid = Pid::new(*gains);
    pid.set_setpoint(*setpoint);
    let state = State {
        position: *q,
        velocity: *v,
    };
    pid.control(&state, 0.0).effort
}

fn describe<const N: usize>(gains: &Gains<N>, setpoint: &Setpoint<N>) -> String {
    format!(
        "kp {:?}, kd {:?}, to {:?} rad",
        gains.kp, gains.kd, setpoint.position
    )
}

fn add<const N: usize>(value: &mut [f64; N], carry: &mut [f64; N], increment: &[f64; N]) {
    for ((value, carry), increment) in value.iter_mut().zip(carry).zip(increment) {
        (*value, *carry) = two_sum(*value, increment + *carry);
    }
}
