//! Gains for an arm and a timestep: stable in every pose with a margin, and with a bounded settling time.
//!
//! The default gains are scaled to the arm. A joint's gains scale with the inertia `J` that it moves, and with the
//! speed factor `σ` of the loop: `kp ~ J σ²`, `ki ~ J σ³`, `kd ~ J σ`. The loop's motion is then `σ` times as fast. The
//! inertia of a joint is a mean of two: that of all links beyond it, and the effective inertia while the others are
//! free, which counts if a heavy outer link drags a light inner one. Several weights (`SHAPES`) are tried in turn.
//!
//! A speed factor is accepted if the smallest timestep limit over all poses leaves the margin. The simulated arm,
//! stepped like the live one, must also settle in time in each of [`MOVES`] moves. The result is the smallest accepted
//! factor that is found.
//!
//! **Invariant:** the work is bounded, and returned gains were simulated.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use libm::{cbrt, pow};

use super::control_loop::ControlLoop;
use super::limits;
use super::matrix::largest;
use super::paused::PieceWork;
use crate::math::arm::{Arm, State};
use crate::math::count::in_f64;
use crate::math::dynamics::{forward_dynamics, gravity_load, mass_matrix};
use crate::math::pid::{Gains, INTEGRAL_LIMIT, Setpoint};
use crate::math::shown::{Shown, shown_against};
use crate::math::simulation::Simulation;

/// The largest position error of a settled joint \[rad\].
pub const SETTLED: f64 = 0.02;

/// Moves that are tried: from rest in the starting pose, and from swings, to setpoints within ±2π.
pub const MOVES: u32 = 10;

/// Most steps of one move.
pub const MAX_STEPS: f64 = 1e6;

/// Duration of a move, in settling times: a settled arm must stay settled.
const SETTLING_TIMES: f64 = 1.5;

/// Weights of the effective inertia: for springs and integrals, and for damping.
const SHAPES: [(f64, f64); 6] = [
    (0.0, 0.0),
    (0.5, 0.5),
    (0.25, 0.5),
    (0.5, 0.75),
    (0.0, 0.5),
    (1.0, 1.0),
];

/// A speed factor that fails is multiplied by this.
const FASTER: f64 = 1.25;

/// The first speed factors of a shape, at which springs may be too soft for the margin.
const SOFT_PACES: u32 = 4;

/// Speed factors tried with one shape.
const MAX_PACES: u32 = 24;

/// Initial ratio of the springs' stiffness to the stiffness that gravity removes.
const ABOVE_GRAVITY: f64 = 2.0;

/// Settling time of the default arms with the default gains, with a reserve \[s\].
const DEFAULT_SETTLING: f64 = 3.0;

/// The demands on gains.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GainsRequirements {
    /// Time in which every move must settle \[s\], greater than 0.
    pub settling_time: f64,
    /// Required ratio of the smallest timestep limit over all poses to the timestep, at least 1.
    pub margin: f64,
}

/// Gains that meet the demands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SuggestedGains<const N: usize> {
    /// The gains.
    pub gains: Gains<N>,
    /// A timestep up to which every pose is stable \[s\]; `None` if there is no limit.
    pub limit: Option<f64>,
    /// Whether the smallest limit over all poses is within 1 % of it.
    pub certified: bool,
    /// The longest settling time of the moves \[s\].
    pub settled_after: f64,
}

/// Why there are no gains.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GainsError {
    /// More steps than [`MAX_STEPS`].
    #[error("settling_time / timestep must be at most {MAX_STEPS:e} steps, got {}", shown_against(*.0, MAX_STEPS))]
    TooManySteps(f64),
    /// No gains meet the demands at the timestep \[s\]: slow loops settle too late, and fast loops lack the stability
    /// margin.
    #[error(
        "settling_time: no gains found that settle within {} s and leave a margin of {} at the timestep {} s; allow \
         more time or set a shorter timestep",
        Shown(.0.settling_time), Shown(.0.margin), Shown(*.1)
    )]
    NotFound(GainsRequirements, f64),
    /// The same for motors with a limit, which may be the reason.
    #[error(
        "settling_time: no gains found that settle within {} s under the limits of the effort and leave a margin of {} \
         at the timestep {} s; allow more time, raise limits.effort or set another limits.anti_windup",
        Shown(.0.settling_time), Shown(.0.margin), Shown(*.1)
    )]
    NotFoundUnderLimits(GainsRequirements, f64),
}

/// Searches gains for the arm, method and timestep of `control`, in pieces. Its gains and setpoint are ignored.
///
/// # Errors
/// A settling time of too many steps, or demands that no gains meet.
pub async fn search_gains<const N: usize>(
    mut control: ControlLoop<N>,
    requirements: GainsRequirements,
) -> Result<SuggestedGains<N>, GainsError> {
    let (settling_time, timestep) = (requirements.settling_time, control.timestep);
    let steps = settling_time / timestep;
    if steps > MAX_STEPS {
        return Err(GainsError::TooManySteps(steps));
    }
    control.setpoint = Setpoint::default();
    for shape in SHAPES {
        let mut pace = slowest_pace(&control.arm, shape, settling_time);
        for paces in 0..MAX_PACES {
            control.gains = scaled(&control.arm, shape, pace);
            let limits = limits::search_limits(control).await;
            let limit = limits.bound.or(limits.minimum_held);
            let is_short = limit.is_some_and(|limit| limit < requirements.margin * timestep);
            // The loop is too fast, or its springs hardly hold the load. Some faster loops decide which.
            if is_short && limit > Some(0.0) && paces >= SOFT_PACES {
                break;
            }
            if !is_short && let Some(settled_after) = settle(&control, settling_time).await {
                return Ok(SuggestedGains {
                    gains: control.gains,
                    limit,
                    certified: limits.certified,
                    settled_after,
                });
            }
            pace *= FASTER;
        }
    }
    Err(match control.limits.effort {
        None => GainsError::NotFound(requirements, timestep),
        Some(_) => GainsError::NotFoundUnderLimits(requirements, timestep),
    })
}

