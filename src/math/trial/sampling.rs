//! Random targets that an arm can reach.
//!
//! **Invariant:** inverse kinematics has a solution for every target. The same seed gives the same
//! targets.

use std::f64::consts::TAU;

use glam::DVec2;

use crate::math::kinematics::{Reach, Target, heading, solve};

/// Most draws of [`sample`]. The first one is reachable, except for lengths near the limits of `f64`.
const DRAWS: u32 = 8;

/// Share of the reach's width that [`sample`] omits at each of its two edges.
const MARGIN: f64 = 0.05;

/// A random target that an arm with these `lengths` \[m\] can reach. `None` if none is found, as for lengths
/// whose sum overflows.
///
/// `random` returns uniformly distributed numbers from 0 to 1.
///
/// Targets are uniform over the area: uniform in bearing and in the square of the distance from the base. (With uniform
/// distances or joint angles, most targets would be near the base.) One twentieth of the reach's width is omitted at
/// each edge. There the arm is stretched or folded, and the end effector moves little with the joints. Part of the
/// circle of radius epsilon around the target would be out of reach. A small change of the lengths could put the target
/// itself out of reach. Three links get a uniform orientation too, or the nearest possible one.
pub fn sample<const N: usize>(
    lengths: &[f64; N],
    mut random: impl FnMut() -> f64,
) -> Option<Target> {
    let Reach { inner, outer } = Reach::of(lengths);
    let margin = MARGIN * (outer - inner);
    let (least, greatest) = (inner + margin, outer - margin);
    // Distances relative to the greatest one, so their squares neither overflow nor underflow.
    let hole = (least / greatest).min(1.0).powi(2);
    (0..DRAWS).find_map(|_| {
        let distance = greatest * (hole + random() * (1.0 - hole)).sqrt();
        let bearing = TAU * random();
        let target = Target {
            position: distance * DVec2::from_angle(bearing),
            orientation: None,
        };
        if N < 3 {
            return solve(lengths, &[0.0; N], &target).is_ok().then_some(target);
        }
        oriented(lengths, target, TAU * random())
    })
}

/// The target with the orientation nearest to `wanted` \[rad\] that the arm can have there.
fn oriented<const N: usize>(lengths: &[f64; N], target: Target, wanted: f64) -> Option<Target> {
    let mut present = [0.0; N];
    if let Some(first) = present.first_mut() {
        *first = wanted;
    }
    let pose = solve(lengths, &present, &target).ok()?;
    let target = Target {
        orientation: Some(heading(&pose).to_angle()),
        ..target
    };
    solve(lengths, &present, &target).is_ok().then_some(target)
}
