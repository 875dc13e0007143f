//! Claims of every answer of the study, tried on random arms, gains, poses and setpoints.
//!
//! A case is made from its number alone, which a failure names: `FROM=number COUNT=1` makes it again. `make check-study`
//! runs as many as `COUNT` says, in an optimised build; the tests here run hundreds.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec2;
use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::kinematics::forward;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::report::experiments::measure::{STEPS, growth};
use pendularm::report::experiments::reference::{Law, ReferenceMotion};
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::gains::{GainsSearch, MOVES, SETTLED, Wish};
use pendularm::study::linear::{Linear, equilibrium};
use pendularm::study::planner::{Planning, Task};
use pendularm::study::rollout::{Plan, Rollout};
use pendularm::study::stability::{
    BEYOND, Rest, Sampling, largest_timestep, limit_held, limits, step_matrix,
};

/// How far below and above a predicted limit the arm is watched.
const ASIDE: f64 = 0.03;

/// By how many factors e the slowest mode's energy must change while a nudge is watched, or the watch is too short to
/// tell what becomes of it: in the first of the windows compared faster modes have hidden it.
const DECIDED: f64 = 12.0;

/// Random choices of one case.
struct Dice(fastrand::Rng);

impl Dice {
    fn of(case: u64) -> Self {
        Self(fastrand::Rng::with_seed(case))
    }

    /// Evenly between -1 and 1.
    fn any(&mut self) -> f64 {
        2.0 * self.0.f64() - 1.0
    }

    /// Within so many powers of ten about 1.
    fn size(&mut self, decades: f64) -> f64 {
        10_f64.powf(decades * self.any())
    }

    fn one_in(&mut self, count: u32) -> bool {
        self.0.u32(0..count) == 0
    }

    fn arm<const N: usize>(&mut self) -> Arm<N> {
        let lengths = std::array::from_fn(|_| self.size(0.7));
        let masses = std::array::from_fn(|_| self.size(1.0));
        let gravity = [0.0, 1.62, 9.81][self.0.usize(0..3)];
        Arm::new(lengths, masses, gravity).unwrap()
    }

    /// From too soft to hold the arm to stiff, from hardly damped to sluggish, some of them zero.
    fn gains<const N: usize>(&mut self, arm: &Arm<N>) -> Gains<N> {
        let (lengths, masses) = (arm.lengths(), arm.masses());
        let pace = 10.0 * self.size(1.0);
        let damping = self.size(1.0);
        let mut gains = Gains {
            kp: [0.0; N],
            ki: [0.0; N],
            kd: [0.0; N],
        };
        for i in 0..N {
            let reach: f64 = lengths[i..].iter().sum();
            let mass: f64 = masses[i..].iter().sum();
            let inertia = mass * reach * reach / 3.0;
            gains.kp[i] = inertia * pace * pace * self.size(0.5);
            gains.kd[i] = 2.0 * damping * (gains.kp[i] * inertia).sqrt() * self.size(0.3);
        }
        if self.one_in(2) {
            gains.ki = gains.kp.map(|kp| kp * self.size(0.5));
        }
        for i in 0..N {
            for gain in [&mut gains.kp[i], &mut gains.ki[i], &mut gains.kd[i]] {
                if self.one_in(12) {
                    *gain = 0.0;
                }
            }
        }
        gains
    }

    /// Anywhere within whole turns; now and then upright or hanging to the bit, where balances are.
    fn setpoint<const N: usize>(&mut self) -> [f64; N] {
        let mut position = std::array::from_fn(|_| TAU * self.any());
        if self.one_in(10) {
            position = std::array::from_fn(|i| {
                let turned = if self.one_in(2) { PI } else { 0.0 };
                if i == 0 { FRAC_PI_2 } else { turned }
            });
        }
        position
    }

    fn control<const N: usize>(&mut self) -> ControlLoop<N> {
        let arm = self.arm();
        let gains = self.gains(&arm);
        let setpoint = Setpoint::at(self.setpoint());
        let method = Method::ALL[self.0.usize(0..Method::ALL.len())];
        ControlLoop::new(arm, gains, setpoint).with_method(method)
    }
}

/// How often a claim was tried, and how often the case said nothing about it.
#[derive(Debug, Default, Clone, Copy)]
struct Tally {
    tried: u64,
    open: u64,
}

