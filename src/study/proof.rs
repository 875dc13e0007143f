//! A lower bound of the timestep limit: a timestep up to which a loop is stable in every pose, up to rounding. For Euler,
//! and without gravity, it needs no estimate.
//!
//! For a step with held effort, `z x = …` for an eigenvector x with eigenvalue z, put `z = (1 + w h/2) / (1 - w h/2)`:
//! the unit circle becomes the left half plane of `w`. Under a constant effort the arm moves on a parabola, which every
//! method but Euler integrates exactly. The velocity becomes `w x`. The remaining equation is a polynomial with
//! symmetric matrices
//!
//! `P₃ w³ + P₂ w² + P₁ w + P₀`
//!
//! | | midpoint, Verlet, Runge-Kutta 4 | Euler |
//! | --- | --- | --- |
//! | P₃ | `M - h/2 Kd - h²/4 Γ` | `M - h/2 Kd + h²/4 (Kp + Γ) + h³/8 Ki` |
//! | P₂ | `Kd - h/2 Kp - h²/4 Ki` | `Kd - h (Kp + Γ) - h²/4 Ki` |
//! | P₁ | `Kp + Γ` | `Kp + Γ - h/2 Ki` |
//! | P₀ | `Ki` | `Ki` |
//!
//! with `Γ = ∂G/∂q`. Multiplied by x from both sides it is a cubic with real coefficients. By Hurwitz' rule all its
//! roots lie on the left if `P₃, P₂, P₁ > 0` and `P₁ P₂ > P₃ P₀`. This holds for every x, and so for every pose, if the
//! matrices satisfy these inequalities. Only `M` and `Γ` depend on the pose. `Γ` is bounded by its largest entries. The
//! pose in which `P₃` first ceases to be positive is found by branch and bound. Over a box of joint angles `M` is at
//! least its value at the centre minus the largest change of its cosines.
//!
//! Three methods evaluate gravity in several stages. For them the spring term changes by up to `h²/4 Kp M⁻¹ Γ`, which
//! is not symmetric. If `P₃, P₂ > 0`, this is at most `ε Kp` with `ε = h/2 max(kp/kd) max(Γ/kp)`. Every coefficient
//! must have a margin of twice that, and `ε` must be at most 0.01, or there is no bound. With gravity the bound of
//! these methods therefore depends on an estimate of the part that is not symmetric. Without gravity, and for Euler, it
//! needs no estimate.
//!
//! The bound is sharp if damping limits the timestep, as with stiff controllers. With weak damping it is only safe:
//! `P₂` becomes indefinite for one joint before the loop is unstable.
//!
//! Source: Lancaster, *Lambda-Matrices and Vibrating Systems* (1966), ch. 7, on quadratic forms of a pencil; Lawler and
//! Wood, *Branch-and-bound methods* (1966), on the search. Their combination is our own.
//!
//! **Invariant:** in exact arithmetic the bound holds whenever the search ends, under gravity if the estimate holds. The
//! rounding of the inequalities is not bounded; it is far below their distance from the limit. The number of boxes is
//! bounded.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI};

use libm::sincos;

use super::control_loop::ControlLoop;
use super::linear::Linear;
use super::paused::pause;
use super::stability::bisect;
use crate::math::arm::Arm;
use crate::math::dynamics::{coupling, mass_matrix, weight_moment};
use crate::math::integrator::Method;
use crate::math::pid::Gains;

/// Relative distance of the bound from the limit of the worst pose: half of the promised 1 %.
const SHARPNESS: f64 = 0.004;

/// Most boxes that are split in a search for all limits. It then ends with the bound so far, after some 50 ms of one
/// core (optimised build).
pub(super) const MAX_BOXES: u32 = 20_000;

/// Boxes that are split in one piece: half a millisecond (optimised build).
pub(super) const BOXES: u32 = 200;

/// Halvings of the logarithm of a timestep, from an interval of 18 decades to a relative width of 1e-6.
const HALVINGS: u32 = 26;

/// Largest `ε`, the effect of gravity within the stages, for which there is a bound.
const LARGEST_STAGE: f64 = 0.01;

/// A symmetric matrix, row by row.
type Symmetric<const N: usize> = [[f64; N]; N];

