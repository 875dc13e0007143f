//! The study's computations for any arm, gains and setpoint: the stable timestep, and offline runs.
//!
//! Asserted: a predicted limit is none, zero, or a finite timestep, and found in bounded work; an offline run is refused
//! with a reason, or ends in bounded work with finite samples in order of time; cut into slices, both give the same bits.
//!
//! Input: the loop, and what is asked of it.

#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::no_control;
use pendularm::study::rollout::{Rollout, RolloutRequest};
use pendularm::study::stability::limit_held;
use pendularm::study::stability::{LimitSearch, Limits};
use pendularm_fuzz::limits::{DOING, hold};
use pendularm_fuzz::numbers::{Finite, Positive, finite, positive};

/// Pieces of one search: the grid of poses, many times over.
const MAX_PIECES: usize = 100_000;
/// Steps of one run; more take time and show nothing new.
const MAX_STEPS: f64 = 300.0;
/// Samples that are asked for: up to some more than there are steps.
const MAX_SAMPLES: u16 = 400;

#[derive(Debug, Clone, Copy, Arbitrary)]
struct Input {
    question: Question,
    method: u8,
    lengths: [Positive; 3],
    masses: [Positive; 3],
    gravity: Finite,
    gains: [[Finite; 3]; 3],
    setpoint: [Finite; 3],
    start: [[Finite; 3]; 2],
    timestep: Positive,
    steps: u16,
    samples: u16,
    slice: u16,
    has_control: bool,
    has_reference: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Arbitrary)]
enum Question {
    HeldOfTwo,
    HeldOfThree,
    AllOfTwo,
    RunOfTwo,
    RunOfThree,
}

fuzz_target!(|input: Input| hold(0, DOING, || examine(&input)));

fn examine(input: &Input) {
    match input.question {
        Question::HeldOfTwo => held::<2>(input),
        Question::HeldOfThree => held::<3>(input),
        Question::AllOfTwo => all::<2>(input),
        Question::RunOfTwo => run::<2>(input),
        Question::RunOfThree => run::<3>(input),
    }
}

fn first<const N: usize>(numbers: [Finite; 3]) -> [f64; N] {
    let numbers = finite(numbers);
    std::array::from_fn(|i| numbers[i])
}

fn arm<const N: usize>(input: &Input) -> Arm<N> {
    let (lengths, masses) = (positive(input.lengths), positive(input.masses));
    let gravity = input.gravity.0.abs();
    let lengths = std::array::from_fn(|i| lengths[i]);
    let masses = std::array::from_fn(|i| masses[i]);
    Arm::new(lengths, masses, gravity).expect("positive and finite")
}

fn gains<const N: usize>(input: &Input) -> Gains<N> {
    let [kp, ki, kd] = input.gains.map(|gain| first(gain).map(f64::abs));
    Gains { kp, ki, kd }
}

fn setpoint<const N: usize>(input: &Input) -> Setpoint<N> {
    Setpoint {
        position: first(input.setpoint),
        velocity: [0.0; N],
    }
}

fn control<const N: usize>(input: &Input, gains: Gains<N>) -> ControlLoop<N> {
    let Positive(timestep) = input.timestep;
    ControlLoop::new(arm(input), gains, setpoint(input))
        .with_method(Method::ALL[usize::from(input.method) % Method::ALL.len()])
        .with_timestep(timestep)
}

fn check_limit(limit: Option<f64>) {
    assert!(
        limit.is_none_or(|limit| limit.is_finite() && limit >= 0.0),
        "{limit:?}"
    );
}

fn held<const N: usize>(input: &Input) {
    check_limit(limit_held(&control::<N>(input, gains(input))));
}

fn all<const N: usize>(input: &Input) {
    let mut search = LimitSearch::<N>::new(&control(input, gains(input)));
    let found = (0..MAX_PIECES).find_map(|_| search.advance());
    let Limits {
        held,
        continuous,
        minimum_held,
        minimum_continuous,
        bound,
        advised,
        ..
    } = found.expect("a search ends");
    for limit in [
        held,
        continuous,
        minimum_held,
        minimum_continuous,
        bound,
        advised,
    ] {
        check_limit(limit);
    }
}

fn run<const N: usize>(input: &Input) {
    let Positive(timestep) = input.timestep;
    let [position, velocity] = input.start.map(first);
    let request = RolloutRequest::<N> {
        control: control(
            input,
            if input.has_control {
                gains(input)
            } else {
                no_control()
            },
        ),
        start: State { position, velocity },
        duration: timestep * (f64::from(input.steps) % MAX_STEPS),
        samples: (input.samples % MAX_SAMPLES).into(),
        reference: input.has_reference,
    };
    let (mut whole, mut sliced) = match (Rollout::new(request), Rollout::new(request)) {
        (Ok(whole), Ok(sliced)) => (whole, sliced),
        (Err(error), _) | (_, Err(error)) => {
            assert!(error.to_string().len() < 512, "{error}");
            return;
        }
    };
    whole.advance(u64::MAX);
    assert!(whole.is_over());
    let slice = u64::from(input.slice).max(1);
    while sliced.advance(slice) > 0 {}
    assert!(sliced.is_over());
    assert_eq!(sliced.positions(), whole.positions());
    assert_eq!(sliced.times(), whole.times());
    assert!(whole.times().is_sorted(), "{:?}", whole.times());
    let mut numbers = whole.positions().iter().chain(whole.velocities()).flatten();
    assert!(numbers.all(|number| number.is_finite()));
    let (samples, asked) = (whole.times().len() as u64, request.samples);
    assert!(samples <= asked, "{samples} of {asked}");
    if whole.divergence().is_none() {
        assert_eq!(samples, asked.min(whole.done() + 1));
    }
}
