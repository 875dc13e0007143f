//! Selection among angles that differ by whole turns.
//!
//! Sine and cosine remove whole turns, because they reduce their argument with all digits of π. A rounded 2π,
//! subtracted a million times, would lose nine digits.
//!
//! **Invariant:** an angle that is in range is returned bit for bit.

use std::f64::consts::PI;

use libm::{atan2, sincos};

/// `angle` \[rad\] in (-π, π].
#[must_use]
pub fn wrap(angle: f64) -> f64 {
    if -PI < angle && angle <= PI {
        return angle;
    }
    let (sin, cos) = sincos(angle);
    let wrapped = atan2(sin, cos);
    if wrapped > -PI { wrapped } else { PI }
}

/// The shortest rotation \[rad\] that brings heading `from` to heading `to`, in [-π, π].
#[must_use]
pub fn turn(from: f64, to: f64) -> f64 {
    let difference = to - from;
    if difference.abs() <= PI {
        return difference;
    }
    let (sin_from, cos_from) = sincos(from);
    let (sin_to, cos_to) = sincos(to);
    atan2(
        sin_to * cos_from - cos_to * sin_from,
        cos_to * cos_from + sin_to * sin_from,
    )
}

/// `solution` \[rad\] with each joint shifted by whole turns to within π of `present`, so an arm that has turned many
/// times does not turn back.
///
/// A joint whose `present` is not finite is not shifted.
#[must_use]
pub fn nearest_turn<const N: usize>(solution: &[f64; N], present: &[f64; N]) -> [f64; N] {
    let mut shifted = *solution;
    for (joint, &present) in shifted.iter_mut().zip(present) {
        if present.is_finite() && (*joint - present).abs() > PI {
            *joint = present + turn(present, *joint);
        }
    }
    shifted
}
