//! Rigid-body dynamics of a planar n-link arm of uniform rods.
//!
//! `M(q) q̈ + C(q, q̇) q̇ + G(q) = τ`, angles in rad, counter-clockwise, relative to the previous link; gravity along
//! -y.
//!
//! | symbol | name | shape, unit | function |
//! | --- | --- | --- | --- |
//! | M | mass matrix, symmetric, positive definite | n×n, kg m² | [`mass_matrix`] |
//! | C q̇ | Coriolis and centrifugal effort | n, N m | [`coriolis`] |
//! | G | gravity load, gradient of the potential energy | n, N m | [`gravity_load`] |
//! | q̈ | joint accelerations | n, rad/s² | [`textbook`], [`forward_dynamics`] |
//!
//! [`textbook`] evaluates this equation directly. The arm itself steps with [`forward_dynamics`], a recursion
//! along the links. It needs no matrix and loses up to ten digits less on uneven arms. A test compares the two.
//!
//! In the angles of the links to the horizontal, `φ_i = q_1 + … + q_i` with unit vectors `u_i = (cos φ_i, sin φ_i)`,
//! the Lagrangian is
//!
//! `L = ½ Σ_ij μ_ij l_i l_j (u_i · u_j) φ̇_i φ̇_j - g Σ_i γ_i l_i sin φ_i`
//!
//! where `γ_i = m_i/2 + m_{i+1} + … + m_n`, `μ_ij = γ_max(i,j)` for `i ≠ j`, and `μ_ii = m_i/3 + m_{i+1} + … + m_n`.
//! Since `φ̇_i` is the sum of the first `i` joint rates, the effort about joint `i` is the sum of the efforts about the
//! links `i…n`. So a joint-space term is a sum of this Lagrangian's terms over the outer links.
//!
//! **Invariant:** one derivation holds for every n, without a branch on the number of links. Source:
//! Spong, Hutchinson and Vidyasagar, *Robot Modeling and Control* (2006), ch. 7.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over 0..N of arrays that have N elements, as they do in the formulas"
)]

mod articulated_body;
#[cfg(feature = "batch")]
pub mod batch;
#[cfg(all(feature = "batch", target_arch = "x86_64"))]
mod lane_pairs;
mod one_arm;

#[cfg(feature = "batch")]
pub(super) use articulated_body::recursion;
pub use one_arm::{forward_dynamics, weightless_dynamics};

use super::arm::{Arm, State};
use super::number::Arithmetic;
use super::trig;
use glam::DVec2;

/// Joint accelerations `q̈ = M⁻¹ (τ - C q̇ - G)` \[rad/s²\] at positions `q` \[rad\] and rates `qd` \[rad/s\] under the
/// efforts `tau` \[N m\].
///
/// The result is not finite if rounding makes `M` indefinite, as on very uneven arms.
///
/// ```
/// use pendularm::math::arm::Arm;
/// use pendularm::math::dynamics::{coriolis, gravity_load, mass_matrix, textbook};
///
/// let arm = Arm::<2>::default(); // links of 1 m and 1 kg
/// let (q, qd) = ([0.0, 0.0], [0.0, 0.0]);
/// // Stretched along +x, at rest: M is that of the book, and nothing but gravity acts.
/// let [[m11, m12], [_, m22]] = mass_matrix(&arm, &q);
/// assert!((m11 - 8.0 / 3.0).abs() < 1e-15 && (m12 - 5.0 / 6.0).abs() < 1e-15 && (m22 - 1.0 / 3.0).abs() < 1e-15);
/// assert_eq!(coriolis(&arm, &q, &qd), [0.0, 0.0]);
/// // An effort that carries the gravity load holds the arm still.
/// let tau = gravity_load(&arm, &q);
/// assert_eq!(textbook(&arm, &q, &qd, &tau), [0.0, 0.0]);
/// ```
#[must_use]
pub fn textbook<const N: usize>(
    arm: &Arm<N>,
    q: &[f64; N],
    qd: &[f64; N],
    tau: &[f64; N],
) -> [f64; N] {
    let (m, c, g) = (
        mass_matrix(arm, q),
        coriolis(arm, q, qd),
        gravity_load(arm, q),
    );
    solve(&m, std::array::from_fn(|i| tau[i] - c[i] - g[i]))
}