/// Runs cases, and prints how many said something.
fn run(claim: &str, cases: impl Iterator<Item = u64>, check: impl Fn(u64, &mut Tally)) -> Tally {
    let mut tally = Tally::default();
    for case in cases {
        check(case, &mut tally);
    }
    println!("{claim}: {tally:?}");
    tally
}

/// The cases of a test, or those that the environment asks for: `per` of a million.
fn cases(few: u64, per: u64) -> std::ops::Range<u64> {
    let number = |name: &str| -> Option<u64> { std::env::var(name).ok()?.parse().ok() };
    let from = number("FROM").unwrap_or(0);
    let count = number("COUNT").map_or(few, |count| (count / (1_000_000 / per)).max(1));
    from..from + count
}

/// Growth of the energy of a small deviation at this timestep, infinite where it escapes, and whether the watch is long
/// enough for the slowest mode to show.
fn watched<const N: usize>(control: &ControlLoop<N>, linear: &Linear) -> (f64, bool) {
    let step = step_matrix(linear, control.method, Sampling::Held, control.timestep);
    let changes = 1.25 * STEPS as f64 * step.spectral_radius().ln();
    let growth = growth(control, Sampling::Held).unwrap_or(f64::INFINITY);
    (growth, changes.abs() > DECIDED)
}

/// Where it is said to rest nothing pushes, a nudge dies out below the limit and grows beyond it; unstable at every
/// timestep means just that.
fn a_limit_divides_decay_from_growth<const N: usize>(case: u64, tally: &mut Tally) {
    let control = Dice::of(case).control::<N>();
    let told = format!("case {case}: {control:?}");
    let rest = equilibrium(&control);
    let linear = Linear::at(&control, &rest.position, &rest.integrating);
    let load = pendularm::math::dynamics::gravity_load(&control.arm, &rest.position);
    let stiffest = control.gains.kp.iter().copied();
    let largest = load.map(f64::abs).into_iter().chain(stiffest);
    // Springs magnify what rounding makes of angles of some turns.
    assert!(
        rest.residual <= 1e-12 * largest.fold(1.0, f64::max),
        "{told}: {rest:?}"
    );
    let mut judge = |timestep: f64, grows: bool| {
        let control = control.with_timestep(timestep);
        let (growth, is_shown) = watched(&control, &linear);
        // Decay that is seen is decay; what seems to grow may be a slow mode that swings.
        if is_shown || (growth < 1.0 && !grows) {
            tally.tried += 1;
            assert_eq!(growth >= 1.0, grows, "{told}: {growth:e} at {timestep} s");
        } else {
            tally.open += 1;
        }
    };
    let rates = linear.flow().eigenvalues().into_iter();
    let fastest = rates
        .map(pendularm::study::matrix::Complex::modulus)
        .fold(0.0, f64::max);
    match limit_held(&control) {
        Some(0.0) => judge(0.02 / fastest, true),
        Some(limit) => {
            judge((1.0 - ASIDE) * limit, false);
            judge((1.0 + ASIDE) * limit, true);
        }
        None => judge(control.timestep, false),
    }
}

/// No pose has a smaller limit than the smallest, the advice is within it, and what is critical grows.
fn no_pose_is_worse_than_the_worst<const N: usize>(case: u64, tally: &mut Tally) {
    let mut dice = Dice::of(case);
    let control = dice.control::<N>();
    let told = format!("case {case}: {control:?}");
    let found = limits(&control);
    let least = found.minimum_held.unwrap_or(f64::INFINITY);
    assert!(
        found.advised.is_none_or(|advised| advised <= least),
        "{told}: {found:?}"
    );
    // A loop that runs away in earnest is said to, and one that is stable at some timestep is not.
    let is_said = found.rest == Rest::Unstable;
    assert!(
        if is_said {
            found.held == Some(0.0)
        } else {
            !runs_away(&control)
        },
        "{told}: {found:?}"
    );
    // A limit counts growth of 1e-11, which may be a hair before the bound or behind it.
    assert!(
        found.bound.is_none_or(|bound| bound <= 1.0001 * least),
        "{told}: {found:?}"
    );
    if let Some(critical) = found.critical {
        assert!(
            critical.growth_per_step > 1.0
                && critical.joint < N
                && critical.frequency <= 0.500_001 / (BEYOND * least),
            "{told}: {found:?}"
        );
    }
    for _ in 0..5 {
        let pose = std::array::from_fn(|_| PI * dice.any());
        let linear = Linear::at_pose(&control, &pose);
        // A pose from which gravity pulls the arm away says nothing about timesteps.
        let held = largest_timestep(&linear, control.method, Sampling::Held);
        let Some(held) = held.filter(|held| *held > 0.0) else {
            tally.open += 1;
            continue;
        };
        tally.tried += 1;
        if let Some(bound) = found.bound {
            assert!(
                held >= 0.999 * bound,
                "{told}: {held} at {pose:?}, {found:?}"
            );
        }
        // A worst pose that is found by search alone may be missed by a little.
        let within = if found.certified { 0.99 } else { 0.9 };
        assert!(
            held >= within * least,
            "{told}: {held} at {pose:?}, {found:?}"
        );
    }
}

