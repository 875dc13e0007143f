//! The throttle, the queue and the type of a subscription.

use std::time::Duration;

use pendularm::protocol::op::{MAX_QUEUE_LENGTH, MAX_THROTTLE, Op, Subscribe};

use super::op;

fn subscribe(more: &str) -> Subscribe {
    match op(&format!(r#"{{"op":"subscribe","topic":"/x"{more}}}"#)) {
        Op::Subscribe(subscribe) => subscribe,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_subscription_has_no_throttle_and_no_queue_length_unless_it_says_otherwise() {
    let plain = subscribe("");
    assert_eq!(
        (
            plain.throttle,
            plain.queue_length,
            plain.type_name.as_deref()
        ),
        (Duration::ZERO, 0, None)
    );
    for none in ["0", "0.0", "-0"] {
        let unthrottled = subscribe(&format!(r#","throttle_rate":{none}"#));
        assert_eq!(unthrottled, plain, "{none}");
    }
    let full = subscribe(r#","type":"a/B","throttle_rate":250.5,"queue_length":3"#);
    assert_eq!(full.throttle, Duration::from_micros(250_500));
    assert_eq!(
        (full.queue_length, full.type_name.as_deref()),
        (3, Some("a/B"))
    );
}

#[test]
fn a_queue_length_of_zero_is_not_given_and_floats_may_be_integers() {
    for (text, length) in [
        ("0", 0),
        ("-0", 0),
        ("1", 1),
        ("2.0", 2),
        ("1e1", 10),
        ("1e300", MAX_QUEUE_LENGTH),
    ] {
        assert_eq!(
            subscribe(&format!(r#","queue_length":{text}"#)).queue_length,
            length,
            "{text}"
        );
    }
}

#[test]
fn a_huge_throttle_rate_is_clamped() {
    for text in ["1e300", "1e15", "99999999999999999999999999"] {
        assert_eq!(
            subscribe(&format!(r#","throttle_rate":{text}"#)).throttle,
            MAX_THROTTLE,
            "{text}"
        );
    }
    // A year.
    assert_eq!(MAX_THROTTLE, Duration::from_secs(31_536_000));
    assert_eq!(
        subscribe(r#","throttle_rate":1e-300"#).throttle,
        Duration::ZERO
    );
}
