//! Requests that are refused, and the reasons that the sender hears.
//!
//! **Invariant:** each limit is tried from both sides.

use pendularm::math::integrator::Method;
use pendularm::math::particle::{MAX_STEPS, MAX_WORK, Particle, ParticleError, evaluations};

use super::expression;

/// The first of `Particle::new`'s complaints.
fn refusal(text: &str, start: (f64, f64), dt: f64, steps: u64, method: Method) -> ParticleError {
    Particle::new(expression(text), start.0, start.1, dt, steps, method).unwrap_err()
}

#[test]
fn a_timestep_must_be_positive() {
    for (dt, shown) in [
        (0.0, "0"),
        (-0.0, "0"),
        (-0.1, "-0.1"),
        (-5e-324, "-5e-324"),
    ] {
        let error = refusal("t", (0.0, 0.0), dt, 10, Method::Euler);
        assert_eq!(error, ParticleError::Timestep { dt });
        assert_eq!(
            error.to_string(),
            format!("dt must be greater than 0, got {shown}")
        );
    }
}

#[test]
fn every_value_must_be_finite() {
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for (field, start, dt) in [
            ("x0", (value, 0.0), 0.1),
            ("xdot0", (0.0, value), 0.1),
            ("dt", (0.0, 0.0), value),
        ] {
            let error = refusal("t", start, dt, 10, Method::Rk4);
            assert_eq!(
                error.to_string(),
                format!("{field} must be finite, got {value}")
            );
        }
    }
}

#[test]
fn there_must_be_a_step() {
    let error = refusal("t", (0.0, 0.0), 0.1, 0, Method::Euler);
    assert_eq!(error, ParticleError::NoSteps);
    assert_eq!(error.to_string(), "steps must be at least 1, got 0");
}

#[test]
fn a_million_steps_are_the_most() {
    assert_eq!(MAX_STEPS, 1_000_000);
    assert!(Particle::new(expression("t"), 0.0, 0.0, 0.1, MAX_STEPS, Method::Rk4).is_ok());
    for steps in [MAX_STEPS + 1, u64::MAX] {
        let error = refusal("t", (0.0, 0.0), 0.1, steps, Method::Rk4);
        assert_eq!(error, ParticleError::TooManySteps { steps });
        assert_eq!(
            error.to_string(),
            format!("steps must be at most 1000000, got {steps}")
        );
    }
}

#[test]
fn two_billion_nodes_times_evaluations_are_the_most() {
    assert_eq!(MAX_WORK, 2_000_000_000);
    // 500 nodes, four evaluations, a million steps: exactly the limit.
    let force = "-".repeat(499) + "t";
    let new = |force: &str| Particle::new(expression(force), 0.0, 0.0, 0.1, 1_000_000, Method::Rk4);
    assert!(new(&force).is_ok());
    let error = new(&format!("-{force}")).unwrap_err();
    assert_eq!(
        error.to_string(),
        "function has 501 nodes and would be evaluated 4000000 times, the product must be at most 2000000000, \
         got 2004000000"
    );
}

#[test]
fn counting_evaluations_does_not_overflow() {
    for method in Method::ALL {
        assert_eq!(evaluations(u64::MAX, method), u64::MAX);
    }
}