/// The `x` of `M x = y` for a symmetric positive definite `M`, by Cholesky's `M = L Lᵀ`.
#[must_use]
pub fn solve<const N: usize>(m: &[[f64; N]; N], y: [f64; N]) -> [f64; N] {
    let mut l = [[0.0_f64; N]; N];
    for i in 0..N {
        for j in 0..=i {
            let done: f64 = (0..j).map(|k| l[i][k] * l[j][k]).sum();
            let rest = m[i][j] - done;
            l[i][j] = if i == j { rest.sqrt() } else { rest / l[j][j] };
        }
    }
    let mut x = y;
    for i in 0..N {
        let known: f64 = (0..i).map(|k| l[i][k] * x[k]).sum();
        x[i] = (x[i] - known) / l[i][i];
    }
    for i in (0..N).rev() {
        let known: f64 = (i + 1..N).map(|k| l[k][i] * x[k]).sum();
        x[i] = (x[i] - known) / l[i][i];
    }
    x
}

/// Mass matrix `M(q)` \[kg m²\] at joint positions `q` \[rad\].
#[must_use]
pub fn mass_matrix<const N: usize>(arm: &Arm<N>, q: &[f64; N]) -> [[f64; N]; N] {
    let u = directions(q);
    // Joint i moves the links a >= i, joint j the links b >= j. Only i >= j is summed, so M is exactly symmetric.
    let entry = |i: usize, j: usize| -> f64 {
        let row = |a: usize| {
            (j..N)
                .map(|b| coupling(arm, a, b) * u[a].dot(u[b]))
                .sum::<f64>()
        };
        (i..N).map(row).sum()
    };
    std::array::from_fn(|i| std::array::from_fn(|j| entry(i.max(j), i.min(j))))
}

/// Coriolis and centrifugal effort `C(q, q̇) q̇` \[N m\] at joint positions `q` \[rad\] and rates `qd` \[rad/s\].
#[must_use]
pub fn coriolis<const N: usize>(arm: &Arm<N>, q: &[f64; N], qd: &[f64; N]) -> [f64; N] {
    let u = directions(q);
    let rate = running_sum(qd);
    outer_sum(std::array::from_fn(|i| {
        (0..N)
            .map(|j| coupling(arm, i, j) * u[j].perp_dot(u[i]) * rate[j] * rate[j])
            .sum()
    }))
}

/// Gravity load `G(q)` \[N m\]: the effort that holds the arm still at joint positions `q` \[rad\].
#[must_use]
pub fn gravity_load<const N: usize>(arm: &Arm<N>, q: &[f64; N]) -> [f64; N] {
    let u = directions(q);
    outer_sum(std::array::from_fn(|i| weight_moment(arm, i) * u[i].x))
}

/// The effort `τ` \[N m\] that gives the joint accelerations `qdd` \[rad/s²\] at `q` \[rad\], `qd` \[rad/s\].
#[must_use]
pub fn inverse_dynamics<const N: usize>(
    arm: &Arm<N>,
    q: &[f64; N],
    qd: &[f64; N],
    qdd: &[f64; N],
) -> [f64; N] {
    let u = directions(q);
    let rate = running_sum(qd);
    let acceleration = running_sum(qdd);
    outer_sum(std::array::from_fn(|i| {
        let inertial: f64 = (0..N)
            .map(|j| {
                let turning = u[i].dot(u[j]) * acceleration[j];
                let centripetal = u[j].perp_dot(u[i]) * rate[j] * rate[j];
                coupling(arm, i, j) * (turning + centripetal)
            })
            .sum();
        inertial + weight_moment(arm, i) * u[i].x
    }))
}

/// Kinetic energy \[J\] at joint positions `q` \[rad\] and rates `qd` \[rad/s\]. It is a sum of squares, so it is
/// never negative.
#[must_use]
pub fn kinetic_energy<const N: usize>(arm: &Arm<N>, q: &[f64; N], qd: &[f64; N]) -> f64 {
    let u = directions(q);
    let rate = running_sum(qd);
    let mut joint = DVec2::ZERO;
    let mut energy = 0.0;
    for i in 0..N {
        let half = 0.5 * arm.lengths()[i] * rate[i] * u[i].perp();
        let centre = joint + half;
        // A rod has m v²/2 of the centre of mass, and (m l²/12) φ̇²/2 = m (l φ̇/2)²/6 about it.
        energy += arm.masses()[i] * (0.5 * centre.length_squared() + half.length_squared() / 6.0);
        joint = centre + half;
    }
    energy
}

