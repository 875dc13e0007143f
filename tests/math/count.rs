//! Counts of steps and of values.

use pendularm::math::count::{partition_point, steps_in};

/// In binary 0.15 / 0.1 is a little less than 1.5, and 0.3 / 0.1 a little less than 3.
#[test]
fn a_duration_has_the_nearest_number_of_steps_whatever_its_rounding() {
    for (duration, timestep, steps) in [
        (0.3, 0.1, 3.0),
        (0.15, 0.1, 2.0),
        (0.149, 0.1, 1.0),
        (0.04, 0.1, 0.0),
        (2.0, 1e-3, 2000.0),
    ] {
        let got = steps_in(duration, timestep).round();
        assert_eq!(got, steps, "{duration} of {timestep}");
    }
    assert_eq!(steps_in(0.3, 0.1).floor(), 3.0);
}

#[test]
fn the_values_up_to_a_bound_are_counted() {
    for count in 0..40 {
        for bound in 0..=count {
            let counted = partition_point(count, |value| {
                assert!(value < count, "{value} of {count}");
                value < bound
            });
            assert_eq!(counted, bound, "of {count}");
        }
    }
}
