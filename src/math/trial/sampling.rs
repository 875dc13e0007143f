//! Random targets that an arm can reach.
//!
//! **Invariant:** every target has been solved, and a seed makes the targets repeatable.

use std::f64::consts::TAU;

use glam::DVec2;

use crate::math::kinematics::{Reach, Target, heading, solve};

/// Draws that [`sample`] makes before it gives up; the first one is reachable but for lengths at the end of the number
/// range.
const DRAWS: u32 = 8;

/// Share of the reach's width that [`sample`] leaves free at each of its two edges.
const MARGIN: f64 = 0.05;

/// A random target that an arm with these `lengths` \[m\] can reach; `None` if there is none to be found, as for
/// lengths whose sum is beyond the number range.
///
/// `random` gives numbers from 0 to 1, each as likely as any other.
///
/// Every part of the reachable plane is as likely as any other of the same area: uniform in bearing and in the square
/// of the distance from the base. (Uniform distances or joint angles would crowd around the base.) One twentieth of the
/// reach's width is left free at either edge. There the arm is stretched or folded, and the end effector is slow to
/// follow the joints. Part of the epsilon around the target can't be entered, and a small change of the lengths would
/// put the target out of reach. Three links get an orientation too: one of which each is as likely as any other, or
/// where the arm can't have that, the nearest that it can have.
pub fn sample<const N: usize>(
    lengths: &[f64; N],
    mut random: impl FnMut() -> f64,
) -> Option<Target> {
    let Reach { inner, outer } = Reach::of(lengths);
    let margin = MARGIN * (outer - inner);
    let (least, greatest) = (inner + margin, outer - margin);
    // Shares of the greatest distance, whose squares neither overflow nor vanish.
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
