//! The findings of the README and of docs/study.md, run again with the searches and experiments behind them.

use std::sync::Arc;

use pendularm::math::arm::Arm;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::report::experiments::budget::Budget;
use pendularm::report::experiments::design::{SHORT, designed, limit, limit_of_pid, returned};
use pendularm::report::experiments::error::{OUTPUTS, free_swing, scenes};
use pendularm::report::experiments::solvers::{Explicit, Solver};
use pendularm::report::experiments::task::LOST;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::stability::limits;

use crate::planner::{falling, moving, plan};

const README: &str = include_str!("../../README.md");
const STUDY: &str = include_str!("../../docs/study.md");

/// The number after `before` in a document is `seen` rounded to `digits` digits.
fn agrees(paper: &str, before: &str, seen: f64, digits: i32) {
    let said = printed(paper, before);
    let last = 10_f64.powi(seen.abs().log10().floor() as i32 + 1 - digits);
    assert!(
        (said - seen).abs() <= 0.501 * last,
        "{before}{said}, seen {seen}"
    );
}

#[test]
fn the_timestep_and_the_evaluations_are_runs() {
    let all = scenes();
    let swing = all.iter().find(|scene| scene.name == "swing-2").unwrap();
    let duration = swing.task.duration;
    let evaluations = |method: Method| {
        let is_enough = |steps: &u64| swing.task.run(method, *steps, 1e-4).error <= 1e-4;
        let most = (0..).map(|halving| OUTPUTS << halving).find(is_enough);
        let fewest = swing.task.fewest(method, 1e-4, (1, most.unwrap()), 256);
        fewest.unwrap().evaluations as f64
    };
    let rk4 = evaluations(Method::Rk4);
    let steps = rk4 / f64::from(Method::Rk4.evaluations());
    agrees(README, "true motion with steps of ", duration / steps, 3);
    agrees(README, "RK4 takes ", rk4 / duration, 3);
    let verlet = evaluations(Method::Verlet) / rk4;
    agrees(README, "Verlet needs ", verlet, 3);
    let euler = evaluations(Method::Euler) / rk4;
    agrees(README, "as many, and Euler ", euler, 4);
}

#[test]
fn the_evaluations_of_the_baselines_are_runs() {
    let task = free_swing().task;
    let method = Arc::new(Explicit::dop853().unwrap());
    for (error, rk4, dop853) in [
        (1e-6, "within 10⁻⁶ rad RK4 takes ", "DOP853 "),
        (1e-9, "within 10⁻⁹ rad RK4 takes ", "DOP853 "),
    ] {
        let (_, after) = STUDY.split_once(rk4).unwrap();
        let fixed = Solver::Fixed(Method::Rk4);
        let fewest = task.fewest(fixed, error, (1, 1 << 21), 256).unwrap();
        let per_second = |evaluations: u64| (evaluations as f64 / task.duration).round();
        assert_eq!(printed(STUDY, rk4), per_second(fewest.evaluations));
        let tolerances = (4..=28).map(|half| 10_f64.powf(-0.5 * f64::from(half)));
        let solvers = tolerances.map(|it| Solver::Adaptive(method.clone(), it));
        let runs = solvers.map(|solver| task.run(solver, 1 << 12, LOST));
        let least = runs
            .filter(|run| run.error <= error)
            .map(|run| run.evaluations);
        assert_eq!(printed(after, dop853), per_second(least.min().unwrap()));
    }
}

#[test]
fn the_periods_of_the_designs_are_limits() {
    let continuous = designed(SHORT).unwrap();
    agrees(STUDY, "PID is stable up to ", limit_of_pid().unwrap(), 3);
    agrees(
        STUDY,
        "for continuous time is stable up to ",
        limit(&continuous),
        3,
    );
    let deviation = |period| returned(period, designed(period).as_ref()).1;
    let least = [1e-3, 2e-3, 5e-3]
        .map(deviation)
        .into_iter()
        .fold(1.0, f64::min);
    let period = printed(STUDY, "up to a control period of ");
    let [below, above] = [0.98, 1.02].map(|part| deviation(part * period) / least);
    assert!(below <= 1.1 && above > 1.1, "{below} {above}");
}

/// 2 s in 2048 steps: the power of two next to the default timestep.
#[test]
fn the_parts_of_the_error_are_runs() {
    let parts = Budget::new(true, 2.0).parts(&[Method::Rk4], 2048)[0];
    agrees(STUDY, "timestep and control period of ", parts.timestep, 3);
    agrees(STUDY, "kd 30, 12 is off by ", parts.hold, 2);
    agrees(STUDY, "because the effort is held, ", parts.truncation, 2);
    agrees(STUDY, "by RK4's truncation and ", parts.rounding, 2);
}

#[test]
fn the_printed_limits_are_those_of_the_loop() {
    let of = |method| {
        let setpoint = Setpoint::at([0.4, 0.8]);
        let control = ControlLoop::new(Arm::<2>::default(), Gains::default(), setpoint);
        limits(&control.with_method(method))
    };
    let (rk4, verlet) = (of(Method::Rk4), of(Method::Verlet));
    for (before, limit) in [
        ("stable up to a timestep of ", rk4.held),
        ("with RK4 and ", verlet.held),
        ("RK4 would be stable up to ", rk4.continuous),
        ("limit of all poses with held effort is ", rk4.minimum_held),
    ] {
        agrees(STUDY, before, limit.unwrap(), 3);
    }
}

/// The number that follows `before` in a document, in the unit that follows it.
fn printed(text: &str, before: &str) -> f64 {
    let parts = text.split_once(before);
    let (_, after) = parts.unwrap_or_else(|| panic!("{before}"));
    let mut words = after.split(|c: char| c.is_whitespace() || "*,;".contains(c));
    let mut number = words.next().unwrap().to_owned();
    if let Some((mantissa, power)) = number.clone().split_once("·10") {
        let place = |digit| "⁰¹²³⁴⁵⁶⁷⁸⁹⁻".chars().position(|one| one == digit).unwrap();
        let plain = |digit| "0123456789-".chars().nth(place(digit)).unwrap();
        let power: String = power.chars().map(plain).collect();
        number = format!("{mantissa}e{power}");
    }
    let unit = match words.next().map(|unit| unit.trim_end_matches('.')) {
        Some("ms") => 1e-3,
        Some("µs") => 1e-6,
        _ => 1.0,
    };
    let number = number.trim_end_matches('.').parse::<f64>();
    unit * number.unwrap_or_else(|why| panic!("{before}: {why}"))
}

/// The plans of docs/study.md are run again.
#[test]
fn the_plans_of_the_study_are_runs() {
    let (reach, _) = moving(Gains::default(), [0.8, -0.6], 4.0, 0.01);
    let fall = falling(Arm::default(), 10.0, 1e-6);
    for (task, before, method) in [
        (reach, "the plan is Euler with ", Method::Euler),
        (fall, "the plan is RK4 with ", Method::Rk4),
    ] {
        let planned = plan(task).unwrap();
        let best = planned.best;
        assert_eq!(best.method, method, "{planned:?}");
        let off = printed(STUDY, before) / best.timestep - 1.0;
        assert!(off.abs() < 5e-3, "{planned:?}");
    }
}
