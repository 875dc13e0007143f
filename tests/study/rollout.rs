//! Offline runs and their errors, and the local error of a step.

use pendularm::math::arm::{Arm, State};
use pendularm::math::dynamics::forward_dynamics;
use pendularm::math::integrator::{Method, increment};
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::ControlPeriod;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::error_estimate::estimate;
use pendularm::study::method::named;
use pendularm::study::paused::{Paused, at_once};
use pendularm::study::rollout::{
    Course, MAX_SAMPLES, Rollout, RolloutRequest, rollout, rollout_along,
};
use pendularm::study::tableau::Pair;
use pendularm::study::taylor::TaylorReference;

use crate::stored::gains;

fn swing() -> RolloutRequest<2> {
    RolloutRequest {
        control: ControlLoop::free(Arm::default()).with_timestep(0.01),
        start: State {
            position: [0.4, -0.3],
            velocity: [0.5, 1.0],
        },
        duration: 1.0,
        samples: 11,
        reference: true,
    }
}

fn reach() -> RolloutRequest<2> {
    controlled(gains([200.0, 100.0], [20.0, 10.0], [30.0, 12.0]), 0.01)
}

fn controlled(gains: Gains<2>, timestep: f64) -> RolloutRequest<2> {
    let control = ControlLoop::new(Arm::default(), gains, Setpoint::at([1.0, -0.5]));
    RolloutRequest {
        control: control.with_timestep(timestep),
        ..swing()
    }
}

fn run<const N: usize>(request: RolloutRequest<N>) -> Rollout<N> {
    at_once(rollout(request)).unwrap()
}

/// A method of one's own.
fn by<const N: usize>(own: Option<Pair>) -> Course<N> {
    Course {
        own,
        ..Course::default()
    }
}

/// The live arm's methods by their tableaus take its steps, but for rounding.
#[test]
fn a_method_of_ones_own_steps_the_live_arms_loop() {
    let mut late = reach();
    late.control.arm = late.control.arm.with_friction([0.5, 0.2]).unwrap();
    late.control.period = ControlPeriod {
        period: 0.02,
        delay: 2,
    };
    late.control.limits.effort = Some([40.0, 1e3]);
    for (method, request) in Method::ALL
        .into_iter()
        .flat_map(|method| [swing(), reach(), late].map(|request| (method, request)))
    {
        let control = request.control.with_method(method);
        let request = RolloutRequest { control, ..request };
        let own = at_once(rollout_along(request, by(Some(Pair::of(method))))).unwrap();
        let live = run(request);
        assert_eq!(
            (&own.times, own.evaluations),
            (&live.times, live.evaluations)
        );
        let pairs = [
            (&own.positions, &live.positions),
            (&own.efforts, &live.efforts),
        ];
        for (one, other) in pairs
            .into_iter()
            .flat_map(|(one, other)| one.iter().zip(other))
        {
            let is_near =
                |(one, other): (&f64, &f64)| (one - other).abs() < 1e-9 * (1.0 + other.abs());
            assert!(
                one.iter().zip(other).all(is_near),
                "{method}: {one:?} {other:?}"
            );
        }
    }
    let euler = Some(Pair::of(Method::Euler));
    let wild = RolloutRequest {
        duration: 1000.0,
        ..controlled(gains([1e5; 2], [0.0; 2], [1e4; 2]), 0.01)
    };
    let end = |run: Rollout<2>| run.divergence.unwrap().step;
    let live = run(RolloutRequest {
        control: wild.control.with_method(Method::Euler),
        ..wild
    });
    assert_eq!(
        end(at_once(rollout_along(wild, by(euler))).unwrap()),
        end(live)
    );
}

/// A method of order 5 is more accurate than one of order 4 at the same timestep.
#[test]
fn a_method_of_ones_own_has_its_error() {
    let by = |name| {
        let pair = named(name).unwrap().pair().clone();
        at_once(rollout_along(swing(), by(Some(pair)))).unwrap()
    };
    let (four, five) = (by("rk4"), by("dormand_prince5"));
    let error = |run: &Rollout<2>| run.deviation.unwrap().known().unwrap();
    let live = error(&run(swing()));
    assert!((error(&four) / live - 1.0).abs() < 1e-3, "{live}");
    assert!(error(&five) < 0.1 * live, "{} {live}", error(&five));
    assert_eq!((four.evaluations, five.evaluations), (400, 600));
}

