//! The report's experiments: stiffness, large motions, uneven arms. Each gives the result that theory predicts.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::report::experiments::conditioning::{PoseShape, digits_lost};
use pendularm::report::experiments::design::{
    Feedback, SHORT, designed, limit, limit_of_pid, returned,
};
use pendularm::report::experiments::error::free_swing;
use pendularm::report::experiments::nonlinear::{
    PeriodicSwing, arrives, is_carried, move_of, spun,
};
use pendularm::report::experiments::reference::{Law, ReferenceMotion};
use pendularm::report::experiments::solvers::{Explicit, Solver};
use pendularm::report::experiments::stiff::{StiffScene, Stiffness};
use pendularm::report::experiments::task::LOST;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::linear::Linear;
use pendularm::study::stability::{Sampling, step_matrix};
use pendularm::study::tableau::Pair;

/// Orders without stiffness, and an error that hardly depends on stiffness.
#[test]
fn implicit_baselines_have_their_orders_and_do_not_see_stiffness() {
    let soft = StiffScene::new(Stiffness::Brake, 1.0);
    for (solver, order) in [(Solver::ImplicitMidpoint, 2.0), (Solver::Rodas3, 3.0)] {
        let error = |steps| soft.task.run(solver.clone(), steps, LOST).error;
        let seen = (error(512) / error(1024)).log2();
        assert!((seen - order).abs() < 0.2, "{solver:?}: {seen}");
    }
    let stiff = StiffScene::new(Stiffness::Brake, 1e5);
    assert!(stiff.task.uncertainty < 1e-6, "{}", stiff.task.uncertainty);
    for solver in [Solver::ImplicitMidpoint, Solver::Rodas3] {
        let run = stiff.task.run(solver.clone(), 512, LOST);
        assert!(run.error < 1e-3, "{solver:?} {run:?}");
    }
    // The explicit ones have to follow the elbow's rate, and nothing faster. Euler's swing grows before.
    for solver in [Method::Midpoint, Method::Verlet, Method::Rk4].map(Solver::Fixed) {
        let fewest = stiff.fewest_stable_steps(&solver).unwrap() / 8.0;
        let run = |part| {
            stiff
                .task
                .run(solver.clone(), 8 * (part * fewest) as u64, LOST)
        };
        let (few, enough) = (run(0.99).error, run(1.01).error);
        assert!(few >= 1e-2 && enough < 1e-2, "{few} {enough} {solver:?}");
    }
}

/// The fast motion of an undamped spring: implicit midpoint keeps its energy at any step, Rodas3 removes it, and RK4 is
/// stable up to √8 radians per step.
#[test]
fn a_stiff_spring_keeps_its_energy_loses_it_or_diverges() {
    let spring = StiffScene::new(Stiffness::Spring, 1e3);
    let fewest = spring.fewest_stable_steps(&Solver::Fixed(Method::Rk4));
    let fewest = fewest.unwrap();
    let energy = |solver, part: f64| spring.fast_energy(solver, (part * fewest) as u64);
    let midpoint = energy(Solver::ImplicitMidpoint, 1.0);
    assert!((midpoint - 1.0).abs() < 0.1, "{midpoint}");
    assert!(energy(Solver::Rodas3, 1.0) < 0.01);
    for (part, is_kept) in [(0.9, false), (1.02, true)] {
        let rk4 = energy(Solver::Fixed(Method::Rk4), part);
        assert_eq!(rk4 < 1.0, is_kept, "{part}: {rk4}");
    }
    // Resolved, all have it.
    for solver in [Solver::Rodas3, Solver::Fixed(Method::Rk4)] {
        let resolved = energy(solver.clone(), 50.0);
        assert!((resolved - 1.0).abs() < 0.05, "{solver:?}: {resolved}");
    }
}

