//! Error against cost: the same scenes for every method, each against one reference.
//!
//! A [`Scene`] is a [`Task`] of an arm, in words.
//!
//! **Invariant:** the steps are those of the live arm, bit for bit, wherever the live arm can take them.

use super::reference::{Law, ReferenceMotion};
use super::solvers;
use super::task::Task;
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::math::pid::{Gains, Setpoint};
use crate::study::control_loop::ControlLoop;
use crate::study::linear::Linear;
use crate::study::matrix::largest;
use crate::study::stability::{Sampling, largest_timestep};

/// Steps of the coarsest run of a row: a power of two, so that the timesteps of a duration that is one too are exact.
pub const OUTPUTS: u64 = 64;

/// Comparisons per run: about one per millisecond in two seconds, so no peak of the error is missed.
const LOOKS: u64 = 2048;

/// Gains of the reach: low enough that the stability limit is at tens of milliseconds.
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

/// A motion that every method computes.
pub struct Scene {
    /// Short name, as files and tables use it.
    pub name: &'static str,
    /// The scene in words, for a heading.
    pub title: &'static str,
    /// Whether an effort is held for each step.
    pub is_held: bool,
    /// The largest stable timestep \[s\] of each method that has one, as predicted for the control at its setpoint.
    pub(crate) limits: Vec<(Method, f64)>,
    /// The motion.
    pub task: Task,
}

/// All scenes, in the order in which they are shown.
pub fn scenes() -> Vec<Scene> {
    let weightless = Arm::new([1.0; 2], [1.0; 2], 0.0).unwrap_or_default();
    let whirling = State {
        position: [0.0, 0.5],
        velocity: [10.0, 0.0],
    };
    vec![
        free_swing(),
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

/// The free swing of 2 links.
pub fn free_swing() -> Scene {
    let (arm, start) = (Arm::<2>::default(), State::rest());
    swing("swing-2", "Free swing, 2 links", arm, start)
}

fn swing<const N: usize>(
    name: &'static str,
    title: &'static str,
    arm: Arm<N>,
    start: State<N>,
) -> Scene {
    let control = ControlLoop::free(arm);
    arm_scene((name, title), control, start, Sampling::Held)
}

fn reach(name: &'static str, title: &'static str, sampling: Sampling) -> Scene {
    let control = ControlLoop::new(Arm::default(), REACH_GAINS, REACH_SETPOINT);
    let linear = Linear::at_setpoint(&control);
    let limit = |method| Some((method, largest_timestep(&linear, method, sampling)?));
    Scene {
        limits: Method::ALL.into_iter().filter_map(limit).collect(),
        ..arm_scene((name, title), control, State::rest(), sampling)
    }
}

/// An arm in motion. Its reference has a continuous-time law with integral gains of 0.
fn arm_scene<const N: usize>(
    (name, title): (&'static str, &'static str),
    control: ControlLoop<N>,
    start: State<N>,
    sampling: Sampling,
) -> Scene {
    let ready = match sampling {
        Sampling::Continuous => solvers::ready::<N>,
        Sampling::Held => solvers::ready_as_live,
    };
    let law = Law::Continuous(control.gains, control.setpoint);
    let reference = ReferenceMotion::new(&control.arm, &start, &law, ARM_DURATION);
    let times = (1..=OUTPUTS).map(|index| ARM_DURATION * in_f64(index) / in_f64(OUTPUTS));
    Scene {
        name,
        title,
        is_held: sampling == Sampling::Held && !control.is_free(),
        limits: Vec::new(),
        task: Task {
            duration: ARM_DURATION,
            uncertainty: largest(times.map(|time| reference.uncertainty(time))),
            looks: LOOKS,
            unit: 1,
            ready: Box::new(move |solver, steps| {
                ready(&control, start, ARM_DURATION, solver, steps)
            }),
            distance: Box::new(move |time, angles| reference.angle_error(time, angles)),
        },
    }
}
