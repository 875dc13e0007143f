//! The arm as physics sees it: a planar chain of uniform rods on revolute joints, and its state.
//!
//! Link `i` is a thin uniform rod: centre of mass at `l_i / 2`, inertia `m_i l_i² / 12` about it. Joint angles are relative to the
//! previous link (the first to +x), counter-clockwise, and gravity pulls along -y. Uses nothing but floating point.
//!
//! **Invariant:** an [`Arm`] that exists is valid: lengths and masses finite and positive, gravity finite and not negative.
//! Whatever depends on parameters alone is computed here, once.

use thiserror::Error;

/// Parameters of an arm with `N` links, with the constants that the dynamics derive from them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arm<const N: usize> {
    lengths: [f64; N],
    masses: [f64; N],
    gravity: f64,
    pub(super) derived: Derived<N>,
}

/// What the dynamics need of the parameters, per link.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Derived<const N: usize> {
    /// Mass of the links beyond this one \[kg\].
    pub(super) beyond: [f64; N],
    /// Mass of this link in units of the previous link's mass; 0 for the first, which has none.
    pub(super) mass_ratio: [f64; N],
    /// `1 / l` \[1/m\].
    pub(super) per_length: [f64; N],
    /// `1 / (m l)` \[1/(kg m)\]: an effort times this is an acceleration at the tip of the link \[m/s²\].
    pub(super) per_mass_length: [f64; N],
}

/// A parameter that no arm can have.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ArmError {
    /// A length or a mass is NaN or infinite.
    #[error("{field}[{index}] must be finite, got {value}")]
    NotFinite {
        /// `lengths` or `masses`.
        field: &'static str,
        /// Link, from 0.
        index: usize,
        /// What was given.
        value: f64,
    },
    /// A length or a mass is zero or negative.
    #[error("{field}[{index}] must be greater than 0, got {value}")]
    NotPositive {
        /// `lengths` or `masses`.
        field: &'static str,
        /// Link, from 0.
        index: usize,
        /// What was given.
        value: f64,
    },
    /// Gravity is NaN or infinite.
    #[error("gravity must be finite, got {value}")]
    GravityNotFinite {
        /// What was given \[m/s²\].
        value: f64,
    },
    /// Gravity is negative.
    #[error("gravity must be at least 0, got {value}")]
    GravityNegative {
        /// What was given \[m/s²\].
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

    fn valid(lengths: [f64; N], masses: [f64; N], gravity: f64) -> Self {
        let mut beyond = [0.0; N];
        let mut outer = 0.0;
        for (beyond, mass) in beyond.iter_mut().zip(&masses).rev() {
            *beyond = outer;
            outer += mass;
        }
        let mut mass_ratio = [0.0; N];
        for (ratio, pair) in mass_ratio.iter_mut().skip(1).zip(masses.windows(2)) {
            if let [inner, outer] = pair {
                *ratio = outer / inner;
            }
        }
        let mut per_mass_length = lengths;
        for (product, mass) in per_mass_length.iter_mut().zip(&masses) {
            *product = 1.0 / (*product * mass);
        }
        let per_length = lengths.map(f64::recip);
        let derived = Derived {
            beyond,
            mass_ratio,
            per_length,
            per_mass_length,
        };
        // `-0.0` is at least 0 and would be shown as such.
        Self {
            lengths,
            masses,
            gravity: gravity.abs(),
            derived,
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

    /// Distance from the base to the tip of the stretched arm \[m\].
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

/// Where the joints are and how fast they turn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State<const N: usize> {
    /// Joint angles \[rad\], never wrapped.
    pub position: [f64; N],
    /// Joint rates \[rad/s\].
    pub velocity: [f64; N],
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

    /// Whether every position and velocity is a finite number.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.position
            .iter()
            .chain(&self.velocity)
            .all(|value| value.is_finite())
    }
}
