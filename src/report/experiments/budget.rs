//! Origins of an error: truncation, rounding, and the effort held for a step.
//!
//! `live` are the live arm's steps in doubles, and `exact` the same steps with 106 bits. `plant` is the true motion
//! under the effort that these steps hold, and `law` the true motion under the continuous-time law:
//!
//! `live - law = (live - exact) + (exact - plant) + (plant - law)`: rounding, truncation, control hold.
//!
//! **Invariant:** each of the three parts is a difference of two computed motions; none is the remainder of the others.

use super::error::{REACH_GAINS, REACH_SETPOINT};
use super::reference::{DoubleDouble, Law, ReferenceMotion, exact_steps, largest_difference};
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::study::control_loop::ControlLoop;
use crate::study::matrix::largest;

/// Comparisons of a run, and a power of two: after every step, or every second, every fourth...
const MOST_LOOKS: usize = 1024;

/// The parts of an error \[rad\], each the largest over all comparisons and joints.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Parts {
    /// Length of a step \[s\].
    pub timestep: f64,
    /// The total: against the continuous-time law, or the free motion.
    pub total: f64,
    /// The error of the method.
    pub truncation: f64,
    /// The rounding error of doubles.
    pub rounding: f64,
    /// The error of holding the effort for the step; 0 without control.
    pub hold: f64,
}

/// The reach of the study, 2 links, `duration` \[s\] in a number of steps that is a power of two.
#[derive(Debug)]
pub struct Budget {
    control: ControlLoop<2>,
    duration: f64,
    law: ReferenceMotion<2>,
}

impl Budget {
    /// The free swing, or with `control` the reach with its effort held for each step.
    pub fn new(control: bool, duration: f64) -> Self {
        let control = if control {
            ControlLoop::new(Arm::default(), REACH_GAINS, REACH_SETPOINT)
        } else {
            ControlLoop::free(Arm::default())
        };
        let law = Law::Continuous(control.gains, control.setpoint);
        Self {
            control,
            duration,
            law: ReferenceMotion::new(&control.arm, &State::rest(), &law, duration),
        }
    }

    /// The parts for each of `methods` at one timestep. The motion under the held effort is the same for all of them.
    pub fn parts(&self, methods: &[Method], steps: u64) -> Vec<Parts> {
        let (arm, start) = (&self.control.arm, State::rest());
        let timestep = self.duration / in_f64(steps);
        let looks = usize::try_from(steps).map_or(MOST_LOOKS, |steps| steps.clamp(1, MOST_LOOKS));
        let every = steps / looks as u64;
        let angles = |motion: &ReferenceMotion<2>| -> Vec<[DoubleDouble; 2]> {
            let steps = (1..=looks as u64).map(|look| in_f64(look * every));
            let times = steps.map(|steps| DoubleDouble::from(timestep) * steps);
            times.map(|time| motion.angles(time)).collect()
        };
        let law = angles(&self.law);
        let held = Law::Held {
            gains: self.control.gains,
            setpoint: self.control.setpoint,
            period: timestep,
        };
        let plant = if self.control.is_free() {
            law.clone()
        } else {
            angles(&ReferenceMotion::new(arm, &start, &held, self.duration))
        };
        let parts = |&method| {
            let exact = exact_steps(arm, &start, &held, method, timestep, every, looks);
            let control = self.control.with_method(method).with_timestep(timestep);
            let mut live = control.simulation(start);
            let mut parts = Parts {
                timestep,
                ..Parts::default()
            };
            let raise = |part: &mut f64, error| *part = largest([*part, error].into_iter());
            for ((law, plant), (exact, _)) in law.iter().zip(&plant).zip(&exact) {
                let is_whole = live.advance(every) == every;
                let live = live
                    .state()
                    .position
                    .map(|q| if is_whole { q } else { f64::NAN });
                raise(&mut parts.total, largest_difference(law, &live));
                raise(&mut parts.rounding, largest_difference(exact, &live));
                raise(&mut parts.truncation, largest_difference(exact, plant));
                raise(&mut parts.hold, largest_difference(plant, law));
            }
            parts
        };
        methods.iter().map(parts).collect()
    }
}
