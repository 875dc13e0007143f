//! The physical model of the arm: a planar chain of uniform rods on revolute joints, and its state.
//!
//! Link `i` is a thin uniform rod: centre of mass at `l_i / 2`, inertia `m_i l_i² / 12` about it. Joint angles are
//! relative to the previous link (the first to +x), counter-clockwise, and gravity pulls along -y. All arithmetic is
//! floating-point.
//!
//! **Invariant:** an [`Arm`] that exists is valid: lengths and masses finite and positive, gravity finite and not
//! negative. Constants that depend on parameters alone are computed here, once.

use thiserror::Error;

use super::shown::Shown;

/// Parameters of an arm with `N` links, at least one, and the constants that the dynamics derive from them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arm<const N: usize> {
    lengths: [f64; N],
    masses: [f64; N],
    pub(super) gravity: f64,
    pub(super) rods: [Rod; N],
    /// Viscous friction of each joint \[N m s/rad\].
    pub(super) viscous: [f64; N],
}

/// The constants of one link that the dynamics need, for one arm or for several side by side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rod<T = f64> {
    /// Length \[m\].
    pub(super) length: T,
    /// Mass of all links beyond this one \[kg\].
    pub(super) beyond: T,
    /// Mass divided by the mass of the previous link; 0 for the first link.
    pub(super) mass_ratio: T,
    /// `1 / l` \[1/m\].
    pub(super) per_length: T,
    /// `1 / (m l)` \[1/(kg m)\]; converts an effort to an acceleration.
    pub(super) per_mass_length: T,
}

/// A parameter that no arm can have.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ArmError {
    /// A length or a mass is NaN or infinite.
    #[error("{field}[{index}] must be finite, got {}", Shown(*.value))]
    NotFinite {
        /// `lengths` or `masses`.
        field: &'static str,
        /// Link, from 0.
        index: usize,
        /// The value given.
        value: f64,
    },
    /// A length or a mass is zero or negative.
    #[error("{field}[{index}] must be greater than 0, got {}", Shown(*.value))]
    NotPositive {
        /// `lengths` or `masses`.
        field: &'static str,
        /// Link, from 0.
        index: usize,
        /// The value given.
        value: f64,
    },
    /// A coefficient of friction is NaN, infinite or negative.
    #[error("viscous[{index}] must be finite and at least 0, got {}", Shown(*.value))]
    Friction {
        /// Joint, from 0.
        index: usize,
        /// The value given \[N m s/rad\].
        value: f64,
    },
    /// Gravity is NaN or infinite.
    #[error("gravity must be finite, got {}", Shown(*.value))]
    GravityNotFinite {
        /// The value given \[m/s²\].
        value: f64,
    },
    /// Gravity is negative.
    #[error("gravity must be at least 0, got {}", Shown(*.value))]
    GravityNegative {
        /// The value given \[m/s²\].
        value: f64,
    },
}

impl<const N: usize> Arm<N> {
    /// An arm with the given link lengths \[m\], link masses \[kg\] and gravity along -y \[m/s²\].
    ///
    /// # Errors
    /// The first length or mass that is not finite and greater than 0, or a gravity that is not finite and at least 0.
    pub fn new(lengths: [f64; N], masses: [f64; N], gravity: f64) -> Result<Self, ArmError> {
        check_positive("lengths", &lengths)?;
        check_positive("masses", &masses)?;
        if !gravity.is_finite() {
            return Err(ArmError::GravityNotFinite { value: gravity });
        }
        if gravity < 0.0 {
            return Err(ArmError::GravityNegative { value: gravity });
        }
        Ok(Self::valid(lengths, masses, gravity))
    }

    /// The same arm without gravity.
    #[must_use]
    pub fn weightless(&self) -> Self {
        Self {
            viscous: self.viscous,
            ..Self::valid(self.lengths, self.masses, 0.0)
        }
    }

    /// The same arm with viscous friction at its joints \[N m s/rad\]: the effort `-viscous velocity`. Stiction and
    /// backlash are left out, because both switch within a step, so no method would have its order.
    ///
    /// # Errors
    /// The first coefficient that is not finite and at least 0.
    pub fn with_friction(self, viscous: [f64; N]) -> Result<Self, ArmError> {
        let wrong = |value: &f64| !(value.is_finite() && *value >= 0.0);
        match viscous.iter().position(wrong) {
            Some(index) => Err(ArmError::Friction {
                index,
                value: viscous.get(index).copied().unwrap_or(f64::NAN),
            }),
            // `-0.0` is not negative, but would be shown as if it were.
            None => Ok(Self {
                viscous: viscous.map(f64::abs),
                ..self
            }),
        }
    }

    /// Viscous friction of each joint \[N m s/rad\].
    #[must_use]
    pub const fn viscous(&self) -> &[f64; N] {
        &self.viscous
    }

    /// Whether a joint has friction.
    #[must_use]
    #[inline]
    pub fn has_friction(&self) -> bool {
        self.viscous.iter().any(|&one| one > 0.0)
    }

