//! `pendularm score`: recomputes an episode of the Python environments from its submission, bit for bit.
//!
//! A submission has the actions of an episode, or the name of a policy, and a hash after each step. The hash is a chain
//! over the bits of actions, states and rewards, so a changed bit changes it from its step on.
//!
//! **Invariant:** the same operations as in `python/package/pendularm/_tasks.py`, in the same order.

#![allow(
    clippy::indexing_slicing,
    reason = "every index comes from `array::from_fn` over arrays of the same constant length"
)]

use std::array::from_fn;
use std::f64::consts::PI;
use std::ops::Range;

use serde::Deserialize;

use crate::math::arm::{Arm, State};
use crate::math::dynamics::gravity_load;
use crate::math::kinematics::forward;
use crate::math::limits::Limits;
use crate::math::pid::Gains;
use crate::math::simulation::Simulation;

/// Most bytes of a submission. The longest episode has some 80,000.
pub const MOST_BYTES: u64 = 1 << 20;
/// Simulation time of a step of an environment \[s\], and its timesteps.
const STEP: (f64, u64) = (0.05, 10);
/// Joint rate at which an arm counts as lost \[rad/s\].
const FASTEST: f64 = 25.0;

/// An episode, as in its file. Doubles are 16 hexadecimal digits of their bits.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Submission {
    version: String,
    task: String,
    seed: u32,
    actions: Actions,
    trail: Vec<String>,
    score: String,
}

/// One row per step, with a number per motor, or the name of a policy.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Actions {
    Policy(String),
    Rows(Vec<Vec<String>>),
}

/// An episode that agrees with its submission.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// Task, seed, number of steps, score and verdict.
    pub words: String,
    /// Joint angles \[rad\] at the start and after each step.
    pub poses: Vec<[f64; 2]>,
    /// The target of the end effector \[m\], if the task has one.
    pub target: Option<[f64; 2]>,
}

/// Recomputes the episode of a submission, and returns its score, the sum of the rewards, in a sentence.
///
/// # Errors
/// The reason for a refusal, such as the first step at which the submission differs. Step 0 is the start.
pub fn score(submission: &[u8]) -> Result<String, String> {
    replay(submission).map(|replay| replay.words)
}

/// The same with the motion.
///
/// # Errors
/// As [`score`].
pub fn replay(submission: &[u8]) -> Result<Replay, String> {
    let given: Submission =
        serde_json::from_slice(submission).map_err(|why| format!("not a submission: {why}"))?;
    let (version, task, seed) = (given.version, given.task, given.seed);
    if version != env!("CARGO_PKG_VERSION") {
        return Err(format!("made by another version, {version:?}"));
    }
    let (mut episode, most) = match task.as_str() {
        "Pendularm-v0" => (Episode::swing_up(seed, 0.5, 0..2), 200),
        "PendularmAcrobot-v0" => (Episode::swing_up(seed, 4.0, 1..2), 2000),
        "PendularmPendubot-v0" => (Episode::swing_up(seed, 1.0, 0..1), 2000),
        "PendularmReach-v0" => (Episode::reach(seed), 100),
        _ => return Err(format!("no task {task:?}")),
    };
    let (rows, push) = match given.actions {
        Actions::Rows(rows) => (Some(rows), 0.0),
        Actions::Policy(name) if name == "rest" => (None, 0.0),
        Actions::Policy(name) if name == "pump" => (None, 1.0),
        Actions::Policy(name) => return Err(format!("no policy {name:?}")),
    };
    let last = rows.as_ref().map_or(most, Vec::len);
    if last > most {
        return Err(format!("more than {most} actions"));
    }
    let motors = episode.driven.len();
    if rows.iter().flatten().any(|row| row.len() != motors) {
        return Err(format!(
            "not a submission: each action must have {motors} numbers"
        ));
    }
    let (mut steps, mut score) = (0, 0.0_f64);
    let mut poses = vec![episode.arm.state().position];
    while given.trail.get(steps) == Some(&digits(episode.hash)) {
        if steps == last || episode.is_lost() {
            let is_whole = given.trail.len() == steps + 1 && given.score == digits(score.to_bits());
            if is_whole && rows.is_none_or(|rows| rows.len() == steps) {
                return Ok(Replay {
                    words: format!(
                        "{task}, seed {seed}, {steps} steps, score {score:?}: confirmed"
                    ),
                    poses,
                    target: episode.target,
                });
            }
            break;
        }
        let action = match rows.as_ref().and_then(|rows| rows.get(steps)) {
            Some(row) => row
                .iter()
                .map(|text| number(text))
                .collect::<Result<Vec<_>, _>>()?,
            None => episode.arm.state().velocity[episode.driven.clone()]
                .iter()
                .map(|&rate| if rate >= 0.0 { push } else { -push })
                .collect(),
        };
        score += episode.step(&action);
        poses.push(episode.arm.state().position);
        steps += 1;
    }
    Err(format!(
        "{task}, seed {seed}: refused, departs at step {steps}"
    ))
}