/// A run has the number of steps nearest to its duration, and its samples are at the nearest steps too.
#[test]
fn a_run_has_the_nearest_number_of_steps() {
    let times = |duration, timestep, samples| {
        let made = run(RolloutRequest {
            control: swing().control.with_timestep(timestep),
            duration,
            samples,
            reference: false,
            ..swing()
        });
        let in_steps = made.times.iter().map(|time| time / timestep);
        in_steps.map(f64::round).collect::<Vec<_>>()
    };
    for (duration, timestep, steps) in [
        (1.0, 0.6, 2.0),
        (1.0, 0.3, 3.0),
        (1.0, 0.4, 3.0),
        (0.3, 0.2, 2.0),
        (0.3, 0.1, 3.0),
        (0.1 + 0.2, 0.1, 3.0),
        (0.1 + 0.7, 0.1, 8.0),
        (0.7, 0.1 + 0.2 + 0.1, 2.0),
        (1.0, 0.001, 1000.0),
        (1.0 - 1e-16, 1.0, 1.0),
    ] {
        assert_eq!(times(duration, timestep, 2), [0.0, steps]);
    }
    assert_eq!(times(0.1, 0.01, 4), [0.0, 3.0, 7.0, 10.0]);
    assert_eq!(times(0.5, 0.1, 3), [0.0, 3.0, 5.0]);
    // More samples than steps: one a step.
    assert_eq!(times(0.3, 0.1, MAX_SAMPLES), [0.0, 1.0, 2.0, 3.0]);
}

/// The law's own efforts, given from outside, move the arm in the same way. The reference follows them closely.
#[test]
fn given_efforts_replace_the_law_and_samples_are_at_the_given_steps() {
    let held = ControlPeriod {
        period: 0.004,
        delay: 0,
    };
    let mut request = controlled(Gains::default(), 0.001);
    request.control = request.control.with_period(held);
    request.duration = 0.4;
    request.samples = 401;
    let law = run(request);
    let course = Course {
        sampled: vec![0, 7, 7, 300],
        efforts: law.efforts[1..].iter().step_by(4).copied().collect(),
        keeps_reference: true,
        own: None,
    };
    let request = RolloutRequest {
        control: ControlLoop::free(request.control.arm)
            .with_timestep(0.001)
            .with_period(held),
        reference: true,
        ..request
    };
    let made = at_once(rollout_along(request, course)).unwrap();
    assert_eq!(made.times, [0.0, 7.0 * 0.001, 7.0 * 0.001, 300.0 * 0.001]);
    assert_eq!(made.positions[1..], [7, 7, 300].map(|at| law.positions[at]));
    assert_eq!(made.efforts[3], law.efforts[300]);
    assert_eq!(made.from_ideal, None);
    let last = (made.reference[3].position, made.positions[3]);
    let apart = (0..2).map(|joint| (last.0[joint] - last.1[joint]).abs());
    assert_eq!(made.deviation.unwrap().error, apart.fold(0.0, f64::max));
    assert!(made.deviation.unwrap().error < 1e-6);

    // The last effort acts for the rest.
    let constant = Course {
        efforts: vec![[3.0, 1.0]],
        ..Course::default()
    };
    let made = at_once(rollout_along(request, constant)).unwrap();
    assert!(made.efforts[1..].iter().all(|effort| *effort == [3.0, 1.0]));
    assert!(made.reference.is_empty());
}

/// The two references agree to rounding: a second of this motion amplifies errors some ten times.
#[test]
fn the_references_agree_to_rounding() {
    let stiff = controlled(gains([1e5; 2], [1e3; 2], [1e3; 2]), 1e-4);
    for request in [swing(), reach(), stiff] {
        let deviation = run(request).deviation.unwrap();
        assert_eq!(deviation.samples, 11);
        let uncertainty = deviation.uncertainty;
        assert!(uncertainty < 2e-14, "{uncertainty:e}");
    }
}

