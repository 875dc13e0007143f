//! The largest timestep of a motion, which a linearisation about a pose at rest cannot predict.
//!
//! If a link turns too far within a step, the method adds energy, the arm turns faster still, and the run finally
//! diverges. The onset depends only on the rotation per step, `h Ω`, with Ω the speed of the fastest link.
//! `max_rotation` is the measured limit of each method.
//!
//! | motion | speed Ω assumed |
//! | --- | --- |
//! | of an arm without springs | all energy in one link: `Ω² = 2 (E - U_min) max (M⁻¹)_ii`, arm stretched |
//! | to a setpoint | the joints' peaks `p = F / (√(kp I) + kd)`, and the present kinetic energy in one link; or the former |
//! | the same with even springs | also `max (v_i / l_i)` if that is more than `Σ p` |
//! | the same with uneven springs | the energy of the peaks in one link instead: `√(Σ M_jj p_j² max (M⁻¹)_ii)` |
//!
//! `(M⁻¹)_ii` is the mobility of link i while the others are free, and `I` is the effective inertia of a joint then.
//! `F = kp e + ki s` is the effort that accelerates a joint:
//!
//! - `e` is the distance to the possible rest position: the distance to the setpoint plus the sag of the spring, which
//!   is the largest load over `kp`.
//! - `s = e (√(kp I) + kd) / kp` is the integral accumulated over that distance, [`INTEGRAL_LIMIT`] at most.
//!
//! The peak speed of a single joint released at rest is `e √(kp/I)` without damping and `kp e / kd` with strong
//! damping. In between the error of the formula is at most a tenth.
//!
//! A short link behind a long one is thrown like a whip: with its joint at `v_i`, the sum of `l Σ p` of the links before,
//! it reaches `v_i / l_i`. Springs are uneven if the undamped frequencies of the joints differ by more than a factor of
//! 4. A strong joint then throws the links behind a weak one again and again, up to five times the sum of the peaks.
//!
//! The limits were measured on 2,100 random arms of 2 and 3 links, spun or falling for 4 s. Two in a hundred diverged
//! slightly below these angles, and half of them were stable at 2.5 times as much. On 2,078 moves of up to 25 rad per
//! joint, with all degrees of damping (seeds 0 to 39 and 100 to 139 of `tests/study/motion.rs`), the assumed speed was
//! 0.55 to 4.7 times the true one in 98 of 100, and 0.35 to 11.2 times in all.
//!
//! **Invariant:** pure and cheap, some 3 µs, since it is computed for every published tick.

use std::ops::RangeInclusive;

use super::control_loop::ControlLoop;
use super::equilibrium::hanging;
use crate::math::arm::{Arm, State};
use crate::math::dynamics::{
    forward_dynamics, gravity_load, kinetic_energy, mass_matrix, potential_energy,
};
use crate::math::integrator::Method;
use crate::math::pid::INTEGRAL_LIMIT;

/// Duration of the measurements on a free arm \[s\]. At up to 0.8 of the limit, in 99 of 100 runs, the energy above that
/// of the hanging arm did not double. In 10 of 100 it fell by more than half. Under control, damping bounds the energy.
pub const FREE_SECONDS: f64 = 4.0;

/// Smallest ratio of the joints' undamped frequencies `√(kp/I)` at which no joint is thrown about by another.
const FOLLOWING: f64 = 0.25;

/// The largest rotation of the fastest link in one step \[rad\]. With a larger one the method adds energy to the arm.
const fn max_rotation(method: Method) -> f64 {
    match method {
        Method::Euler => 0.4,
        Method::Midpoint => 0.3,
        Method::Verlet => 0.8,
        Method::Rk4 => 1.25,
    }
}

/// A speed, and the timestep that it allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Assumed speed of the fastest link \[rad/s\]; zero if nothing moves.
    pub speed: f64,
    /// The largest timestep \[s\] of the method at this speed; infinite if nothing moves.
    pub timestep: f64,
}

