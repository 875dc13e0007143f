//! Forward kinematics against stored 60-digit values, and inverse kinematics against them over the whole reachable set.

mod choices;
mod edges;
mod reach;
mod refusals;
mod stored;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DVec2, dvec2};
use pendularm::math::kinematics::{
    BOUNDARY, Reach, Target, Unreachable, forward, heading, joints, nearest_turn, solve, turn, wrap,
};
use proptest::prelude::*;

/// Error that the contract allows in a round trip, as a share of the sum of the lengths.
const ROUND_TRIP: f64 = 1e-9;

/// Error of the closed form on targets that are not moved onto a boundary. The wrist, the angles and their sines take a
/// dozen roundings, each 2⁻⁵³ of at most the sum of the lengths or π. An orientation a whole turn away loses 1e-15
/// more.
const INTERIOR: f64 = 4e-15;

fn at(x: f64, y: f64) -> Target {
    Target {
        position: dvec2(x, y),
        orientation: None,
    }
}

fn aimed(x: f64, y: f64, phi: f64) -> Target {
    Target {
        orientation: Some(phi),
        ..at(x, y)
    }
}

/// Distance between the target and where the solution puts the hand, as a share of the sum of the lengths.
fn miss<const N: usize>(lengths: &[f64; N], q: &[f64; N], target: &Target) -> f64 {
    let off = forward(lengths, q).position - target.position;
    off.x.hypot(off.y) / lengths.iter().sum::<f64>()
}

fn assert_wrapped<const N: usize>(q: &[f64; N]) {
    assert!(q.iter().all(|q| -PI < *q && *q <= PI), "{q:?}");
}

/// Sum of squared wrapped differences. It selects the elbow.
fn cost<const N: usize>(q: &[f64; N], present: &[f64; N]) -> f64 {
    q.iter()
        .zip(present)
        .map(|(q, p)| wrap(q - p).powi(2))
        .sum()
}
