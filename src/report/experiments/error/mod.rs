//! Error against cost: the same scenes for every method, each against one reference.
//!
//! A [`Scene`] is an arm (or the particle of `/arm_sim/integration_step`), a start, a control law and a duration. A run
//! takes any number of equal steps. Its error is the largest, over joints and over its steps (or [`MOST_LOOKS`] or so
//! of them), of the angles' distances to the reference, which is known at any instant. Cost is counted in evaluations
//! of the dynamics here. For seconds, time [`Scene::replay`], which takes the same steps and does no more.
//!
//! **Invariant:** nothing is chosen per method: same starts, same timesteps, same reference, same measure.

mod arm_scene;
mod particle_scene;
mod scene;

pub use arm_scene::{ArmScene, Drive, energy_scale};
pub use particle_scene::ParticleScene;
pub use scene::{LOST, MOST_LOOKS, OUTPUTS, RunOutcome, Scene};

use crate::math::arm::{Arm, State};
use crate::math::pid::{Gains, Setpoint};

/// All scenes, in the order in which they are shown.
#[must_use]
pub fn scenes() -> Vec<Box<dyn Scene>> {
    let reach =
        |name, title, law| ArmScene::new(name, title, Arm::<2>::default(), State::rest(), law, 2.0);
    let whirling = Arm::new([1.0; 2], [1.0; 2], 0.0).unwrap_or_default();
    vec![
        Box::new(ParticleScene),
        Box::new(ArmScene::new(
            "swing-2",
            "Free swing, 2 links",
            Arm::<2>::default(),
            State::rest(),
            Drive::Free,
            2.0,
        )),
        Box::new(ArmScene::new(
            "swing-3",
            "Free swing, 3 links",
            Arm::<3>::default(),
            State::rest(),
            Drive::Free,
            2.0,
        )),
        Box::new(ArmScene::new(
            "whirl-2",
            "Whirl at 10 rad/s, no gravity",
            whirling,
            State {
                position: [0.0, 0.5],
                velocity: [10.0, 0.0],
            },
            Drive::Free,
            2.0,
        )),
        Box::new(reach(
            "reach-continuous",
            "PD reach, law in every stage",
            Drive::Continuous(REACH_GAINS, REACH_SETPOINT),
        )),
        Box::new(reach(
            "reach-held",
            "PD reach, effort held for the step",
            Drive::Held(REACH_GAINS, REACH_SETPOINT),
        )),
    ]
}

/// Gains of the reach: soft enough that timesteps of tens of milliseconds are on both sides of the stability edge.
pub const REACH_GAINS: Gains<2> = Gains {
    kp: [200.0, 100.0],
    ki: [0.0; 2],
    kd: [30.0, 12.0],
};

/// The reach in words.
pub const REACH: &str = "a reach of 2 links to (0.8, -0.6) with kp 200, 100 and kd 30, 12";

/// Target of the reach, from the starting pose.
pub const REACH_SETPOINT: Setpoint<2> = Setpoint {
    position: [0.8, -0.6],
    velocity: [0.0; 2],
};
