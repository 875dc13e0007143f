//! The live loop with any valid arm, gains, method, timestep, state, setpoint and push.
//!
//! Asserted: the state is finite after every step; a step that would leave the finite numbers is not taken, in whole or
//! in part, and none after it until a reset; efforts are finite, integrals within their limit, time is base plus whole
//! steps; many steps at once are the same as one after the other, to the bit.
//!
//! Input: all of that as numbers, and what is changed between the steps.

#![no_main]

use arbitrary::Arbitrary;
use libfuzzer_sys::fuzz_target;
use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::energy;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, INTEGRAL_LIMIT, Setpoint};
use pendularm::math::simulation::{Divergence, Simulation};
use pendularm_fuzz::limits::{DOING, hold};
use pendularm_fuzz::numbers::{Finite, Positive, finite, positive};

/// Changes in one run, and steps between two of them.
const MAX_CHANGES: usize = 32;
const MAX_STEPS: u8 = 32;

#[derive(Debug, Arbitrary)]
struct Input {
    has_three: bool,
    arm: Parameters,
    changes: Vec<Change>,
}

#[derive(Debug, Clone, Copy, Arbitrary)]
struct Parameters {
    lengths: [Positive; 3],
    masses: [Positive; 3],
    gravity: Finite,
}

#[derive(Debug, Clone, Copy, Arbitrary)]
enum Change {
    Steps(u8),
    Enable(bool),
    Method(u8),
    Timestep(Positive),
    Setpoint([Finite; 3], [Finite; 3]),
    State([Finite; 3], [Finite; 3]),
    Gains([Finite; 3], [Finite; 3], [Finite; 3]),
    Push([Finite; 3], Positive),
    Arm(Parameters),
    Reset,
}

fuzz_target!(|input: Input| hold(0, DOING, || examine(&input)));

fn examine(input: &Input) {
    if input.has_three {
        run::<3>(input);
    } else {
        run::<2>(input);
    }
}

fn first<const N: usize>(numbers: [Finite; 3]) -> [f64; N] {
    let numbers = finite(numbers);
    std::array::from_fn(|i| numbers[i])
}

fn gain<const N: usize>(numbers: [Finite; 3]) -> [f64; N] {
    first(numbers).map(f64::abs)
}

fn arm<const N: usize>(parameters: Parameters) -> Arm<N> {
    let (lengths, masses) = (positive(parameters.lengths), positive(parameters.masses));
    let gravity = parameters.gravity.0.abs();
    let lengths = std::array::from_fn(|i| lengths[i]);
    let masses = std::array::from_fn(|i| masses[i]);
    Arm::new(lengths, masses, gravity).expect("positive and finite")
}

fn run<const N: usize>(input: &Input)
where
    Gains<N>: Default,
{
    let mut simulation = Simulation::<N>::new(arm(input.arm), Gains::default());
    for change in input.changes.iter().take(MAX_CHANGES) {
        match *change {
            Change::Steps(count) => steps(&mut simulation, count % MAX_STEPS),
            Change::Enable(on) => simulation.enable(on),
            Change::Method(number) => {
                simulation.set_method(Method::ALL[usize::from(number) % Method::ALL.len()]);
            }
            Change::Timestep(Positive(timestep)) => simulation.set_timestep(timestep),
            Change::Setpoint(position, velocity) => simulation.set_setpoint(Setpoint {
                position: first(position),
                velocity: first(velocity),
            }),
            Change::State(position, velocity) => simulation.set_state(State {
                position: first(position),
                velocity: first(velocity),
            }),
            Change::Gains(kp, ki, kd) => simulation.set_gains(Gains {
                kp: gain(kp),
                ki: gain(ki),
                kd: gain(kd),
            }),
            Change::Push(effort, Positive(duration)) => simulation.disturb(first(effort), duration),
            Change::Arm(parameters) => simulation.set_arm(arm(parameters)),
            Change::Reset => {
                simulation.reset();
                assert_eq!(simulation.state(), &State::rest());
                assert_eq!((simulation.time(), simulation.divergence()), (0.0, None));
            }
        }
    }
    steps(&mut simulation, MAX_STEPS);
    // The energy of any state can be asked for.
    let _ = energy(simulation.arm(), simulation.state());
}

fn steps<const N: usize>(simulation: &mut Simulation<N>, count: u8) {
    let mut at_once = simulation.clone();
    let mut taken = 0;
    for _ in 0..count {
        let before = simulation.clone();
        if simulation.step() {
            taken += 1;
            check_step(&before, simulation);
        } else {
            check_divergence(&before, simulation);
        }
    }
    assert_eq!(at_once.advance(count.into()), taken);
    assert_eq!(&at_once, simulation);
}

fn check_step<const N: usize>(before: &Simulation<N>, after: &Simulation<N>) {
    assert_eq!((before.divergence(), after.divergence()), (None, None));
    assert!(after.state().is_finite(), "{:?}", after.state());
    assert_eq!(after.steps(), before.steps() + 1);
    assert_eq!(after.effort(), &before.effort_of_next_step());
    assert!(
        after.effort().iter().all(|effort| effort.is_finite()),
        "{:?}",
        after.effort()
    );
    let integral = after.pid().integral();
    assert!(
        integral.iter().all(|one| one.abs() <= INTEGRAL_LIMIT),
        "{integral:?}"
    );
    assert!(
        after.time() >= before.time(),
        "{} after {}",
        after.time(),
        before.time()
    );
}

/// Nothing but the divergence itself has changed, and that only if it is new.
fn check_divergence<const N: usize>(before: &Simulation<N>, after: &Simulation<N>) {
    let divergence = Divergence {
        step: before.steps() + 1,
        time: before.time(),
    };
    let expected = before.divergence().unwrap_or(divergence);
    assert_eq!(after.divergence(), Some(expected));
    assert!(after.state().is_finite());
    assert_eq!(
        (after.state(), after.effort(), after.pid(), after.steps()),
        (
            before.state(),
            before.effort(),
            before.pid(),
            before.steps()
        )
    );
    assert_eq!(after.time().to_bits(), before.time().to_bits());
}
