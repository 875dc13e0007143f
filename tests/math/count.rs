//! Counts of values.

use pendularm::math::count::partition_point;

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