/// A bound, and the pose at which it is tightest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Proven<const N: usize> {
    /// Held control is stable in every pose up to this timestep \[s\]; infinite if there is no limit.
    pub(super) timestep: f64,
    /// The pose, first joint at zero.
    pub(super) pose: [f64; N],
}

/// The most memory of a proof, and of every search that contains one, in bytes: its boxes, in a tree whose nodes are at
/// least half full. They are usually fuller, and all other memory is less than this reserve.
pub const fn most_bytes<const N: usize>() -> usize {
    2 * (MAX_BOXES as usize + 2) * size_of::<((u64, u32), Angles<N>)>()
}

/// The bound for held control in every pose, after at most `most` splits of a box; `None` if the proof does not apply.
pub(super) async fn prove<const N: usize>(
    control: &ControlLoop<N>,
    most: u32,
) -> Option<Proven<N>> {
    let mut proof = Proof::new(control)?;
    let mut splits = 0;
    let bound = loop {
        let Some(first) = proof.boxes.first_entry() else {
            break f64::INFINITY;
        };
        let bound = f64::from_bits(first.key().0);
        if splits == most || bound >= (1.0 - SHARPNESS) * proof.least.timestep {
            break bound;
        }
        let angles = first.remove();
        proof.split(angles);
        splits += 1;
        if splits.is_multiple_of(BOXES) {
            pause().await;
        }
    };
    Some(Proven {
        timestep: bound.min(proof.cap),
        pose: proof.least.pose,
    })
}

/// A proof in progress.
struct Proof<const N: usize> {
    arm: Arm<N>,
    gains: Gains<N>,
    is_euler: bool,
    /// The most that gravity adds to a spring's stiffness \[N m/rad\].
    weight: [f64; N],
    /// The largest timestep by the conditions that do not depend on the pose \[s\].
    cap: f64,
    /// The smallest limit of the poses so far \[s\], and its pose.
    least: Proven<N>,
    /// Boxes of joint angles with a bound below the cap, by the bits of the bound \[s\] and by their age. Bits of
    /// positive numbers are ordered like the numbers.
    boxes: BTreeMap<(u64, u32), Angles<N>>,
    found: u32,
}

/// The middle and the half widths of a box of joint angles \[rad\].
type Angles<const N: usize> = [[f64; N]; 2];

impl<const N: usize> Proof<N> {
    /// A proof that has not begun; `None` if it does not apply.
    fn new(control: &ControlLoop<N>) -> Option<Self> {
        let ControlLoop {
            arm, gains, method, ..
        } = control;
        if Linear::is_late(control) || arm.has_friction() {
            return None;
        }
        let mut proof = Self {
            arm: *arm,
            gains: *gains,
            is_euler: *method == Method::Euler,
            weight: heaviest(arm, gains),
            cap: 0.0,
            least: Proven {
                timestep: f64::INFINITY,
                pose: [0.0; N],
            },
            boxes: BTreeMap::new(),
            found: 0,
        };
        proof.cap = proof.largest_for_gains()?;
        let half = std::array::from_fn(|joint| match joint {
            0 => 0.0,
            // The arm is symmetric about the vertical.
            1 => FRAC_PI_2,
            _ => PI,
        });
        let middle = std::array::from_fn(|joint| if joint == 1 { FRAC_PI_2 } else { 0.0 });
        proof.look_at([middle, half]);
        Some(proof)
    }

    /// Halves a box along its widest angle.
    fn split(&mut self, [middle, mut half]: Angles<N>) {
        let widest = (1..N)
            .max_by(|&i, &j| half[i].total_cmp(&half[j]))
            .unwrap_or(0);
        half[widest] *= 0.5;
        for side in [-1.0, 1.0] {
            let mut middle = middle;
            middle[widest] += side * half[widest];
            self.look_at([middle, half]);
        }
    }

    fn look_at(&mut self, angles: Angles<N>) {
        let [middle, half] = &angles;
        let here = self.largest_for_mass(&self.least_mass(middle, &[0.0; N]));
        if here < self.least.timestep {
            self.least = Proven {
                timestep: here,
                pose: *middle,
            };
        }
        let bound = self.largest_for_mass(&self.least_mass(middle, half));
        if bound < self.cap {
            self.boxes.insert((bound.to_bits(), self.found), angles);
            self.found += 1;
        }
    }