/// Potential energy \[J\] at joint positions `q` \[rad\], zero with the whole arm along the x axis.
#[must_use]
pub fn potential_energy<const N: usize>(arm: &Arm<N>, q: &[f64; N]) -> f64 {
    let u = directions(q);
    (0..N).map(|i| weight_moment(arm, i) * u[i].y).sum()
}

/// Kinetic plus potential energy \[J\].
#[must_use]
pub fn energy<const N: usize>(arm: &Arm<N>, state: &State<N>) -> f64 {
    kinetic_energy(arm, &state.position, &state.velocity) + potential_energy(arm, &state.position)
}

/// Efforts less those of viscous friction \[N m\]: `τ - b q̇`, at the rates `qd` \[rad/s\].
#[must_use]
#[inline(always)]
pub fn less_friction<T: Arithmetic, const N: usize>(
    viscous: &[T; N],
    qd: &[T; N],
    tau: &[T; N],
) -> [T; N] {
    std::array::from_fn(|i| tau[i] - viscous[i] * qd[i])
}

/// The energy that friction takes in a step of `h` \[s\] from one state to another \[J\]: the integral of `b q̇²`.
///
/// The rate within the step is the parabola with the rates at both ends and the angle turned between. So the error of a
/// step is of the fifth order in `h`, like that of Runge-Kutta 4.
#[must_use]
pub fn friction_loss<const N: usize>(
    arm: &Arm<N>,
    before: &State<N>,
    after: &State<N>,
    h: f64,
) -> f64 {
    let of_joint = |i: usize| {
        let (v0, v1) = (before.velocity[i], after.velocity[i]);
        let mean = (after.position[i] - before.position[i]) / h;
        // The rate is v0 + (v1 - v0) s + bow s (1 - s).
        let bow = 6.0 * mean - 3.0 * (v0 + v1);
        let square = (v0 * v0 + v0 * v1 + v1 * v1) / 3.0 + bow * (v0 + v1) / 6.0 + bow * bow / 30.0;
        arm.viscous()[i] * square * h
    };
    (0..N).map(of_joint).sum()
}

/// `μ_ij l_i l_j` \[kg m²\].
pub(crate) fn coupling<const N: usize>(arm: &Arm<N>, i: usize, j: usize) -> f64 {
    let outer = i.max(j);
    let own = arm.masses()[outer] / if i == j { 3.0 } else { 2.0 };
    (own + arm.rods[outer].beyond) * arm.lengths()[i] * arm.lengths()[j]
}

/// `g γ_i l_i` \[N m\].
pub(crate) fn weight_moment<const N: usize>(arm: &Arm<N>, i: usize) -> f64 {
    arm.gravity() * (0.5 * arm.masses()[i] + arm.rods[i].beyond) * arm.lengths()[i]
}

/// Unit vectors along the links. Rotations are composed joint by joint. A sum of large joint angles would lose
/// digits that their sines and cosines still have.
fn directions<const N: usize>(q: &[f64; N]) -> [DVec2; N] {
    let (sin, cos) = trig::sin_cos(q);
    let mut direction = DVec2::X;
    std::array::from_fn(|i| {
        direction = DVec2::new(cos[i], sin[i]).rotate(direction);
        direction
    })
}

/// Angles, rates or accelerations of the links from those of the joints: `y_i = x_1 + … + x_i`.
pub(crate) fn running_sum<T: Arithmetic + Default, const N: usize>(x: &[T; N]) -> [T; N] {
    let mut sum = T::default();
    x.map(|x| {
        sum = sum + x;
        sum
    })
}

/// Efforts about the joints from those about the links: `y_i = x_i + … + x_n`.
fn outer_sum<const N: usize>(mut x: [f64; N]) -> [f64; N] {
    let mut sum = 0.0;
    for x in x.iter_mut().rev() {
        sum += *x;
        *x = sum;
    }
    x
}
