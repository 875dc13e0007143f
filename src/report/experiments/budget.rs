//! Origins of an error: truncation, rounding, and the effort held for a step.
//!
//! `live` are the live arm's steps in doubles, and `exact` the same steps with 106 bits. `plant` is the true motion
//! under the effort that these steps hold, and `law` the true motion under the law at every instant:
//!
//! `live - law = (live - exact) + (exact - plant) + (plant - law)`: rounding, truncation, control hold.
//!
//! **Invariant:** the three parts are differences of motions that are each computed; none is what remains of the
//! others.

use super::error::{REACH_GAINS, REACH_SETPOINT};
use super::reference::{DoubleDouble, Law, ReferenceMotion, exact_steps, largest_difference};
use crate::math::arm::{Arm, State};
use crate::math::count::{in_f64, length_in_f64};
use crate::math::integrator::Method;
use crate::study::control_loop::ControlLoop;

/// Comparisons of a run, and a power of two: after every step, or every second, every fourth...
const MOST_LOOKS: usize = 1024;

/// The parts of an error \[rad\], each the largest over all comparisons and joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parts {
    /// Length of a step \[s\].
    pub timestep: f64,
    /// All of it: against the law at every instant (or the free motion).
    pub total: f64,
    /// The error of the method.
    pub truncation: f64,
    /// The error of doubles.
    pub rounding: f64,
    /// The error of holding the effort for the step; 0 without control.
    pub hold: f64,
}

/// The reach of the study, 2 links, `duration` \[s\] in a number of steps that is a power of two.
#[derive(Debug)]
pub struct Budget {
    arm: Arm<2>,
    start: State<2>,
    duration: f64,
    control: bool,
    law: ReferenceMotion<2>,
}

impl Budget {
    /// The free swing, or with `control` the reach with its effort held for each step.
    #[must_use]
    pub fn new(control: bool, duration: f64) -> Self {
        let law = if control {
            Law::Continuous(REACH_GAINS, REACH_SETPOINT)
        } else {
            Law::FREE
        };
        let (arm, start) = (Arm::default(), State::rest());
        let spacing = duration / length_in_f64(MOST_LOOKS);
        let law = ReferenceMotion::of(&arm, &start, &law, spacing, MOST_LOOKS);
        Self {
            arm,
            start,
            duration,
            control,
            law,
        }
    }

    /// The parts for each of `methods` at one timestep. The motion under the held effort is the same for all of them.
    #[must_use]
    pub fn parts(&self, methods: &[Method], steps: u64) -> Vec<Parts> {
        let timestep = self.duration / in_f64(steps);
        let looks = usize::try_from(steps).map_or(MOST_LOOKS, |steps| steps.clamp(1, MOST_LOOKS));
        let every = steps / looks as u64;
        let truth = || {
            let stride = MOST_LOOKS / looks;
            self.law.samples().iter().skip(stride - 1).step_by(stride)
        };
        let held = Law::Held {
            gains: REACH_GAINS,
            setpoint: REACH_SETPOINT,
            period: timestep,
        };
        let plant = self.control.then(|| {
            let spacing = self.duration / length_in_f64(looks);
            ReferenceMotion::of(&self.arm, &self.start, &held, spacing, looks)
        });
        let law = if self.control { held } else { Law::FREE };
        let plant: Vec<_> = match &plant {
            Some(plant) => plant.samples().iter().collect(),
            None => truth().collect(),
        };
        methods
            .iter()
            .map(|&method| {
                let exact =
                    exact_steps(&self.arm, &self.start, &law, method, timestep, every, looks);
                let live = self.live(method, timestep, every, looks);
                let mut parts = Parts {
                    timestep,
                    total: 0.0,
                    truncation: 0.0,
                    rounding: 0.0,
                    hold: 0.0,
                };
                let samples = truth().zip(&plant).zip(&exact).zip(&live);
                for ((((law, _), (plant, _)), (exact, _)), live) in samples {
                    parts.total = larger(parts.total, largest_difference(law, live));
                    parts.rounding = larger(parts.rounding, largest_difference(exact, live));
                    parts.truncation = larger(parts.truncation, distance(exact, plant));
                    parts.hold = larger(parts.hold, distance(plant, law));
                }
                parts
            })
            .collect()
    }

    fn live(&self, method: Method, timestep: f64, every: u64, looks: usize) -> Vec<[f64; 2]> {
        let control = if self.control {
            ControlLoop::new(self.arm, REACH_GAINS, REACH_SETPOINT)
        } else {
            ControlLoop::free(self.arm)
        };
        let stepped = control.with_method(method).with_timestep(timestep);
        let mut simulation = stepped.simulation(self.start);
        (0..looks)
            .map(|_| {
                let whole = simulation.advance(every) == every;
                let position = simulation.state().position;
                if whole { position } else { [f64::NAN; 2] }
            })
            .collect()
    }
}

fn distance(a: &[DoubleDouble; 2], b: &[DoubleDouble; 2]) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (*a - *b).abs().to_f64())
        .fold(0.0, larger)
}

/// The larger of two, or NaN if the second is.
fn larger(a: f64, b: f64) -> f64 {
    if b <= a { a } else { b }
}
