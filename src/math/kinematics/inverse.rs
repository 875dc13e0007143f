//! Inverse kinematics of 2 and 3 links in closed form.
//!
//! The wrist (the end effector itself for 2 links) is at distance `r` and bearing `β` from the base. The law of
//! cosines gives the triangle `l₁, l₂, r`. The last link does not depend on it:
//!
//! ```text
//! wrist = target - l₃ (cos φ, sin φ)      q₂ = ±(π - ∠(l₁, l₂))      q₁ = β ∓ ∠(l₁, r)      q₃ = φ - q₁ - q₂
//! ```
//!
//! No angle is computed from a cosine: near the edges of the reach half of its digits would be lost. Half-angle forms
//! of the same law keep all digits. They are factored so that only differences of given lengths occur (W. Kahan,
//! *Miscalculating Area and Angles of a Needle-like Triangle*).
//!
//! A 3-link arm that may choose its orientation has the wrist at distance `w`, `w² = r² + l₃² - 2 r l₃ cos θ`, with
//! `θ = φ - β` and the target at distance `r`. `w` grows with `|θ|`, so `|l₁ - l₂| ≤ w ≤ l₁ + l₂` admits `θ₀ ≤ |θ|
//! ≤ θ₁`. The ends are angles of two more triangles.
//!
//! **Invariant:** a target up to [`BOUNDARY`] outside the reach is solved as the boundary itself. No other target is
//! moved.

use glam::DVec2;
use libm::{atan2, hypot};

use super::{Reach, Target, Unreachable, heading, turn, wrap};

/// Distance outside the reach at which a target still counts as on its edge, relative to the sum of the lengths. It
/// is far above the rounding error of a boundary computed elsewhere (1e-13), and far below any intended distance (1
/// nm per metre).
pub const BOUNDARY: f64 = 1e-9;

/// Rounding error of the wrist's distance, relative to the sum of the lengths. The distance is a difference of two
/// vectors of that size, each accurate to a few units in the last place.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Rounding error of one joint angle \[rad\]: four units in the last place of π. Poses that differ by less count
/// as equally near.
const ANGLE_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Joint angles \[rad\], each in (-π, π], that put the end effector of an arm with these `lengths` \[m\] on `target`.
///
/// `present` \[rad\] selects among several solutions. Of the two elbow poses, the one with the smaller sum of squared
/// wrapped differences from `present` is returned, or `q₂ ≥ 0` if both are equally near. Three links without an
/// orientation keep the present orientation if it is admissible. Otherwise they take the nearest admissible one, and of
/// two equally near ones the counter-clockwise one. If the wrist is on the base, the first joint does not change.
///
/// `lengths` must be finite and greater than 0; a debug build panics for others. A `present` that is not finite counts
/// as 0.
///
/// # Errors
///
/// [`Unreachable`] names the exceeded limit and the numbers.
pub fn solve<const N: usize>(
    lengths: &[f64; N],
    present: &[f64; N],
    target: &Target,
) -> Result<[f64; N], Unreachable> {
    debug_assert!(
        lengths
            .iter()
            .all(|length| length.is_finite() && *length > 0.0),
        "an arm's lengths are checked where they come in"
    );
    let present = present.map(|q| if q.is_finite() { q } else { 0.0 });
    if !target.position.x.is_finite() {
        return Err(Unreachable::NotFinite("x"));
    }
    if !target.position.y.is_finite() {
        return Err(Unreachable::NotFinite("y"));
    }
    match *lengths.as_slice() {
        [l1, l2] => {
            let arm = Chain::new(l1, l2, 0.0);
            let end_effector = target.position / arm.unit;
            arm.checked(arm.wrist_reach(), end_effector, target)?;
            Ok(arm.nearest_elbow(end_effector, 0.0, &present))
        }
        [l1, l2, l3] => {
            let arm = Chain::new(l1, l2, l3);
            let end_effector = target.position / arm.unit;
            let (wrist, phi) = match target.orientation {
                Some(phi) => arm.wrist_for(phi, end_effector, target)?,
                None => arm.nearest_wrist(end_effector, &present, target)?,
            };
            Ok(arm.nearest_elbow(wrist, phi, &present))
        }
        _ => Err(Unreachable::Links(N)),
    }
}