/// Every scene has the elbow's rate that it names: below RK4's limit by it the run is lost, and above it is not.
#[test]
fn every_kind_of_stiffness_limits_rk4_as_its_rate_says() {
    for kind in Stiffness::ALL {
        let scene = StiffScene::new(kind, 1e3);
        assert!(
            (scene.ratio / 1e3).log10().abs() < 1.0,
            "{kind:?} {}",
            scene.ratio
        );
        assert!(
            scene.task.uncertainty < 1e-6,
            "{kind:?} {}",
            scene.task.uncertainty
        );
        let rk4 = Solver::Fixed(Method::Rk4);
        let fewest = scene.fewest_stable_steps(&rk4).unwrap() / 8.0;
        let run = |part: f64| {
            scene
                .task
                .run(rk4.clone(), 8 * (part * fewest) as u64, LOST)
        };
        let (few, enough) = (run(0.9).error, run(1.1).error);
        assert!(few > 1e-4 && enough < 1e-4, "{kind:?}: {few} {enough}");
    }
}

/// The published orders of the adaptive baselines: a tolerance a thousandfold smaller takes as many more steps as the order
/// says, and the error follows the tolerance.
#[test]
fn adaptive_baselines_follow_their_tolerance() {
    let task = free_swing().task;
    let dormand_prince5 = Arc::new(Explicit::dormand_prince5().unwrap());
    let dop853 = Arc::new(Explicit::dop853().unwrap());
    for (method, order, steps) in [(dormand_prince5, 5.0, 256), (dop853, 8.0, 64)] {
        let run = |tolerance| task.run(Solver::Adaptive(method.clone(), tolerance), 4096, LOST);
        let [coarse, fine] = [1e-6, 1e-12].map(run);
        let more = (fine.steps as f64 / coarse.steps as f64).log10();
        assert!((more / 6.0 * order - 1.0).abs() < 0.25, "{order}: {more}");
        assert!(
            coarse.error < 1e-4 && fine.error < 1e-9,
            "{order}: {coarse:?} {fine:?}"
        );
        // In equal steps the error shows at least the order; a misprint would lower it.
        let error = |steps| {
            task.run(Solver::Explicit(method.clone()), steps, LOST)
                .error
        };
        let seen = (error(steps) / error(2 * steps)).log2();
        assert!(seen > order - 0.5, "{order}: {seen}");
    }
    let taylor = task.run(Solver::Taylor(1e-12), 4096, LOST);
    assert!(taylor.error < 1e-9, "{taylor:?}");
    // Too few steps to reach the end.
    assert!(task.run(Solver::Taylor(1e-12), 2, LOST).error.is_infinite());
}

/// Semi-implicit Euler has order 1, and a tableau in equal steps gives the live arm's error.
#[test]
fn tableaus_in_equal_steps_are_methods() {
    let task = free_swing().task;
    let explicit = |pair| Solver::Explicit(Arc::new(Explicit::new(pair)));
    let error = |solver: &Solver, steps| task.run(solver.clone(), steps, LOST);
    let semi = explicit(Pair::semi_implicit());
    let seen = (error(&semi, 4096).error / error(&semi, 8192).error).log2();
    assert!((seen - 1.0).abs() < 0.1, "{seen}");
    for method in Method::ALL {
        let [own, live] = [explicit(Pair::of(method)), Solver::Fixed(method)];
        let (own, live) = (error(&own, 2048), error(&live, 2048));
        assert!((own.error / live.error - 1.0).abs() < 1e-4, "{method}");
        assert_eq!(own.evaluations, live.evaluations, "{method}");
    }
}

/// The design for continuous time and that for the period, against their eigenvalues and the arm itself.
#[test]
fn a_design_for_the_period_holds_where_the_others_do_not() {
    let continuous = designed(SHORT).unwrap();
    let limit = limit(&continuous);
    let pid = limit_of_pid().unwrap();
    assert!((pid / 8.21e-3 - 1.0).abs() < 1e-3, "{pid}");
    let off = |period, gains: Option<&Feedback>| returned(period, gains).1;
    assert!(off(0.95 * limit, Some(&continuous)) < 0.1);
    let beyond = 1.3 * limit.max(pid);
    let own = designed(beyond).unwrap();
    let (fixed, sampled) = (off(beyond, Some(&continuous)), off(beyond, None));
    let best = off(beyond, Some(&own));
    assert!(
        best < 0.1 && fixed > 2.0 * best && sampled > 2.0 * best,
        "{best} {fixed} {sampled}"
    );
}

