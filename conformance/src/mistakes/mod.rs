//! The cause of a wrong answer: usual mistakes, each as an executable model.
//!
//! A diagnosis asks the server for one more answer, and compares it with the right model and with each wrong one. It names a
//! mistake only if that model is near, and every other model is [`RATIO`] times farther away.

#![allow(clippy::type_complexity, reason = "a model is a function of functions")]

pub mod equations;
pub mod measured;
pub mod steps;

use serde_json::json;

use crate::arm::{Arm, State};
use crate::bench::{Bench, Joints};
use crate::method::{METHODS, step};
use crate::rules::control_services::uneven;
use crate::values::numbers_of;

/// The least ratio between the distances of the second model and the best one.
pub const RATIO: f64 = 100.0;
/// The same for efforts of the running arm, which are measured and not computed.
pub const MEASURED_RATIO: f64 = 5.0;
/// Distances below this one are equal: rounding.
const FLOOR: f64 = 1e-12;
/// The largest distance of a computed model that explains an answer.
const NEAR: f64 = 1e-6;
/// A model of the arm that is farther away is not followed on.
const FAR: f64 = 1e-2;
/// The length of a step of the live arm in a diagnosis [s].
const STEP: f64 = 0.01;

/// A cause, and two series for a plot: the expected one and the server's.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Diagnosis {
    /// The mistake and the number that it rests on. `None`: no known mistake.
    pub cause: Option<String>,
    /// The series.
    pub plot: Option<[Vec<f64>; 2]>,
}

