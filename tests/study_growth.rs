//! Growth per control period, measured on the arm, against the spectral radius.

#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::growth::growth_per_period;
use pendularm::study::linear::Linear;
use pendularm::study::measure::Setting;
use pendularm::study::stability::{Sampling, largest_period, period_matrix};

fn setting(method: Method) -> Setting<2> {
    Setting {
        arm: Arm::default(),
        gains: Gains::default(),
        setpoint: Setpoint {
            position: [0.4, 0.8],
            velocity: [0.0; 2],
        },
        method,
        sampling: Sampling::Held,
    }
}

/// Far from the limit the integral decides, past it the damping that answers too late; both are seen.
#[test]
fn a_deviation_grows_per_control_period_as_the_spectral_radius_says() {
    for method in Method::ALL {
        let setting = setting(method);
        let linear = Linear::at_setpoint(&setting.arm, &setting.gains, &setting.setpoint);
        for substeps in [1, 10] {
            let limit = largest_period(&linear, method, substeps).unwrap();
            for part in [0.3, 0.9, 1.01, 1.05] {
                let period = part * limit;
                let predicted = period_matrix(&linear, method, substeps, period).spectral_radius();
                let measured = growth_per_period(&setting, period, substeps).unwrap();
                // What is left of the swing over 4000 periods.
                assert!(
                    (measured / predicted - 1.0).abs() < 1e-3,
                    "{method}, {substeps} steps in {period} s: {measured}, {predicted}"
                );
                assert_eq!(measured < 1.0, part < 1.0, "{method}, {substeps}, {part}");
            }
        }
    }
}