/// At ten microseconds Runge-Kutta 4 is off by rounding, as the references are; thirty seconds of a chaotic swing leave
/// nothing to compare with. Neither error is reported. A reported error is known within its uncertainty, from three
/// runs with different bits.
#[test]
fn an_error_of_one_size_with_its_uncertainty_is_not_known() {
    let from_rest = State::at_rest([0.4, -0.3]);
    let deviation = |timestep, start, duration| {
        let request = RolloutRequest {
            control: swing().control.with_timestep(timestep),
            start,
            duration,
            samples: 101,
            ..swing()
        };
        run(request).deviation.unwrap()
    };
    let tiny = deviation(1e-5, from_rest, 5.0);
    assert!(tiny.error > 0.0 && tiny.uncertainty > 0.0);
    let chaos = deviation(1e-3, State::rest(), 40.0);
    assert_eq!(
        [tiny.known(), chaos.known()],
        [None; 2],
        "{tiny:?} {chaos:?}"
    );
    let plain = deviation(1e-2, from_rest, 5.0);
    assert_eq!(plain.known(), Some(plain.error));
    assert!(plain.error > 1e3 * plain.uncertainty);
}

/// The run in pieces, and their number.
fn in_pieces(request: RolloutRequest<2>) -> (Rollout<2>, u64) {
    let mut paused = Paused::new(rollout(request));
    let mut pieces = 1;
    loop {
        if let Some(made) = paused.advance() {
            return (made.unwrap(), pieces);
        }
        pieces += 1;
    }
}

/// Motions so fast that a reference needs thousands of evaluations for one step: a piece ends within the step.
#[test]
fn a_run_in_short_pieces_gives_the_same_bits_as_one_made_at_once_however_wild_the_motion() {
    // A piece has 2000 evaluations, and those of the last step: 22 coefficients of a reference at most.
    const MOST: u64 = 2000 + 22;
    for request in [swing(), reach()] {
        let mut wild = request;
        wild.control.timestep = 0.5;
        wild.duration = 20.0;
        wild.start.velocity = wild.start.velocity.map(|_| 40.0);
        for request in [request, wild] {
            let (sliced, pieces) = in_pieces(request);
            assert!(pieces > 2, "{pieces}");
            assert_eq!(sliced, run(request));
        }
        if wild.control.is_free() {
            let (made, pieces) = in_pieces(wild);
            let mut reference = TaylorReference::new(wild.start);
            let is_followed = |_| reference.follow(&wild.control.arm, &[0.0; 2], 0.5);
            assert!((0..made.steps).all(is_followed));
            // Four references, one of them in steps half as long. Pieces as long as a step would be 5 for each.
            let least = 5 * reference.coefficients() / MOST;
            assert!(least > 5 * made.steps, "{least} in {} steps", made.steps);
            assert!(pieces >= least, "{pieces} for {least}");
        }
    }
}

#[test]
fn a_run_that_diverges_ends_with_its_last_finite_sample() {
    let gains = gains([1e6; 2], [0.0; 2], [0.0; 2]);
    let control = ControlLoop::new(Arm::default(), gains, Setpoint::default());
    let made = run(RolloutRequest {
        control: control.with_method(Method::Euler).with_timestep(0.1),
        duration: 100.0,
        samples: 1001,
        ..swing()
    });
    assert!(made.divergence.is_some());
    assert!(made.times.len() < 1001);
    assert!(made.positions.iter().flatten().all(|q| q.is_finite()));
}

