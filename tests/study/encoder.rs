//! The noise of velocities by encoders, on moving arms, against the prediction.

use std::f64::consts::TAU;

use pendularm::report::experiments::measure;
use pendularm::study::encoder::{largest_kd, velocity_noise};

#[test]
fn a_difference_of_counts_is_as_noisy_as_predicted_with_10_to_20_bits() {
    for bits in 10..=20 {
        let step = TAU / f64::from(1 << bits);
        for timestep in [0.001, 0.004] {
            let found = measure::velocity_noise(step, timestep, 20_000);
            let predicted = velocity_noise(step, timestep);
            // Below a step per period the noise depends on the speed, as the theory says.
            let tolerance = if bits < 14 { 0.25 } else { 0.03 };
            assert!(
                (found / predicted - 1.0).abs() < tolerance,
                "{bits} bits, {timestep} s: {found} rad/s, predicted {predicted}"
            );
        }
    }
}

#[test]
fn the_largest_kd_falls_with_the_period_and_rises_with_each_bit() {
    let twelve_bits = TAU / 4096.0;
    let kd = largest_kd(twelve_bits, 0.001, 1.0);
    assert!((kd * velocity_noise(twelve_bits, 0.001) - 1.0).abs() < 1e-15);
    assert_eq!(largest_kd(twelve_bits, 0.004, 1.0), 4.0 * kd);
    assert_eq!(largest_kd(twelve_bits / 2.0, 0.001, 1.0), 2.0 * kd);
    assert_eq!(largest_kd(0.0, 0.001, 1.0), f64::INFINITY);
}