fn digits(bits: u64) -> String {
    format!("{bits:016x}")
}

/// The finite double of 16 hexadecimal digits.
fn number(text: &str) -> Result<f64, String> {
    let bits = u64::from_str_radix(text, 16)
        .ok()
        .filter(|&bits| digits(bits) == text);
    let number = bits.map(f64::from_bits).filter(|number| number.is_finite());
    number.ok_or_else(|| {
        format!("an action must be 16 hexadecimal digits of a finite double, got {text:?}")
    })
}

/// A running episode.
struct Episode {
    arm: Simulation<2>,
    /// The target of the end effector \[m\], if the task has one.
    target: Option<[f64; 2]>,
    /// The joints with a motor.
    driven: Range<usize>,
    /// Efforts of an action of 1, if each joint has a motor \[N m\].
    efforts: [f64; 2],
    hash: u64,
}

impl Episode {
    /// An action of 1 is `strength` of the effort that holds the stretched arm, at the `driven` joints.
    fn swing_up(seed: u32, strength: f64, driven: Range<usize>) -> Self {
        let mut random = Random::new(seed);
        let mut off = || from_fn(|_| -0.1 + 0.2 * random.uniform());
        let (mut position, velocity): ([f64; 2], _) = (off(), off());
        position[0] -= PI / 2.0;
        Self::begin(State { position, velocity }, strength, driven, None)
    }

    fn reach(seed: u32) -> Self {
        let mut random = Random::new(seed);
        let distance = 0.95 * Arm::<2>::default().reach() * random.uniform().sqrt();
        let bearing = forward(&[1.0; 2], &[2.0 * PI * random.uniform(), 0.0]).position;
        let target = bearing.to_array().map(|part| distance * (0.5 * part));
        let mut state = State::rest();
        state.position = from_fn(|_| PI * (2.0 * random.uniform() - 1.0));
        Self::begin(state, 2.0, 0..2, Some(target))
    }

    fn begin(
        state: State<2>,
        strength: f64,
        driven: Range<usize>,
        target: Option<[f64; 2]>,
    ) -> Self {
        let mut arm = Simulation::new(Arm::default(), Gains::default());
        arm.set_timestep(STEP.0 / 10.0);
        arm.set_state(state);
        let efforts = gravity_load(arm.arm(), &[0.0; 2]).map(|load| strength * load);
        if driven.len() < 2 {
            arm.set_limits(Limits {
                effort: Some(from_fn(
                    |i| if driven.contains(&i) { efforts[i] } else { 0.0 },
                )),
                ..Limits::default()
            });
        }
        let mut episode = Self {
            arm,
            target,
            driven,
            efforts,
            hash: 0xcbf2_9ce4_8422_2325,
        };
        episode.chain(target.as_ref().map_or(&[], |target| target.as_slice()));
        episode.chain_state();
        episode
    }

