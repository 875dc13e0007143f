//! Growth per control period, measured on the arm, against the spectral radius.

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::report::experiments::growth::growth_per_period;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::Linear;
use pendularm::study::stability::{largest_period, period_matrix};

/// Far from the limit the integral decides, past it the damping that answers too late; both are seen.
#[test]
fn a_deviation_grows_per_control_period_as_the_spectral_radius_says() {
    for method in Method::ALL {
        let setpoint = Setpoint::at([0.4, 0.8]);
        let control =
            ControlLoop::new(Arm::default(), Gains::<2>::default(), setpoint).with_method(method);
        let linear = Linear::at_setpoint(&control);
        for substeps in [1, 10] {
            let limit = largest_period(&linear, method, substeps).unwrap();
            for part in [0.3, 0.9, 1.01, 1.05] {
                let period = part * limit;
                let predicted = period_matrix(&linear, method, substeps, period).spectral_radius();
                let measured = growth_per_period(&control.with_timestep(period), substeps).unwrap();
                // The ratio shows in the swing that is left over 4000 periods.
                assert!(
                    (measured / predicted - 1.0).abs() < 1e-3,
                    "{method}, {substeps} steps in {period} s: {measured}, {predicted}"
                );
                assert_eq!(measured < 1.0, part < 1.0, "{method}, {substeps}, {part}");
            }
        }
    }
}