impl Motion {
    /// The coming motion of an arm in this state, under this loop.
    pub fn ahead<const N: usize>(control: &ControlLoop<N>, state: &State<N>) -> Self {
        let (arm, gains, setpoint) = (&control.arm, &control.gains, &control.setpoint);
        let weightless = arm.weightless();
        // The load of every joint is largest for the arm stretched along the horizontal.
        let load = gravity_load(arm, &[0.0; N]);
        let masses = mass_matrix(arm, &[0.0; N]);
        let (mut peaks, mut energy_of_peaks, mut stored, mut driven) = (0.0, 0.0, 0.0, 0.0);
        let (mut slowest, mut fastest) = (f64::INFINITY, 0.0);
        let (mut tip_speed, mut whip) = (0.0, 0.0);
        for (j, load) in load.iter().enumerate() {
            let (kp, ki, kd) = (gains.kp[j], gains.ki[j], gains.kd[j]);
            let inertia = 1.0 / accelerations(&weightless, j..=j)[j];
            let off = (setpoint.position[j] - state.position[j]).abs();
            let e = off + (load.abs() + kd * setpoint.velocity[j].abs()) / kp;
            let damping = (kp * inertia).sqrt() + kd;
            let frequency = (kp / inertia).sqrt();
            (slowest, fastest) = (f64::min(slowest, frequency), f64::max(fastest, frequency));
            let ki_s = if ki > 0.0 {
                ki * (e * damping / kp).min(INTEGRAL_LIMIT)
            } else {
                0.0
            };
            let p = (kp * e + ki_s) / damping;
            let length = arm.lengths()[j];
            whip = f64::max(whip, tip_speed / length);
            peaks += p;
            tip_speed += length * peaks;
            energy_of_peaks += masses[j][j] * p * p;
            stored += 0.5 * kp * off * off + ki_s * off;
            driven += setpoint.velocity[j].abs();
        }
        let kinetic = kinetic_energy(arm, &state.position, &state.velocity);
        let falling = kinetic + potential_energy(arm, &state.position) - lowest(arm) + stored;
        let mobility = mobility(&weightless);
        let by_energy = driven + (2.0 * falling.max(0.0) * mobility).sqrt();
        let present = (2.0 * kinetic * mobility).sqrt();
        let in_one_link = (energy_of_peaks * mobility).sqrt();
        let is_uneven = slowest < FOLLOWING * fastest;
        let to_setpoint = if is_uneven {
            in_one_link
        } else {
            f64::max(peaks, whip.min(in_one_link))
        };
        let speed = if gains.kp.contains(&0.0) {
            by_energy
        } else {
            by_energy.min(to_setpoint + present)
        };
        let timestep = max_rotation(control.method) / speed;
        if speed > 0.0 && timestep > 0.0 {
            return Self { speed, timestep };
        }
        // An arm with extreme parameters gives NaN, which counts as no limit.
        let (speed, timestep) = (0.0, f64::INFINITY);
        Self { speed, timestep }
    }
}

/// The potential energy of the hanging arm \[J\].
pub(crate) fn lowest<const N: usize>(arm: &Arm<N>) -> f64 {
    potential_energy(arm, &hanging())
}

/// `max (M⁻¹)_ii` in the angles of the links \[1/(kg m²)\]. All joints before link i transmit its effort, and its
/// acceleration is the sum of theirs.
fn mobility<const N: usize>(weightless: &Arm<N>) -> f64 {
    (0..N)
        .map(|i| accelerations(weightless, 0..=i)[..=i].iter().sum())
        .fold(0.0, f64::max)
}

/// Joint accelerations \[rad/s²\] of the stretched arm at rest under an effort of 1 N m at each of `joints`.
fn accelerations<const N: usize>(weightless: &Arm<N>, joints: RangeInclusive<usize>) -> [f64; N] {
    let effort = std::array::from_fn(|j| f64::from(u8::from(joints.contains(&j))));
    forward_dynamics(weightless, &[0.0; N], &[0.0; N], &effort)
}
