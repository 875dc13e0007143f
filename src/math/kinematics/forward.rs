//! Forward kinematics: from joint angles to points, for any number of links.
//!
//! **Invariant:** headings are composed as rotations by the *relative* angles. A sum of large angles would lose
//! digits.

use glam::DVec2;

/// The end effector's pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EndEffector {
    /// Its position \[m\].
    pub position: DVec2,
    /// Orientation of the last link, `φₙ = q₁ + … + qₙ` \[rad\], not wrapped.
    pub orientation: f64,
}

/// The end effector's pose at joint angles `q` \[rad\], for links of `lengths` \[m\].
#[must_use]
pub fn forward<const N: usize>(lengths: &[f64; N], q: &[f64; N]) -> EndEffector {
    let position = joints(lengths, q).last().copied().unwrap_or(DVec2::ZERO);
    EndEffector {
        position,
        orientation: q.iter().sum(),
    }
}

/// Positions of the links' ends \[m\]; the last is the end effector.
#[must_use]
pub fn joints<const N: usize>(lengths: &[f64; N], q: &[f64; N]) -> [DVec2; N] {
    let mut heading = DVec2::X;
    let mut end = DVec2::ZERO;
    let mut ends = [DVec2::ZERO; N];
    for ((point, &length), &angle) in ends.iter_mut().zip(lengths).zip(q) {
        heading = heading.rotate(DVec2::from_angle(angle));
        end += length * heading;
        *point = end;
    }
    ends
}

/// The unit vector along the last link at joint angles `q` \[rad\].
#[must_use]
pub fn heading<const N: usize>(q: &[f64; N]) -> DVec2 {
    q.iter().fold(DVec2::X, |heading, &angle| {
        heading.rotate(DVec2::from_angle(angle))
    })
}