/// Whether the loop runs away from where it rests in continuous time.
fn runs_away<const N: usize>(control: &ControlLoop<N>) -> bool {
    let modes = Linear::at_setpoint(control).flow().eigenvalues();
    let fastest = modes.iter().map(|mode| mode.modulus()).fold(0.0, f64::max);
    modes.iter().any(|mode| mode.re > 1e-9 * fastest)
}

/// Arms of 10 cm to 10 m and of 10 g to 100 kg a link: gains that are suggested leave the margin and settle on moves that the search has not made.
fn suggested_gains_hold<const N: usize>(case: u64, tally: &mut Tally) {
    let mut dice = Dice::of(case);
    let (length, mass) = (dice.size(1.0), dice.size(1.7));
    let lengths = std::array::from_fn(|_| length * dice.size(0.2));
    let masses = std::array::from_fn(|_| mass * dice.size(0.3));
    let arm = Arm::<N>::new(lengths, masses, 9.81).unwrap();
    let method = Method::ALL[dice.0.usize(0..Method::ALL.len())];
    let free = ControlLoop::free(arm).with_method(method);
    let wish = Wish {
        settling_time: 4.0,
        margin: 1.0 + dice.0.f64(),
    };
    let mut search = GainsSearch::new(&free, wish).unwrap();
    let answer = std::iter::repeat_with(|| search.advance()).find_map(|answer| answer);
    let Some(Ok(found)) = answer else {
        tally.open += 1;
        return;
    };
    tally.tried += 1;
    let told = format!("case {case}: {free:?} {found:?} after {MOVES} moves");
    let control = ControlLoop {
        gains: found.gains,
        setpoint: Setpoint::at(std::array::from_fn(|_| TAU * dice.any())),
        ..free
    };
    assert!(found.settled_after <= wish.settling_time, "{told}");
    let least = limits(&control).trusted().unwrap();
    assert!(
        least >= 0.999 * wish.margin * free.timestep,
        "{told}: {least}"
    );
    let mut live = control.simulation(State::rest());
    let mut off_at = 0.0;
    // Ten moves stand for all of them: another may take a half more.
    while live.time() < 2.0 * wish.settling_time {
        assert!(live.step(), "{told}: diverged");
        let off = |i: usize| (live.state().position[i] - control.setpoint.position[i]).abs();
        if (0..N).any(|i| off(i) > SETTLED) {
            off_at = live.time();
        }
    }
    assert!(
        off_at <= 1.5 * wish.settling_time,
        "{told}: {off_at} s, {control:?}"
    );
}

/// A state to begin with, and a time for which the motion from there is known.
fn start<const N: usize>(dice: &mut Dice, arm: &Arm<N>) -> (State<N>, f64) {
    let reach = arm.reach();
    let state = State {
        position: std::array::from_fn(|_| PI * dice.any()),
        velocity: std::array::from_fn(|_| dice.any() / reach.sqrt()),
    };
    (state, (0.5 + 1.5 * dice.0.f64()) * reach.sqrt().min(2.0))
}