/// What an experiment tells about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// A method, by `/arm_sim/integration_step`.
    Method(&'static str),
    /// The live arm by a method.
    Motion(&'static str),
    /// The times of `/arm_sim/integration_step`.
    Times,
    /// Expressions.
    Expressions,
    /// The control law.
    Law,
    /// `/ik/solve`.
    Kinematics,
    /// The stay of a goal within `epsilon`.
    Dwell,
}

impl Subject {
    /// The subject of a rule. Rules about services and messages have none.
    #[must_use]
    pub fn of(rule: &str) -> Option<Self> {
        let (section, number) = rule.rsplit_once('-')?;
        let number: usize = number.parse().ok()?;
        match (section, number) {
            ("method", 1..=4) => METHODS.get(number - 1).copied().map(Self::Method),
            ("method", 6) => Some(Self::Method("rk4")),
            ("set_integrator", 6..=9) => METHODS.get(number - 6).copied().map(Self::Motion),
            ("dynamics", 2 | 3 | 5 | 6 | 7) | ("set_params", 8) | ("pause", 3) => Some(Self::Motion("rk4")),
            ("checkpoint", 2 | 4) => Some(Self::Times),
            ("goal", 11) => Some(Self::Dwell),
            ("function", 1..=7) => Some(Self::Expressions),
            ("law", 1..=7) | ("trajectory", _) | ("enable", 5 | 6) | ("reset", 4) => Some(Self::Law),
            ("ik", 1..=4 | 9..=11) => Some(Self::Kinematics),
            _ => None,
        }
    }

    /// Asks the server, whose arm is in the known state.
    ///
    /// # Errors
    /// If the server does not answer as the experiment needs.
    pub fn diagnose(self, bench: &mut Bench) -> Result<Diagnosis, String> {
        match self {
            Self::Method(method) => of_method(bench, method),
            Self::Motion(method) => of_motion(bench, method),
            Self::Times => measured::of_times(bench),
            Self::Dwell => measured::of_dwell(bench),
            Self::Expressions => measured::of_expressions(bench),
            Self::Law => measured::of_law(bench),
            Self::Kinematics => measured::of_kinematics(bench),
        }
    }
}

/// The largest relative difference; infinite for different lengths.
fn distance(got: &[f64], model: &[f64]) -> f64 {
    if got.len() != model.len() {
        return f64::INFINITY;
    }
    let each = got.iter().zip(model).map(|(got, model)| (got - model).abs() / (1.0 + model.abs()));
    each.fold(0.0, |far: f64, one| if one.is_nan() { f64::INFINITY } else { far.max(one) })
}

/// The cause, from the distance of the right model and of each wrong one. Two models that are the same in this experiment are both
/// named.
pub(crate) fn verdict(right: f64, models: Vec<(String, f64)>, near: f64, ratio: f64, floor: f64) -> Option<String> {
    let mut models = models;
    models.sort_by(|one, other| one.1.total_cmp(&other.1));
    let far = |at: usize| models.get(at).map_or(f64::INFINITY, |(_, far)| *far);
    let alike = if far(1) <= floor { 2 } else { 1 };
    let (best, second) = (far(0), far(alike).min(right));
    let says: Vec<&str> = models.iter().take(alike).map(|(says, _)| says.as_str()).collect();
    let is_it = best <= near && second >= ratio * best.max(floor);
    let says = says.join(", or ");
    is_it.then(|| format!("{says}: that model agrees to {best:.0e}, the next one and the right one differ by {second:.0e} or more"))
}

/// The force of the experiment on a method, its start, its timestep and its number of steps.
pub const PARTICLE: (fn(f64) -> f64, [f64; 2], f64, u32) = (|t| (3.0 * t).sin() + t * t - 1.0, [0.3, -0.2], 0.1, 20);

fn of_method(bench: &mut Bench, method: &'static str) -> Result<Diagnosis, String> {
    let (_, start, dt, steps) = PARTICLE;
    let [_, positions, velocities] = bench.integrate("sin(3*t) + t^2 - 1", [start[0], start[1], dt], steps, method)?;
    Ok(particle(method, &[positions, velocities].concat()))
}

/// The cause of these positions and velocities of the particle by a method.
#[must_use]
pub fn particle(method: &'static str, got: &[f64]) -> Diagnosis {
    let (f, start, dt, steps) = PARTICLE;
    let positions = got.split_at(got.len() / 2).0.to_vec();
    let right = steps::particle(|s, t, dt, f| step(method, s, t, dt, f), f, start, dt, steps);
    let plot = Some([right.iter().take(positions.len()).copied().collect(), positions]);
    let far = distance(got, &right);
    if far < 1e-4 && far > 1e-9 && got.iter().all(|value| is_single(*value)) {
        let cause = "the numbers have single precision (float32)".to_owned();
        return Diagnosis { cause: Some(format!("{cause}: each one is a float32, and they differ by {far:.0e}")), plot };
    }
    let mut models: Vec<(String, f64)> = Vec::new();
    for (says, step) in steps::steps(method) {
        models.push((format!("this is {says}"), distance(got, &steps::particle(step, f, start, dt, steps))));
    }
    let by = |f: fn(f64) -> f64, start| steps::particle(|s, t, dt, f| step(method, s, t, dt, f), f, start, dt, steps);
    models.push((
        "the angle of sin is taken for degrees".to_owned(),
        distance(got, &by(|t| (3.0 * t).to_radians().sin() + t * t - 1.0, start)),
    ));
    models.push(("x0 is not used".to_owned(), distance(got, &by(f, [0.0, start[1]]))));
    models.push(("xdot0 is not used".to_owned(), distance(got, &by(f, [start[0], 0.0]))));
    let longer = steps::particle(|s, t, dt, f| step(method, s, t, dt, f), f, start, dt, steps + 1);
    let (x, v) = longer.split_at(longer.len() / 2);
    let ahead = [x.get(1..).unwrap_or_default(), v.get(1..).unwrap_or_default()].concat();
    models.push(("the series starts one step late".to_owned(), distance(got, &ahead)));
    Diagnosis { cause: verdict(far, models, NEAR, RATIO, FLOOR), plot }
}

/// Whether a number can be one of single precision, to the last bit of its reading or in its shortest decimal form.
#[allow(clippy::cast_possible_truncation, reason = "this is what is looked for")]
fn is_single(value: f64) -> bool {
    let single = value as f32;
    (f64::from(single) - value).abs() <= f64::EPSILON * value.abs() || format!("{single}") == format!("{value}")
}

/// A free swing of an arm with different links.
fn of_motion(bench: &mut Bench, method: &'static str) -> Result<Diagnosis, String> {
    let arm = uneven(bench.links);
    bench.set_arm(&arm)?;
    bench.accepted("/arm_sim/set_integrator", &json!({"method": method, "timestep": STEP}))?;
    bench.swing()?;
    let states: Vec<State> = bench.joints_for(0.5)?.iter().map(Joints::state).collect();
    Ok(motion(&arm, method, &states))
}

/// The cause of these states of a free arm by a method at [`STEP`].
#[must_use]
pub fn motion(arm: &Arm, method: &'static str, states: &[State]) -> Diagnosis {
    let right_force = |_: f64, q: &[f64], v: &[f64]| arm.free_acceleration(q, v);
    let (right, expected) = followed(states, STEP, f64::INFINITY, &|s| step(method, s, 0.0, STEP, right_force));
    let got: Vec<f64> = states.iter().filter_map(|state| state.position.first().copied()).collect();
    let mut models = Vec::new();
    for (says, step) in steps::steps(method) {
        models.push((format!("this is {says}"), followed(states, STEP, FAR, &|s| step(s, 0.0, STEP, &right_force)).0));
    }
    for (says, equations) in equations::MISTAKES {
        let force = |_: f64, q: &[f64], v: &[f64]| equations.acceleration(arm, q, v, &vec![0.0; q.len()]);
        models.push((says.to_owned(), followed(states, STEP, FAR, &|s| step(method, s, 0.0, STEP, force)).0));
    }
    let short = followed(states, 0.1 * STEP, FAR, &|s| step(method, s, 0.0, 0.1 * STEP, right_force)).0;
    models.push(("the timestep is 0.001 s, whatever is asked for".to_owned(), short));
    let absolute: Vec<State> = states.iter().map(relative).collect();
    models.push(("the angles and rates in /joint_states are absolute".to_owned(), {
        followed(&absolute, STEP, FAR, &|s| step(method, s, 0.0, STEP, right_force)).0
    }));
    Diagnosis { cause: verdict(right, models, NEAR, RATIO, 1e-9), plot: Some([expected, got]) }
}

/// Differences of neighbours: absolute to relative.
fn relative(state: &State) -> State {
    let differences = |values: &[f64]| {
        let mut last = 0.0;
        values.iter().map(|value| value - std::mem::replace(&mut last, *value)).collect()
    };
    State { position: differences(&state.position), velocity: differences(&state.velocity) }
}

/// How far the states are from those of a model that starts at the first one, and the first joint of the model. A state is
/// compared with the nearest one of the next steps, because a server may publish at any rate.
fn followed(states: &[State], dt: f64, limit: f64, next: &dyn Fn(&State) -> State) -> (f64, Vec<f64>) {
    let Some(first) = states.first() else { return (f64::INFINITY, Vec::new()) };
    let (mut own, mut worst) = (first.clone(), 0.0_f64);
    let mut shown = vec![first.position.first().copied().unwrap_or(f64::NAN)];
    // The next 0.12 s.
    let window = if dt < STEP { 120 } else { 12 };
    for state in states.iter().skip(1) {
        let (mut best, mut at, mut candidate) = (f64::INFINITY, own.clone(), own.clone());
        for _ in 0..=window {
            let far = distance(&state.position, &candidate.position).max(distance(&state.velocity, &candidate.velocity));
            if far < best {
                (best, at) = (far, candidate.clone());
            }
            candidate = next(&candidate);
        }
        shown.push(at.position.first().copied().unwrap_or(f64::NAN));
        own = at;
        worst = worst.max(best);
        if worst > limit {
            break;
        }
    }
    // Without motion every model that stands still would agree.
    let moves = states.last().is_some_and(|last| distance(&last.position, &first.position) > 0.01);
    (if moves { worst } else { f64::INFINITY }, shown)
}

/// The numbers of an answer at a path.
pub(crate) fn solution(bench: &mut Bench, args: &serde_json::Value) -> Result<Vec<f64>, String> {
    let values = bench.accepted("/ik/solve", args)?;
    numbers_of(&values, "positions", bench.links)
}