/// The default gains, scaled to an arm's inertia and to a speed factor.
fn scaled<const N: usize>(arm: &Arm<N>, (springs, damping): (f64, f64), pace: f64) -> Gains<N> {
    let Gains { kp, ki, kd } = Gains::<N>::default();
    let scaled = |gains: [f64; N], weight: f64, power: i32| {
        let here = inertia(arm, weight);
        let there = inertia(&Arm::<N>::default(), weight);
        std::array::from_fn(|i| gains[i] * here[i] / there[i] * pace.powi(power))
    };
    Gains {
        kp: scaled(kp, springs, 2),
        ki: scaled(ki, springs, 3),
        kd: scaled(kd, damping, 1),
    }
}

/// The first speed factor to try: the larger of two values. With one an arm like the default one settles in time. With
/// the other the springs hold the load and the integrals carry it.
fn slowest_pace<const N: usize>(arm: &Arm<N>, shape: (f64, f64), settling_time: f64) -> f64 {
    let Gains { kp, ki, .. } = scaled(arm, shape, 1.0);
    let load = gravity_load(arm, &[0.0; N]);
    let carries = (0..N).map(|i| {
        let springs = (ABOVE_GRAVITY * load[i].abs() / kp[i]).sqrt();
        let integrals = cbrt(2.0 * load[i].abs() / (INTEGRAL_LIMIT * ki[i]));
        springs.max(integrals)
    });
    largest(carries).max(DEFAULT_SETTLING / settling_time)
}

/// Simulates the moves one by one, since gains that fail usually fail in one of the first moves. Returns the longest
/// settling time \[s\], or `None` as soon as a move does not settle in time.
async fn settle<const N: usize>(control: &ControlLoop<N>, settling_time: f64) -> Option<f64> {
    let (mut slowest, mut piece) = (0.0_f64, PieceWork::default());
    for index in 0..MOVES {
        let mut run = start_of_move(control, index);
        let setpoint = run.pid().setpoint().position;
        // The last time at which a joint was off the setpoint.
        let mut off_at = 0.0;
        while run.time() < SETTLING_TIMES * settling_time {
            piece.spend(control.method.evaluations().into()).await;
            let is_moving = run.step();
            let position = &run.state().position;
            if (0..N).any(|i| (position[i] - setpoint[i]).abs() > SETTLED) {
                off_at = run.time();
            }
            if !is_moving || off_at > settling_time {
                return None;
            }
        }
        slowest = slowest.max(off_at);
    }
    Some(slowest)
}

/// A move at its start. Every other one starts in a swing, as fast as a fall.
fn start_of_move<const N: usize>(control: &ControlLoop<N>, index: u32) -> Simulation<N> {
    // Additive recurrences with irrational steps: evenly spread over all setpoints within ±2π, and reproducible.
    const STEPS: [f64; 3] = [0.754_877_666_2, 0.569_840_290_9, 0.430_159_709_1];
    let part = |i: usize| (0.5 + in_f64(u64::from(index)) * STEPS[i % STEPS.len()]).fract();
    let position = match index {
        0 => std::array::from_fn(|i| if i == 0 { FRAC_PI_2 } else { 0.0 }),
        1 => [TAU; N],
        _ => std::array::from_fn(|i| TAU * (2.0 * part(i) - 1.0)),
    };
    let mut start = State::rest();
    if index % 2 == 1 {
        let falling = (2.0 * control.arm.gravity() / control.arm.reach()).sqrt();
        start = State {
            position: std::array::from_fn(|i| PI * (2.0 * part(i + 1) - 1.0)),
            velocity: std::array::from_fn(|i| 2.0 * falling * (2.0 * part(i + 2) - 1.0)),
        };
    }
    ControlLoop {
        setpoint: Setpoint::at(position),
        ..*control
    }
    .simulation(start)
}

/// The inertia that each joint moves \[kg m²\], with all joints beyond it stretched and the others held. It is averaged
/// geometrically with the smallest effective inertia in any pose while the others are free.
fn inertia<const N: usize>(arm: &Arm<N>, weight: f64) -> [f64; N] {
    let mass = mass_matrix(arm, &[0.0; N]);
    let weightless = arm.weightless();
    let free = |i: usize| {
        let unit = std::array::from_fn(|j| f64::from(u8::from(i == j)));
        let quickest = (0..=4).flat_map(|one| (0..=4).map(move |other| (one, other)));
        let accelerations = quickest.map(|(one, other)| {
            let turned = [0.0, f64::from(one) * PI / 4.0, f64::from(other) * FRAC_PI_2];
            let pose = std::array::from_fn(|j| turned[j % turned.len()]);
            forward_dynamics(&weightless, &pose, &[0.0; N], &unit)[i]
        });
        1.0 / largest(accelerations)
    };
    std::array::from_fn(|i| pow(mass[i.min(N - 1)][i], 1.0 - weight) * pow(free(i), weight))
}