    /// A lower bound of the mass matrix over all poses of a box. In link angles the mass matrix is
    /// `μ_ij l_i l_j cos(φ_i - φ_j)`. A smaller cosine changes it by at most `2 y_i y_j ≤ t y_i² + y_j²/t`.
    fn least_mass(&self, middle: &[f64; N], half: &[f64; N]) -> Symmetric<N> {
        let mut links: Symmetric<N> = [[0.0; N]; N];
        for i in 0..N {
            links[i][i] += coupling(&self.arm, i, i);
            let (mut between, mut reach) = (0.0, 0.0);
            for j in i + 1..N {
                between += middle[j];
                reach += half[j];
                let product = coupling(&self.arm, i, j);
                let (sin, cos) = sincos(between);
                links[i][j] = product * cos;
                links[j][i] = links[i][j];
                if reach > 0.0 {
                    let turn: f64 = reach.min(PI);
                    let lost = cos.abs() * (1.0 - sincos(turn).1)
                        + sin.abs() * sincos(turn.min(FRAC_PI_2)).0;
                    let (one, other) = (coupling(&self.arm, i, i), coupling(&self.arm, j, j));
                    let scale = (one / other).sqrt();
                    links[i][i] -= product * lost.min(2.0) * scale;
                    links[j][j] -= product * lost.min(2.0) / scale;
                }
            }
        }
        // A joint moves all links beyond it.
        std::array::from_fn(|i| {
            std::array::from_fn(|j| links[i..].iter().flat_map(|row| &row[j..]).sum())
        })
    }

    /// The largest timestep, up to the cap, at which P₃ is positive with this mass \[s\].
    fn largest_for_mass(&self, mass: &Symmetric<N>) -> f64 {
        largest(self.cap, |h| {
            let mut matrix = *mass;
            for (j, row) in matrix.iter_mut().enumerate() {
                row[j] -= self.taken_from_mass(j, h);
            }
            is_positive(&matrix)
        })
    }

    /// The largest difference between M and P₃ at joint j. It grows with the timestep if P₂ is positive.
    fn taken_from_mass(&self, j: usize, h: f64) -> f64 {
        let Gains { kp, ki, kd } = &self.gains;
        let weight = self.weight[j];
        if self.is_euler {
            0.5 * h * (kd[j] - 0.5 * h * (kp[j] - weight) - 0.25 * h * h * ki[j])
        } else {
            0.5 * h * (kd[j] + 0.5 * h * (weight + 2.0 * self.stage(h) * kp[j]))
        }
    }

    /// Lower bound of P₂ at joint j.
    fn damping(&self, j: usize, h: f64) -> f64 {
        let Gains { kp, ki, kd } = &self.gains;
        if self.is_euler {
            // Three times the integral term, so that P₃ decreases with the timestep.
            kd[j] - h * (kp[j] + self.weight[j]) - 0.75 * h * h * ki[j]
        } else {
            let spring = kp[j] * (1.0 + 2.0 * self.stage(h));
            kd[j] - 0.5 * h * spring - 0.25 * h * h * ki[j]
        }
    }

    /// Lower bound of P₁ at joint j.
    fn spring(&self, j: usize, h: f64) -> f64 {
        let Gains { kp, ki, .. } = &self.gains;
        if self.is_euler {
            kp[j] - self.weight[j] - 0.5 * h * ki[j]
        } else {
            kp[j] * (1.0 - 2.0 * self.stage(h)) - self.weight[j]
        }
    }

    /// ε of methods that evaluate gravity in several stages.
    fn stage(&self, h: f64) -> f64 {
        let Gains { kp, kd, .. } = &self.gains;
        let most = |of: &dyn Fn(usize) -> f64| (0..N).map(of).fold(0.0, f64::max);
        if self.is_euler || self.arm.gravity() == 0.0 {
            0.0
        } else {
            0.5 * h * most(&|j| kp[j] / kd[j]) * most(&|j| self.weight[j] / kp[j])
        }
    }