    /// Takes a step, and returns its reward.
    fn step(&mut self, action: &[f64]) -> f64 {
        let mut effort = [0.0; 2];
        for (joint, action) in self.driven.clone().zip(action) {
            effort[joint] = action.clamp(-1.0, 1.0) * self.efforts[joint];
        }
        if self.driven.len() < 2 {
            self.arm.drive(Some(effort));
        } else {
            self.arm.disturb(effort, STEP.0);
        }
        self.arm.advance(STEP.1);
        let arm = self.arm.arm();
        let (reach, tip) = (
            arm.reach(),
            forward(arm.lengths(), &self.arm.state().position).position,
        );
        let reward = self.target.map_or(0.5 + 0.5 * tip.y / reach, |target| {
            let away = [target[0] - tip.x, target[1] - tip.y];
            1.0 - (away[0] * away[0] + away[1] * away[1]).sqrt() / (2.0 * reach)
        });
        self.chain(action);
        self.chain_state();
        self.chain(&[reward]);
        reward
    }

    fn is_lost(&self) -> bool {
        let is_fast = |rate: &f64| rate.abs() > FASTEST;
        self.arm.divergence().is_some() || self.arm.state().velocity.iter().any(is_fast)
    }

    fn chain_state(&mut self) {
        let State { position, velocity } = *self.arm.state();
        self.chain(&position);
        self.chain(&velocity);
    }

    /// FNV-1a by words. Each factor is odd, so no later word hides a changed one.
    fn chain(&mut self, numbers: &[f64]) {
        for number in numbers {
            self.hash = (self.hash ^ number.to_bits()).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

/// The generator PCG64 of `NumPy` (O'Neill, 2014), seeded by its `SeedSequence`.
struct Random {
    state: u128,
    increment: u128,
}

impl Random {
    fn new(seed: u32) -> Self {
        let hashed = |mut value: u32, constant: &mut u32, factor: u32| {
            value ^= *constant;
            *constant = constant.wrapping_mul(factor);
            value = value.wrapping_mul(*constant);
            value ^ (value >> 16)
        };
        let mut constant = 0x43b0_d7e5;
        let mut pool = [seed, 0, 0, 0].map(|word| hashed(word, &mut constant, 0x931e_8875));
        for from in 0..4 {
            for to in (0..4).filter(|&to| to != from) {
                let word = hashed(pool[from], &mut constant, 0x931e_8875);
                let mixed = pool[to]
                    .wrapping_mul(0xca01_f9dd)
                    .wrapping_sub(word.wrapping_mul(0x4973_f715));
                pool[to] = mixed ^ (mixed >> 16);
            }
        }
        let mut constant = 0x8b51_f9dd;
        let words: [u128; 8] =
            from_fn(|i| u128::from(hashed(pool[i % 4], &mut constant, 0x58f3_8ded)));
        let whole = |at: usize| {
            (words[at + 1] << 96) | (words[at] << 64) | (words[at + 3] << 32) | words[at + 2]
        };
        let mut random = Self {
            state: 0,
            increment: (whole(4) << 1) | 1,
        };
        random.advance();
        random.state = random.state.wrapping_add(whole(0));
        random.advance();
        random
    }

    fn advance(&mut self) {
        let product = self
            .state
            .wrapping_mul(0x2360_ed05_1fc6_5da4_4385_df64_9fcc_f645);
        self.state = product.wrapping_add(self.increment);
    }

    /// At least 0 and less than 1.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_precision_loss,
        reason = "halves, and 53 bits"
    )]
    fn uniform(&mut self) -> f64 {
        self.advance();
        let halves = (self.state >> 64) as u64 ^ self.state as u64;
        let word = halves.rotate_right((self.state >> 122) as u32);
        (word >> 11) as f64 * (1.0 / 9_007_199_254_740_992.0)
    }
}