/// A planned run is within the allowed error of a motion of twice the digits.
fn a_plan_keeps_its_error<const N: usize>(case: u64, tally: &mut Tally) {
    let mut dice = Dice::of(case);
    let arm = dice.arm::<N>();
    let (start, duration) = start(&mut dice, &arm);
    let error = arm.reach() * 1e-4 * dice.size(2.0);
    let task = Task {
        control: ControlLoop::free(arm),
        start,
        duration,
        error,
    };
    let mut planning = Planning::new(task).unwrap();
    let planned = std::iter::repeat_with(|| planning.advance()).find_map(|planned| planned);
    let Some(Ok(planned)) = planned else {
        tally.open += 1;
        return;
    };
    for candidate in &planned.candidates {
        let control = task.control.with_method(candidate.method);
        let mut live = control.with_timestep(candidate.timestep).simulation(start);
        let steps = (duration / candidate.timestep).round() as usize;
        let every = (steps / 10).max(1);
        let spacing = candidate.timestep * every as f64;
        let truth = ReferenceMotion::of(&arm, &start, &Law::FREE, spacing, steps / every);
        let tip = |state: &State<N>| -> DVec2 { forward(arm.lengths(), &state.position).position };
        for index in 0..truth.len() {
            live.advance(every as u64);
            let off = tip(live.state()).distance(tip(&truth.state(index).unwrap()));
            assert!(off <= error, "case {case}: {off:e} {task:?} {candidate:?}");
        }
        tally.tried += 1;
    }
}

/// An error that a rollout answers is that to a motion of twice the digits, give or take its uncertainty; where none is
/// answered the two are of one size.
fn an_answered_error_is_the_true_one<const N: usize>(case: u64, tally: &mut Tally) {
    let mut dice = Dice::of(case);
    let arm = dice.arm::<N>();
    let (start, duration) = start(&mut dice, &arm);
    let control =
        ControlLoop::free(arm).with_method(Method::ALL[dice.0.usize(0..Method::ALL.len())]);
    let timestep = duration / f64::from(dice.0.u32(100..4000));
    let plan = Plan {
        control: control.with_timestep(timestep),
        start,
        duration,
        samples: 5,
        reference: true,
    };
    let mut rollout = Rollout::new(plan).unwrap();
    while rollout.advance(u64::MAX) > 0 {}
    let deviation = rollout.deviation().unwrap();
    if rollout.divergence().is_some() || deviation.errors.len() < 5 {
        tally.open += 1;
        return;
    }
    let mut before = 0.0;
    let times = &rollout.times()[1..];
    let intervals: Vec<f64> = times
        .iter()
        .map(|time| time - std::mem::replace(&mut before, *time))
        .collect();
    let truth = ReferenceMotion::between(&arm, &start, &Law::FREE, &intervals);
    let off = (0..truth.len()).map(|index| {
        let position = &rollout.positions()[index + 1];
        truth.angle_error(index, position).unwrap()
    });
    let off = off.fold(0.0, f64::max);
    let told = format!("case {case}: {off:e} {plan:?} {deviation:?}");
    match deviation.known() {
        // The reference is off by no more than some times what two of them differ by.
        Some(error) => {
            assert!((error - off).abs() <= 0.5 * off + 1e-15, "{told}");
            tally.tried += 1;
        }
        None => {
            assert!(
                off <= 50.0 * deviation.largest_uncertainty() + 1e-14,
                "{told}"
            );
            tally.open += 1;
        }
    }
}

/// Runs a property for both numbers of links, in turn.
macro_rules! property {
    ($check:ident, $few:expr, $per:expr) => {
        run(stringify!($check), cases($few, $per), |case, tally| {
            if case.is_multiple_of(2) {
                $check::<2>(case, tally);
            } else {
                $check::<3>(case, tally);
            }
        })
    };
}

/// At least two of three cases say something, or the test says little. One that is made again by its number need not.
fn tells(tally: Tally) {
    let is_one = std::env::var("COUNT").is_ok_and(|count| count == "1");
    assert!(is_one || tally.tried > 2 * tally.open, "{tally:?}");
}

#[test]
fn limits_divide_decay_from_growth_on_random_loops() {
    tells(property!(a_limit_divides_decay_from_growth, 300, 1_000_000));
}

#[test]
fn no_pose_of_a_random_loop_is_worse_than_the_worst() {
    tells(property!(no_pose_is_worse_than_the_worst, 80, 20_000));
}

/// Its gains run away where nothing weighs, in a pose that gravity steadies: what grows there grows without gravity.
#[test]
fn what_is_critical_grows_also_where_only_the_arm_without_weight_runs_away() {
    no_pose_is_worse_than_the_worst::<3>(285, &mut Tally::default());
}

#[test]
fn gains_for_random_arms_hold_on_other_moves() {
    tells(property!(suggested_gains_hold, 12, 2_000));
}

#[test]
fn plans_for_random_arms_keep_their_error() {
    tells(property!(a_plan_keeps_its_error, 30, 10_000));
}

#[test]
fn errors_of_random_rollouts_are_the_true_ones() {
    tells(property!(an_answered_error_is_the_true_one, 60, 20_000));
}
