//! The causes of wrong answers: a right or an unknown answer accuses of no mistake. The mistakes are those of `wrong/`.

use pendularm_conformance::arm::{Arm, State};
use pendularm_conformance::method::{METHODS, step};
use pendularm_conformance::mistakes::{PARTICLE, equations, motion, particle, steps};

fn uneven(links: usize) -> Arm {
    let take = |values: [f64; 3]| values.into_iter().take(links).collect();
    Arm { masses: take([1.4, 0.9, 0.6]), lengths: take([0.8, 1.1, 0.7]), gravity: 6.5 }
}

/// A free motion by steps, published at every second step.
fn swing(links: usize, next: impl Fn(&State) -> State) -> Vec<State> {
    let take = |values: [f64; 3]| values.into_iter().take(links).collect();
    let mut states = vec![State { position: take([0.4, 0.5, 0.3]), velocity: take([1.5, 0.8, 1.0]) }];
    for _ in 0..12 {
        let middle = next(states.last().unwrap());
        states.push(next(&middle));
    }
    states
}

#[test]
fn right_and_unknown_answers_accuse_of_no_mistake() {
    let (f, start, dt, count) = PARTICLE;
    let arm = uneven(2);
    for method in METHODS {
        let right = steps::particle(|s, t, dt, f| step(method, s, t, dt, f), f, start, dt, count);
        assert_eq!(particle(method, &right).cause, None, "{method}");
        let noisy: Vec<f64> = right.iter().enumerate().map(|(at, value)| value + 1e-3 * (at as f64 * 1.7).sin()).collect();
        assert_eq!(particle(method, &noisy).cause, None, "{method}");
        let force = |_: f64, q: &[f64], v: &[f64]| arm.free_acceleration(q, v);
        let states = swing(2, |s| step(method, s, 0.0, 0.01, force));
        assert_eq!(motion(&arm, method, &states).cause, None, "{method}");
        // A mass that is wrong by a tenth is in no table.
        let other = Arm { masses: vec![1.5, 0.9], ..arm.clone() };
        let force = |_: f64, q: &[f64], v: &[f64]| other.free_acceleration(q, v);
        let states = swing(2, |s| step(method, s, 0.0, 0.01, force));
        assert_eq!(motion(&arm, method, &states).cause, None, "{method}");
    }
}

#[test]
fn the_right_equations_are_those_of_the_arm() {
    for links in [2, 3] {
        let (arm, state) = (uneven(links), swing(links, Clone::clone).remove(0));
        let expected = arm.free_acceleration(&state.position, &state.velocity);
        let got = equations::RIGHT.acceleration(&arm, &state.position, &state.velocity, &vec![0.0; links]);
        assert!(got.iter().zip(&expected).all(|(got, expected)| (got - expected).abs() < 1e-12), "{got:?} {expected:?}");
    }
}