/// The reference of a stiff loop is known up to the step that diverges, so only the divergence tells that the error is
/// not that of the whole run. In the second run it is the last step, and all samples but the last are there.
#[test]
fn a_run_that_diverges_has_no_error() {
    let request = RolloutRequest {
        start: State::rest(),
        samples: MAX_SAMPLES,
        ..controlled(Gains::default(), 0.016)
    };
    let whole = run(RolloutRequest {
        duration: 1.0,
        ..request
    });
    let lost = whole.divergence.unwrap();
    assert_eq!(whole.steps + 1, lost.step);
    let last = run(RolloutRequest {
        duration: lost.step as f64 * 0.016,
        ..request
    });
    assert_eq!(last.divergence, Some(lost));
    assert_eq!(last.times.len() as u64, lost.step);
    for made in [whole, last] {
        for deviation in [made.deviation, made.from_ideal] {
            assert_eq!(made.known(deviation.as_ref()), (None, None));
        }
        assert!(made.deviation.unwrap().error > 0.0);
    }
}

/// `tests/actors/refusals/rows.txt` has the other refusals.
#[test]
fn a_run_whose_work_is_not_bounded_is_refused() {
    let with = |change: &dyn Fn(&mut RolloutRequest<2>)| {
        let mut request = swing();
        change(&mut request);
        at_once(rollout(request)).unwrap_err().to_string()
    };
    type Row<'a> = (&'a dyn Fn(&mut RolloutRequest<2>), &'a str, &'a str);
    let positive = "must be finite and greater than 0, got";
    let rows: [Row<'_>; 5] = [
        (&|ask| ask.control.timestep = 0.0, "timestep", "0"),
        (
            &|ask| (ask.duration, ask.control.timestep) = (-1.0, -0.01),
            "duration",
            "-1",
        ),
        (&|ask| ask.duration = f64::INFINITY, "duration", "inf"),
        (&|ask| ask.duration = f64::NAN, "duration", "NaN"),
        (&|ask| ask.control.timestep = f64::NAN, "timestep", "NaN"),
    ];
    for (change, name, got) in rows {
        assert_eq!(with(change), format!("{name} {positive} {got}"));
    }
}

/// The true local error is that against the arm followed to rounding. Where a step is well resolved, what the estimate
/// leaves out is one power of the timestep further: a few hundredths.
#[test]
fn the_error_of_a_step_is_estimated_at_rest_and_in_motion() {
    let moving = State {
        position: [0.3, 0.7, -0.4],
        velocity: [1.0, -2.0, 0.5],
    };
    // The arm is released at rest, so the error's leading term vanishes for midpoint and Verlet.
    for (state, effort) in [(moving, [3.0, -1.0, 0.5]), (State::rest(), [0.0; 3])] {
        let methods = Method::ALL.into_iter();
        for (method, h) in methods.flat_map(|one| [(one, 4e-3), (one, 1e-2)]) {
            let arm = Arm::<3>::default();
            let control = ControlLoop::free(arm).with_method(method);
            let mut simulation = control.with_timestep(h).simulation(state);
            simulation.drive(Some(effort));
            let estimate = estimate(&simulation).unwrap();
            let mut truth = TaylorReference::new(state);
            assert!(truth.follow(&arm, &effort, h));
            let acceleration =
                |_, q: &[f64; 3], v: &[f64; 3]| forward_dynamics(&arm, q, v, &effort);
            let (q, v) = (&state.position, &state.velocity);
            let (dq, dv) = increment(method, acceleration, 0.0, q, v, h);
            let (end, end_rate) = (truth.state().position, truth.state().velocity);
            for (told, estimate, from, to, step) in [
                ("rad", estimate.local_error, q, end, dq),
                ("rad/s", estimate.velocity_error, v, end_rate, dv),
            ] {
                let error = (0..3).map(|i| ((to[i] - from[i]) - step[i]).abs());
                let ratio = estimate / error.fold(0.0, f64::max);
                assert!((ratio - 1.0).abs() < 0.06, "{method} {h}: {ratio} {told}");
            }
            assert_eq!(estimate.error_per_second, estimate.local_error / h);
        }
    }
}

#[test]
fn a_diverged_simulation_has_no_estimate() {
    let gains = gains([1e9; 2], [0.0; 2], [0.0; 2]);
    let control = ControlLoop::new(Arm::default(), gains, Setpoint::at([1.0; 2]));
    let mut live = control.with_timestep(1.0).simulation(State::rest());
    live.advance(1_000_000);
    assert!(live.divergence().is_some());
    assert!(estimate(&live).is_none());
}