/// Lengths in multiples of a power of two near the longest one, so that no square or sum of them overflows or
/// underflows.
struct Chain {
    /// The power of two \[m\]; dividing by it is exact.
    unit: f64,
    l1: f64,
    l2: f64,
    /// 0 for an arm of two links: its wrist is the end effector.
    l3: f64,
}

/// The position of a distance relative to a reach.
enum Outside {
    Beyond,
    TooClose,
}

impl Chain {
    fn new(l1: f64, l2: f64, l3: f64) -> Self {
        const EXPONENT: u64 = 0x7ff << 52;
        let longest = l1.max(l2).max(l3);
        let unit = f64::from_bits(longest.to_bits() & EXPONENT).max(f64::MIN_POSITIVE);
        Self {
            unit,
            l1: l1 / unit,
            l2: l2 / unit,
            l3: l3 / unit,
        }
    }

    /// The sum of the lengths.
    const fn stretched(&self) -> f64 {
        self.l1 + self.l2 + self.l3
    }

    /// The distances from the base that links 1 and 2 allow for the wrist.
    fn wrist_reach(&self) -> Reach {
        Reach::of(&[self.l1, self.l2])
    }

    /// Whether a `distance` counts as in `reach`.
    fn check_reach(&self, reach: Reach, distance: f64) -> Result<(), Outside> {
        let slack = BOUNDARY * self.stretched();
        if distance - reach.outer > slack {
            Err(Outside::Beyond)
        } else if reach.inner - distance > slack {
            Err(Outside::TooClose)
        } else {
            Ok(())
        }
    }

    /// Refuses a target that is outside the whole arm's `reach`.
    ///
    /// A target just outside is not moved: [`half_angle`] flattens a triangle that does not close, and the flat
    /// triangle is the boundary.
    fn checked(
        &self,
        reach: Reach,
        end_effector: DVec2,
        target: &Target,
    ) -> Result<(), Unreachable> {
        let DVec2 { x, y } = target.position;
        match self.check_reach(reach, hypot(end_effector.x, end_effector.y)) {
            Ok(()) => Ok(()),
            Err(Outside::Beyond) => Err(Unreachable::Beyond {
                x,
                y,
                distance: hypot(x, y),
                limit: reach.outer * self.unit,
            }),
            Err(Outside::TooClose) => Err(Unreachable::TooClose {
                x,
                y,
                distance: hypot(x, y),
                limit: reach.inner * self.unit,
            }),
        }
    }

    /// The place of the wrist with which the end effector points along `phi`, and `phi`.
    fn wrist_for(
        &self,
        phi: f64,
        end_effector: DVec2,
        target: &Target,
    ) -> Result<(DVec2, f64), Unreachable> {
        if !phi.is_finite() {
            return Err(Unreachable::NotFinite("phi"));
        }
        let wrist = end_effector - self.l3 * DVec2::from_angle(phi);
        let distance = hypot(wrist.x, wrist.y);
        let reach = self.wrist_reach();
        let Err(side) = self.check_reach(reach, distance) else {
            return Ok((wrist, wrap(phi)));
        };
        // If no orientation is possible, the error reports that instead.
        self.checked(
            Reach::of(&[self.l1, self.l2, self.l3]),
            end_effector,
            target,
        )?;
        let distance = distance * self.unit;
        Err(match side {
            Outside::Beyond => Unreachable::WristBeyond {
                phi,
                distance,
                limit: reach.outer * self.unit,
            },
            Outside::TooClose => Unreachable::WristTooClose {
                phi,
                distance,
                limit: reach.inner * self.unit,
            },
        })
    }