    fn valid(lengths: [f64; N], masses: [f64; N], gravity: f64) -> Self {
        const { assert!(N > 0, "an arm has at least one link") };
        let mut rods = lengths.map(|length| Rod {
            length,
            beyond: 0.0,
            mass_ratio: 0.0,
            per_length: 1.0 / length,
            per_mass_length: 0.0,
        });
        let mut previous = f64::INFINITY;
        for (rod, mass) in rods.iter_mut().zip(&masses) {
            rod.mass_ratio = mass / previous;
            rod.per_mass_length = 1.0 / (mass * rod.length);
            previous = *mass;
        }
        let mut beyond = 0.0;
        for (rod, mass) in rods.iter_mut().zip(&masses).rev() {
            rod.beyond = beyond;
            beyond += mass;
        }
        // `-0.0` is not negative, but would be shown as if it were.
        Self {
            lengths,
            masses,
            gravity: gravity.abs(),
            rods,
            viscous: [0.0; N],
        }
    }

    /// Link lengths \[m\].
    #[must_use]
    pub const fn lengths(&self) -> &[f64; N] {
        &self.lengths
    }

    /// Link masses \[kg\].
    #[must_use]
    pub const fn masses(&self) -> &[f64; N] {
        &self.masses
    }

    /// Gravity along -y \[m/s²\].
    #[must_use]
    pub const fn gravity(&self) -> f64 {
        self.gravity
    }

    /// Distance from the base to the end effector of the stretched arm \[m\].
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.lengths.iter().sum()
    }
}

/// Every link 1 m and 1 kg, gravity 9.81 m/s².
impl<const N: usize> Default for Arm<N> {
    fn default() -> Self {
        Self::valid([1.0; N], [1.0; N], 9.81)
    }
}

fn check_positive(field: &'static str, values: &[f64]) -> Result<(), ArmError> {
    for (index, &value) in values.iter().enumerate() {
        if !value.is_finite() {
            return Err(ArmError::NotFinite {
                field,
                index,
                value,
            });
        }
        if value <= 0.0 {
            return Err(ArmError::NotPositive {
                field,
                index,
                value,
            });
        }
    }
    Ok(())
}

/// Positions and velocities of the joints, for one arm or for several side by side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<const N: usize, T = f64> {
    /// Joint angles \[rad\], never wrapped.
    pub position: [T; N],
    /// Joint rates \[rad/s\].
    pub velocity: [T; N],
}

impl<const N: usize> State<N> {
    /// The starting pose: stretched along +x, at rest.
    #[must_use]
    pub const fn rest() -> Self {
        Self {
            position: [0.0; N],
            velocity: [0.0; N],
        }
    }

    /// At rest in a pose \[rad\].
    #[must_use]
    pub const fn at_rest(position: [f64; N]) -> Self {
        Self {
            position,
            velocity: [0.0; N],
        }
    }

    /// The state after a step with these increments.
    #[must_use]
    #[inline(always)]
    #[allow(
        clippy::indexing_slicing,
        reason = "every index comes from `array::from_fn` over arrays of the same constant length"
    )]
    pub fn plus(&self, (dq, dv): &([f64; N], [f64; N])) -> Self {
        Self {
            position: std::array::from_fn(|i| self.position[i] + dq[i]),
            velocity: std::array::from_fn(|i| self.velocity[i] + dv[i]),
        }
    }

    /// Whether every position and velocity is a finite number.
    #[must_use]
    #[inline]
    pub fn is_finite(&self) -> bool {
        let are_finite = |values: &[f64; N]| values.iter().all(|value| value.is_finite());
        are_finite(&self.position) && are_finite(&self.velocity)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bad_parameter_is_named_with_its_value() {
        let message = |lengths, masses, gravity| {
            Arm::<2>::new(lengths, masses, gravity)
                .unwrap_err()
                .to_string()
        };
        let ok = [1.0; 2];
        assert_eq!(
            message(ok, [1.0, -2.0], 9.81),
            "masses[1] must be greater than 0, got -2"
        );
        assert_eq!(
            message([0.0, 1.0], ok, 9.81),
            "lengths[0] must be greater than 0, got 0"
        );
        assert_eq!(
            message([1.0, f64::NAN], ok, 9.81),
            "lengths[1] must be finite, got NaN"
        );
        assert_eq!(
            message(ok, [f64::INFINITY, 1.0], 9.81),
            "masses[0] must be finite, got inf"
        );
        assert_eq!(message(ok, ok, -1.0), "gravity must be at least 0, got -1");
        assert_eq!(
            message(ok, ok, f64::NEG_INFINITY),
            "gravity must be finite, got -inf"
        );
    }

    #[test]
    fn negative_zero_is_no_gravity() {
        let arm = Arm::new([1.0; 2], [1.0; 2], -0.0).unwrap();
        assert_eq!(arm.gravity().to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn the_reach_is_the_length_of_the_stretched_arm() {
        // All are powers of two, so the sum is exact.
        assert!((Arm::new([1.0, 0.5, 0.25], [1.0; 3], 0.0).unwrap().reach() - 1.75).abs() == 0.0);
    }

    #[test]
    fn an_arm_starts_stretched_and_at_rest() {
        let State { position, velocity } = State::<3>::rest();
        assert_eq!((position, velocity), ([0.0; 3], [0.0; 3]));
    }
}