    /// The largest timestep by the conditions on springs, damping and integrals, in any pose \[s\].
    fn largest_for_gains(&self) -> Option<f64> {
        let Gains { kp, ki, kd } = &self.gains;
        // Springs of zero stiffness give a weight of NaN, which is not less than a gain.
        if !(0..N).all(|j| kp[j] > self.weight[j] && kd[j] > 0.0) {
            return None;
        }
        // P₂ becomes zero before 2 kd/kp.
        let end = (0..N)
            .map(|j| 2.0 * kd[j] / kp[j])
            .fold(f64::INFINITY, f64::min);
        let end = largest(end, |h| {
            self.stage(h) <= LARGEST_STAGE
                && (0..N).all(|j| self.damping(j, h) > 0.0 && self.spring(j, h) > 0.0)
        });
        let cap = if ki.iter().all(|&ki| ki == 0.0) {
            end
        } else {
            self.largest_for_integrals(end)
        };
        (cap > 0.0 && cap.is_finite()).then_some(cap)
    }

    /// The largest timestep up to which `P₁ P₂ > P₃ P₀` holds: for the mass without the damping that the hold takes from
    /// it, so that both sides are monotonic in the timestep.
    fn largest_for_integrals(&self, end: f64) -> f64 {
        let stretched = mass_matrix(&self.arm, &[0.0; N]);
        let mass: [f64; N] = dominating(|i, j| stretched[i][j], |j| stretched[j][j]);
        let Gains { kp, ki, .. } = &self.gains;
        largest(end, |h| {
            let acting = (0..N).filter(|&j| ki[j] > 0.0);
            let pace = acting
                .map(|j| self.spring(j, h) / ki[j])
                .fold(f64::INFINITY, f64::min);
            (0..N).all(|j| {
                // Gravity and the stages may increase P₃ by as much as they may decrease it.
                let weight = self.weight[j] + 2.0 * self.stage(h) * kp[j];
                let spring = if self.is_euler {
                    kp[j] + 0.5 * h * ki[j]
                } else {
                    0.0
                };
                pace * self.damping(j, h) > mass[j] + 0.25 * h * h * (weight + spring)
            })
        })
    }
}

/// Whether every eigenvalue is positive: all pivots of an elimination are positive.
fn is_positive<const N: usize>(matrix: &Symmetric<N>) -> bool {
    let mut a = *matrix;
    (0..N).all(|k| {
        let pivot = a[k];
        for row in a.iter_mut().skip(k + 1) {
            let factor = row[k] / pivot[k];
            for (entry, above) in row.iter_mut().zip(pivot).skip(k + 1) {
                *entry -= factor * above;
            }
        }
        // This is false for NaN too.
        pivot[k] > 0.0 && pivot[k].is_finite()
    })
}

/// The largest timestep up to `end` for which `holds` is true. It must be true up to some timestep and false beyond.
fn largest(end: f64, holds: impl Fn(f64) -> bool) -> f64 {
    let tiny = 1e-18 * end;
    if holds(end) {
        end
    } else if holds(tiny) {
        bisect((tiny, end), HALVINGS, holds)
    } else {
        0.0
    }
}

/// A diagonal matrix D with -D ≤ A ≤ D for every symmetric A whose entries are no larger than these. It follows from
/// `2 y_i y_j ≤ t y_i² + y_j²/t`, with t from the sizes of the joints.
fn dominating<const N: usize>(
    entry: impl Fn(usize, usize) -> f64,
    size: impl Fn(usize) -> f64,
) -> [f64; N] {
    std::array::from_fn(|i| {
        (0..N)
            .map(|j| entry(i, j) * (size(i) / size(j)).sqrt())
            .sum()
    })
}

/// The most by which gravity changes each spring's stiffness. Entry (i, j) of Γ is the load of joint `max(i, j)` of the
/// turned arm.
fn heaviest<const N: usize>(arm: &Arm<N>, gains: &Gains<N>) -> [f64; N] {
    let load = |j: usize| (j..N).map(|i| weight_moment(arm, i)).sum::<f64>();
    dominating(|i, j| load(i.max(j)), |j| gains.kp[j])
}
