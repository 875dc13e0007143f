//! Mistakes in the equations of motion: the arm of `arm.rs` in relative angles, with its parts open to change.

#![allow(clippy::indexing_slicing, reason = "every list of an arm has an entry for each link")]

use crate::arm::{Arm, absolute, solved};

/// The parts of the equations.
#[derive(Debug, Clone, Copy)]
pub struct Equations {
    /// The centre of mass, as a part of the link.
    pub centre: f64,
    /// The inertia about it, over `m l^2`.
    pub inertia: f64,
    /// A factor of gravity.
    pub gravity: f64,
    /// A factor of the Coriolis and centrifugal terms.
    pub coriolis: f64,
    /// Whether a joint carries the masses beyond its link.
    pub carries: bool,
    /// What is different otherwise.
    pub other: Other,
}

/// Further differences.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Other {
    /// None.
    Nothing,
    /// The mass matrix has its diagonal alone.
    Diagonal,
    /// The mass matrix has no terms below its diagonal.
    Asymmetric,
    /// The mass matrix does not depend on the pose.
    Constant,
    /// The gravity load has the relative angles.
    RelativeLoad,
    /// A joint has the gravity load of its own link alone.
    OwnLoad,
    /// Gravity acts along x.
    Sideways,
    /// The Coriolis terms have the relative rates.
    RelativeRates,
    /// The angles are in degrees.
    Degrees,
    /// All lengths are 1 m.
    Lengths,
    /// All masses are 1 kg.
    Masses,
}

/// The right ones.
pub const RIGHT: Equations =
    Equations { centre: 0.5, inertia: 1.0 / 12.0, gravity: 1.0, coriolis: 1.0, carries: true, other: Other::Nothing };

const fn with(other: Other) -> Equations {
    Equations { other, ..RIGHT }
}

/// All mistakes, with their descriptions.
pub const MISTAKES: [(&str, Equations); 22] = [
    ("gravity has the wrong sign", Equations { gravity: -1.0, ..RIGHT }),
    ("there is no gravity", Equations { gravity: 0.0, ..RIGHT }),
    ("gravity is twice as large", Equations { gravity: 2.0, ..RIGHT }),
    ("the Coriolis terms are missing", Equations { coriolis: 0.0, ..RIGHT }),
    ("the Coriolis terms have the wrong sign", Equations { coriolis: -1.0, ..RIGHT }),
    ("the Coriolis terms lack a factor 2", Equations { coriolis: 0.5, ..RIGHT }),
    ("the links are point masses at their ends", Equations { centre: 1.0, inertia: 0.0, ..RIGHT }),
    ("the links are point masses at their middles", Equations { inertia: 0.0, ..RIGHT }),
    ("the inertia about the centre of mass is that about the end", Equations { inertia: 1.0 / 3.0, ..RIGHT }),
    ("the inertia about the joint is that about the centre of mass", Equations { inertia: -1.0 / 6.0, ..RIGHT }),
    ("the centre of mass is at the tip", Equations { centre: 1.0, ..RIGHT }),
    ("a joint does not carry the masses beyond its link", Equations { carries: false, ..RIGHT }),
    ("the mass matrix has its diagonal alone", with(Other::Diagonal)),
    ("the mass matrix is not symmetric: the terms below the diagonal are missing", with(Other::Asymmetric)),
    ("the mass matrix does not depend on the pose", with(Other::Constant)),
    ("the gravity load has relative instead of absolute angles", with(Other::RelativeLoad)),
    ("a joint has the gravity load of its own link alone", with(Other::OwnLoad)),
    ("gravity acts along x", with(Other::Sideways)),
    ("the Coriolis terms have relative instead of absolute rates", with(Other::RelativeRates)),
    ("the angles are taken for degrees", with(Other::Degrees)),
    ("the lengths of the links are not used", with(Other::Lengths)),
    ("the masses of the links are not used", with(Other::Masses)),
];

impl Equations {
    /// Joint accelerations by this effort.
    #[must_use]
    pub fn acceleration(&self, arm: &Arm, position: &[f64], velocity: &[f64], effort: &[f64]) -> Vec<f64> {
        let count = position.len();
        let ones = vec![1.0; count];
        let lengths = if self.other == Other::Lengths { &ones } else { &arm.lengths };
        let masses = if self.other == Other::Masses { &ones } else { &arm.masses };
        let unit = if self.other == Other::Degrees { 1f64.to_radians() } else { 1.0 };
        let headings: Vec<f64> = absolute(position).iter().map(|angle| unit * angle).collect();
        let rates = if self.other == Other::RelativeRates { velocity.to_vec() } else { absolute(velocity) };
        let beyond = |i: usize| if self.carries { masses[i + 1..].iter().sum::<f64>() } else { 0.0 };
        let inertia = |i: usize, j: usize| {
            let outer = i.max(j);
            let own = if i == j { self.centre * self.centre + self.inertia } else { self.centre };
            lengths[i] * lengths[j] * (own * masses[outer] + beyond(outer))
        };
        let load = |i: usize| {
            let angle = if self.other == Other::RelativeLoad { unit * position[i] } else { headings[i] };
            let along = if self.other == Other::Sideways { -angle.sin() } else { angle.cos() };
            self.gravity * arm.gravity * lengths[i] * (self.centre * masses[i] + beyond(i)) * along
        };
        let between = |a: usize, b: usize| if self.other == Other::Constant { 1.0 } else { (headings[a] - headings[b]).cos() };
        let entry = |i: usize, j: usize| {
            let is_gone = (self.other == Other::Diagonal && i != j) || (self.other == Other::Asymmetric && i > j);
            let all = (i..count).flat_map(|a| (j..count).map(move |b| (a, b)));
            if is_gone { 0.0 } else { all.map(|(a, b)| inertia(a, b) * between(a, b)).sum() }
        };
        let row = |i: usize| {
            let turning =
                |a: usize| -> f64 { (0..count).map(|b| inertia(a, b) * (headings[a] - headings[b]).sin() * rates[b] * rates[b]).sum() };
            let last = if self.other == Other::OwnLoad { i + 1 } else { count };
            let right = effort[i] - self.coriolis * (i..count).map(turning).sum::<f64>() - (i..last).map(load).sum::<f64>();
            (0..count).map(|j| entry(i, j)).chain([right]).collect()
        };
        solved((0..count).map(row).collect())
    }
}