    /// The place of the wrist for the admissible orientation nearest to the present one, and that orientation.
    fn nearest_wrist<const N: usize>(
        &self,
        end_effector: DVec2,
        present: &[f64; N],
        target: &Target,
    ) -> Result<(DVec2, f64), Unreachable> {
        self.checked(
            Reach::of(&[self.l1, self.l2, self.l3]),
            end_effector,
            target,
        )?;
        let present = heading(present);
        let present_phi = atan2(present.y, present.x);

        // This is checked first, so an admissible present orientation is kept bit for bit, even at the limit.
        // On the base itself all orientations are admissible or none.
        let reach = self.wrist_reach();
        let wrist = end_effector - self.l3 * present;
        let rounding = ROUNDING * self.stretched();
        let present_distance = hypot(wrist.x, wrist.y);
        let admissible = reach.inner - rounding..=reach.outer + rounding;
        if admissible.contains(&present_distance) || end_effector == DVec2::ZERO {
            return Ok((wrist, present_phi));
        }

        let distance = hypot(end_effector.x, end_effector.y);
        let bearing = atan2(end_effector.y, end_effector.x);
        let (sin, cos) = half_angle(distance, self.l3, reach.inner);
        let least = 2.0 * atan2(sin, cos);
        let (sin, cos) = half_angle(distance, self.l3, reach.outer);
        let greatest = 2.0 * atan2(sin, cos);
        let offset = wrap(turn(bearing, present_phi));
        let nearest = offset.abs().max(least).min(greatest);
        let phi = wrap(bearing + if offset < 0.0 { -nearest } else { nearest });
        Ok((end_effector - self.l3 * DVec2::from_angle(phi), phi))
    }

    /// The joints for this position of the wrist and the orientation `phi`, with the elbow nearer to `present`.
    fn nearest_elbow<const N: usize>(
        &self,
        wrist: DVec2,
        phi: f64,
        present: &[f64; N],
    ) -> [f64; N] {
        let reach = self.wrist_reach();
        let r = hypot(wrist.x, wrist.y).max(reach.inner).min(reach.outer);
        let (sin, cos) = half_angle(self.l1, self.l2, r);
        let bend = 2.0 * atan2(cos, sin);
        let (sin, cos) = half_angle(self.l1, r, self.l2);
        let lead = 2.0 * atan2(sin, cos);
        let pose = |side: f64| -> [f64; N] {
            // On the base itself the wrist has no bearing, and any first joint angle is a solution.
            let q1 = if wrist == DVec2::ZERO {
                present.first().copied().map_or(0.0, wrap)
            } else {
                wrap(atan2(wrist.y, wrist.x) - side * lead)
            };
            let q2 = wrap(side * bend);
            std::array::from_fn(|i| match i {
                0 => q1,
                1 => q2,
                _ => wrap(phi - q1 - q2),
            })
        };
        nearer(pose(1.0), pose(-1.0), present)
    }
}

/// The pose with the smaller sum of squared wrapped differences from `present`; `first` if both are equally near.
fn nearer<const N: usize>(first: [f64; N], second: [f64; N], present: &[f64; N]) -> [f64; N] {
    // Sums of the squares and of the absolute values of the differences. The latter bound the rounding error
    // of the former.
    let measured = |pose: &[f64; N]| {
        pose.iter()
            .zip(present)
            .fold((0.0, 0.0), |(squares, sizes), (&q, &present)| {
                let difference = turn(present, q);
                (squares + difference * difference, sizes + difference.abs())
            })
    };
    let (first_squares, first_sizes) = measured(&first);
    let (second_squares, second_sizes) = measured(&second);
    let rounding = ANGLE_ROUNDING * (first_sizes + second_sizes);
    if second_squares < first_squares - rounding {
        second
    } else {
        first
    }
}

/// Sine and cosine of half the angle between sides `p` and `q` of a triangle whose third side is `w`, up to a common
/// factor. Sides that do not form a triangle give the nearest flat one.
fn half_angle(p: f64, q: f64, w: f64) -> (f64, f64) {
    let (long, short) = if p >= q { (p, q) } else { (q, p) };
    // Each difference is between the two sides nearest in size, where it is exact.
    let excess = if short >= w {
        w - (long - short)
    } else {
        short - (long - w)
    };
    let sin = excess.max(0.0).sqrt() * (w + (long - short)).sqrt();
    let cos = ((long - w) + short).max(0.0).sqrt() * (long + short + w).sqrt();
    (sin, cos)
}