/// A swing that is hardly one is the linear one: its multipliers are powers of the eigenvalues of a step.
#[test]
fn the_multipliers_of_a_small_swing_are_those_of_its_linearisation() {
    let swing = PeriodicSwing::of(1e-3).unwrap();
    let free = ControlLoop::free(Arm::<2>::default());
    let linear = Linear::at(&free, &[-FRAC_PI_2, 0.0], &[false; 2]);
    for method in Method::ALL {
        let steps = 64;
        let h = swing.period / f64::from(steps);
        let step = step_matrix(&linear, method, Sampling::Continuous, h);
        // The faster of the two modes is the one beside the swing.
        let values = step.eigenvalues();
        let fastest = values
            .iter()
            .max_by(|a, b| a.im.abs().total_cmp(&b.im.abs()));
        let expected = fastest.unwrap().modulus().powi(64);
        let seen = swing.transverse(method, steps);
        let is_same = (seen / expected - 1.0).abs() < 1e-3;
        assert!(is_same, "{method}: {seen} for {expected}");
    }
}

#[test]
fn moves_and_swings_are_lost_at_long_steps_only() {
    for method in Method::ALL {
        let moves = [1e-3, 1.5e-2].map(|h| arrives(&move_of(1.0, method, h)));
        assert_eq!(moves, [true, false], "{method}");
        let free = ControlLoop::free(Arm::default()).with_method(method);
        let swings = [(10.0, 1e-3), (300.0, 0.1)];
        let swings = swings.map(|(spin, h)| is_carried(&free.with_timestep(h), spun(spin)));
        assert_eq!(swings, [true, false], "{method}");
    }
}

/// A link folded back onto the one before, under a tip a billion times heavier: the loss lies in the angles' last bits.
#[test]
fn folded_arms_with_a_heavy_tip_lose_what_the_angles_have_lost() {
    let arm = Arm::new([1.0; 3], [1.0, 1.0, 1e9], 9.81).unwrap();
    let lost = digits_lost(&arm, PoseShape::Folded.samples(200));
    assert!(lost.inherent > 6.0, "{lost:?}");
    assert!(lost.recursion < lost.inherent + 2.5, "{lost:?}");
}

/// After 26 s of chaos 61 µs are off by 2.6e-3 rad and 10 µs by some 6e-6: truncation, not the digits of a double, makes the error.
#[test]
fn at_26_seconds_a_sixth_of_the_timestep_is_hundreds_of_times_nearer() {
    let arm = Arm::<2>::default();
    let truth = ReferenceMotion::new(&arm, &State::rest(), &Law::FREE, 26.0);
    let off = |timestep: f64, every: u64| {
        let control = ControlLoop::free(arm).with_timestep(timestep);
        let mut live = control.simulation(State::rest());
        assert_eq!(live.advance(every), every);
        truth.angle_error(26.0, &live.state().position)
    };
    let coarse = off(0.5_f64.powi(14), 26 << 14);
    let fine = off(1e-5, 2_600_000);
    assert!((coarse / 2.6e-3 - 1.0).abs() < 0.05, "{coarse:e}");
    // Rounding has a part in this one, and chaos magnifies it.
    assert!((1e-6..2e-5).contains(&fine), "{fine:e}");
}

/// The swing that begins at small amplitude is stable up to 1.89 rad. A secant search would jump to another orbit at 1.5 rad.
#[test]
fn a_periodic_swing_is_continued_in_amplitude() {
    let swing = PeriodicSwing::of(1.5).unwrap();
    let elbow = swing.start.position[1];
    let is_same = (elbow + 0.48957).abs() < 1e-5 && (swing.period - 2.57052).abs() < 1e-5;
    assert!(is_same, "{swing:?}");
    for (amplitude, modulus) in [
        (1.5, 1.0),
        (1.8, 1.0),
        (1.89, 1.0),
        (1.9, 1.68),
        (2.0, 10.35),
    ] {
        let swing = PeriodicSwing::of(amplitude).unwrap();
        let seen = swing.transverse(Method::Rk4, 4096);
        let is_same = (seen / modulus - 1.0).abs() < 5e-3;
        assert!(is_same, "{amplitude}: {seen} {swing:?}");
    }
}
