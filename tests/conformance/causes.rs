//! The causes of wrong answers: each model of a mistake is recognised, and a right or an unknown answer accuses of none.

use pendularm_conformance::arm::{Arm, State};
use pendularm_conformance::method::{METHODS, step};
use pendularm_conformance::mistakes::{self, PARTICLE, equations, motion, particle, steps};

/// Shares of the models that are recognised, with the wrong verdicts.
#[derive(Default)]
struct Score {
    right: usize,
    all: usize,
    missed: Vec<String>,
    wrong: Vec<String>,
}

impl Score {
    fn add(&mut self, says: &str, cause: Option<&str>) {
        self.all += 1;
        match cause {
            Some(cause) if cause.contains(says) => self.right += 1,
            Some(cause) => self.wrong.push(format!("{says}: {cause}")),
            None => self.missed.push(says.to_owned()),
        }
    }

    #[track_caller]
    fn must_be_at_least(&self, share: f64, count: usize) {
        println!("{} of {}; missed: {:#?}", self.right, self.all, self.missed);
        assert!(self.wrong.is_empty(), "false accusations: {:#?}", self.wrong);
        assert!(self.all >= count, "{} models", self.all);
        assert!(self.right as f64 >= share * self.all as f64, "{} of {}; missed: {:#?}", self.right, self.all, self.missed);
    }
}

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
fn nine_in_ten_mistakes_are_recognised_and_none_is_taken_for_another() {
    let (f, start, dt, count) = PARTICLE;
    let mut score = Score::default();
    for method in METHODS {
        for (says, step) in steps::steps(method) {
            // Some mistakes do not show on a particle, because its force depends on the time alone.
            let got = steps::particle(&step, f, start, dt, count);
            let is_visible = got
                .iter()
                .zip(steps::particle(|s, t, dt, f| step_of(method, s, t, dt, f), f, start, dt, count))
                .any(|(a, b)| (a - b).abs() > 1e-9);
            if is_visible {
                score.add(&says, particle(method, &got).cause.as_deref());
            }
            let arm = uneven(2);
            let force = |_: f64, q: &[f64], v: &[f64]| arm.free_acceleration(q, v);
            if !is_visible && !says.contains("the time") {
                score.add(&says, motion(&arm, method, &swing(2, |s| step(s, 0.0, 0.01, &force))).cause.as_deref());
            }
        }
    }
    for links in [2, 3] {
        let arm = uneven(links);
        for (says, equations) in equations::MISTAKES {
            let force = |_: f64, q: &[f64], v: &[f64]| equations.acceleration(&arm, q, v, &vec![0.0; links]);
            score.add(says, motion(&arm, "rk4", &swing(links, |s| step("rk4", s, 0.0, 0.01, force))).cause.as_deref());
        }
    }
    score.must_be_at_least(0.9, 40);
    assert!(mistakes::count() >= 40);
}

fn step_of(method: &str, s: &State, t: f64, dt: f64, f: steps::Force) -> State {
    step(method, s, t, dt, f)
}

#[test]
fn right_and_unknown_answers_accuse_of_no_mistake() {
    let (f, start, dt, count) = PARTICLE;
    let arm = uneven(2);
    for method in METHODS {
        let right = steps::particle(|s, t, dt, f| step_of(method, s, t, dt, f), f, start, dt, count);
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

#[test]
fn single_precision_is_recognised() {
    let (f, start, dt, count) = PARTICLE;
    let right = steps::particle(|s, t, dt, f| step_of("rk4", s, t, dt, f), f, start, dt, count);
    let single: Vec<f64> = right.iter().map(|value| f64::from(*value as f32)).collect();
    assert!(particle("rk4", &single).cause.is_some_and(|cause| cause.contains("float32")));
}
