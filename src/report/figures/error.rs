//! Error against time and timestep, in every scene and for every method.
//!
//! **Invariant:** every time is shown with the error of the same steps. Runs that are lost are drawn as lost, and no
//! value is interpolated between two runs.

use super::fit::slope;
use crate::math::count::in_f64;
use crate::math::integrator::Method;
use crate::report::experiments::error::{OUTPUTS, REACH, Scene, scenes};
use crate::report::experiments::task::{LOST, RunOutcome};
use crate::report::section::Section;
use crate::report::svg::{
    Axis, Curve, Key, Marker, Plot, Point, Unit, number, scientific, seconds,
};
use crate::report::timing::time;
use crate::study::matrix::largest;

/// Range of errors for a slope's fit \[rad\]: above it higher orders matter, below it rounding.
const ASYMPTOTIC: std::ops::Range<f64> = 1e-11..1e-3;

/// Resolution of the search for the fewest steps: one in this many.
const RESOLUTION: u64 = 256;

/// The lower end of the axis of errors \[rad\].
const LEAST_SHOWN: f64 = 1e-17;

/// The scenes in words, for both figures.
const SETTING: &str = "Links of 1 m and 1 kg move for 2 s under gravity of 9.81 m/s², from rest on the horizontal. The whirl \
     is without gravity: 2 links start at (0, 0.5), and the first joint turns at 10 rad/s. Reaches are of 2 links to \
     (0.8, -0.6) with kp 200, 100, ki 0 and kd 30, 12. The error is the largest of all joints and instants. For a reach \
     it is the distance from the loop with a continuous-time law. One mark per timestep: 2 s in 64 steps, in twice as \
     many, and so on, the same for all methods. A cross at the top edge is a run that diverged.";

/// A scene with its runs.
struct Data {
    scene: Scene,
    /// Runs with the timestep halved each time.
    runs: Vec<Run>,
    /// Time for the repeats of a run \[s\].
    timed: f64,
}

struct Run {
    method: Method,
    outcome: RunOutcome,
    /// The shortest time of its steps \[s\].
    time: f64,
}

pub(super) fn make(section: &mut Section) {
    let halvings = section.choose(15, 9);
    let timed = section.choose(0.05, 0.01);
    let scenes = scenes().into_iter();
    let data: Vec<Data> = scenes
        .map(|scene| Data::new(scene, halvings, timed))
        .collect();
    findings(section, &data);
    verdicts(section, &data);
    against_time(section, &data);
    against_timestep(section, &data);
}

impl Data {
    fn new(scene: Scene, halvings: u32, timed: f64) -> Self {
        let steps = (0..=halvings).map(|halving| OUTPUTS << halving);
        let both = steps.flat_map(|steps| Method::ALL.map(|method| (method, steps)));
        let runs = both.map(|(method, steps)| {
            let outcome = scene.task.run(method, steps, LOST);
            Run::of(&scene, method, outcome, timed)
        });
        Self {
            runs: runs.collect(),
            scene,
            timed,
        }
    }

    fn of(&self, method: Method) -> impl Iterator<Item = &Run> {
        self.runs.iter().filter(move |run| run.method == method)
    }

    /// The run of a method that keeps within `error` with the fewest steps.
    fn cost(&self, method: Method, error: f64) -> Option<Run> {
        let mut outcomes = self.of(method).map(|run| run.outcome);
        let enough = outcomes.find(|it| it.error <= error)?;
        let task = &self.scene.task;
        let fewest = task.fewest(method, error, (1, enough.steps), RESOLUTION)?;
        Some(Run::of(&self.scene, method, fewest, self.timed))
    }

    fn order(&self, method: Method) -> Option<f64> {
        let inside = self
            .of(method)
            .map(|run| (run.outcome.timestep, run.outcome.error));
        let inside: Vec<_> = inside.filter(|run| ASYMPTOTIC.contains(&run.1)).collect();
        // The four smallest timesteps: near the stability limit an error decreases faster than by its order.
        slope(inside.into_iter().rev().take(4))
    }

    /// Median time of an evaluation \[s\], in runs long enough to time one.
    fn evaluation_time(&self) -> Option<f64> {
        let long = self.runs.iter().filter(|run| run.outcome.steps >= 1000);
        let times = long.map(|run| run.time / run.evaluations());
        let mut times: Vec<f64> = times.collect();
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied()
    }
}

impl Run {
    fn of(scene: &Scene, method: Method, outcome: RunOutcome, timed: f64) -> Self {
        let time = time(timed, || scene.task.replay(method, outcome.steps));
        Self {
            method,
            outcome,
            time,
        }
    }

    fn evaluations(&self) -> f64 {
        in_f64(self.outcome.evaluations)
    }
}

fn of<'a>(data: &'a [Data], name: &str) -> Option<&'a Data> {
    data.iter().find(|data| data.scene.name == name)
}

/// A panel for each scene. All share the error axis, so that scenes can be compared. `place` returns the x of a run.
fn plots(data: &[Data], x: &Axis, place: impl Fn(&Run) -> f64) -> Vec<Plot> {
    let plot = |data: &Data| {
        let y = Axis::log("largest error [rad]", Unit::Number, (LEAST_SHOWN, 10.0));
        let mut plot = Plot::new(data.scene.title, x.clone(), y);
        let rounding = Key::line("soft", "rounding: one unit in the last place of 1 rad").dashed();
        let ends = [x.min, x.max].map(|x| (x, f64::EPSILON));
        plot.add(Curve::line(rounding, ends));
        plot.with(Method::ALL.map(|method| {
            let points = data.of(method).map(|run| {
                let RunOutcome {
                    timestep,
                    error,
                    evaluations,
                    ..
                } = run.outcome;
                let times = [seconds(timestep), seconds(run.time)].join(" in ");
                let note = format!("dt {times}, {evaluations} evaluations");
                // An error of exactly 0 has no logarithm: it is drawn at the lower edge.
                Point::new(place(run), error.max(LEAST_SHOWN), note)
            });
            Curve::line(Key::of(method), points)
        }))
    };
    data.iter().map(plot).collect()
}

fn against_time(section: &mut Section, data: &[Data]) {
    let all = data.iter().flat_map(|data| &data.runs);
    let times = all.map(|run| run.time);
    let x = Axis::around("time for the whole run", Unit::Seconds, times);
    let mut plots = plots(data, &x, |run| run.time);
    for (plot, data) in plots.iter_mut().zip(data) {
        plot.above = data.evaluation_time().map(|time| (time, "evaluations"));
    }
    let swing = of(data, "swing-2");
    let cost = |method| swing.and_then(|data| data.cost(method, 1e-6));
    let title = match (cost(Method::Rk4), cost(Method::Verlet), swing) {
        (Some(rk4), Some(verlet), Some(data)) => format!(
            "An error of 10⁻⁶ rad costs RK4 {} and Verlet {} of computing time for {} s of a free swing",
            seconds(rk4.time),
            seconds(verlet.time),
            number(data.scene.task.duration)
        ),
        _ => "Error against time".to_owned(),
    };
    section.figure(
        "work-precision-time",
        &title,
        &format!(
            "{SETTING} Time is the processor time of one thread, and the minimum of repeats. Upper scale: evaluations \
             of the dynamics, at the median time of one in that scene. Each mark's tooltip has its own evaluations."
        ),
        &plots,
    );
}

fn against_timestep(section: &mut Section, data: &[Data]) {
    let all = data.iter().flat_map(|data| &data.runs);
    let timesteps = all.map(|run| run.outcome.timestep);
    let x = Axis::around("timestep", Unit::Seconds, timesteps);
    let mut plots = plots(data, &x, |run| run.outcome.timestep);
    for (plot, data) in plots.iter_mut().zip(data) {
        let ends = [plot.y.min, plot.y.max];
        let limits = data.scene.limits.iter().flat_map(|&(method, limit)| {
            // Limits are almost equal, so each mark has its own height.
            let mark = [(limit, 1e-3 * 0.01_f64.powi(method as i32))];
            let line = Key::predicted(method).marked(Marker::None);
            let line = Curve::line(line, ends.map(|y| (limit, y)));
            [line, Curve::dots(Key::predicted(method), mark)]
        });
        let (corner, key) = (
            x.max / 60.0,
            Key::line("ink", "slopes of orders 1, 2 and 4"),
        );
        let strokes = [1e1, 1e2, 1e4].map(|rise| {
            Curve::line(
                key.clone(),
                [(corner, 1e-14), (10.0 * corner, 1e-14 * rise)],
            )
        });
        plot.curves.extend(limits.chain(strokes));
    }
    let held = data.iter().find(|data| data.scene.is_held);
    let order = |method| {
        let order = held.and_then(|data| data.order(method));
        order.map_or_else(|| "?".to_owned(), |order| format!("{order:.2}"))
    };
    section.figure(
        "convergence",
        &format!(
            "Every method converges at its order, unless the effort is held: then RK4's is {} and Verlet's {}",
            order(Method::Rk4),
            order(Method::Verlet)
        ),
        &format!(
            "{SETTING} The slope is the order of the method. Dashed upright lines: the predicted largest stable \
             timestep at the setpoint. Its hollow mark is that of the method."
        ),
        &plots,
    );
}

fn findings(section: &mut Section, data: &[Data]) {
    let swing = of(data, "swing-2");
    let cost = |method| swing.and_then(|swing| swing.cost(method, 1e-4));
    if let (Some(swing), Some(rk4), Some(verlet)) = (swing, cost(Method::Rk4), cost(Method::Verlet))
    {
        let times = |other: f64| number(other / rk4.evaluations());
        // Euler takes an evaluation a step.
        let euler = cost(Method::Euler).map(|euler| times(euler.evaluations()));
        let most = swing
            .of(Method::Euler)
            .map(Run::evaluations)
            .fold(0.0, f64::max);
        let euler = euler.unwrap_or_else(|| format!("over {}", times(most)));
        section.findings.push(format!(
            "**RK4 keeps a free 2-link swing of {} s within 10⁻⁴ rad of the true motion with steps of {}**. The swing \
             begins at the starting pose. RK4 takes {} evaluations of the dynamics per simulated second. Verlet needs \
             {} times as many, and Euler {euler} times.",
            number(swing.scene.task.duration),
            seconds(rk4.outcome.timestep),
            number((rk4.evaluations() / swing.scene.task.duration).round()),
            times(verlet.evaluations()),
        ));
    }
    let held = of(data, "reach-held");
    // 2 s in 2048 steps: the power of two next to the default timestep.
    let at = |method| held.and_then(|held| held.of(method).find(|run| run.outcome.steps == 2048));
    if let (Some(rk4), Some(verlet)) = (at(Method::Rk4), at(Method::Verlet)) {
        section.findings.push(format!(
            "**On a reach with an effort that is held for each step, RK4 is no better than Verlet**. Against a law \
             that acts at every instant, RK4 is {} rad off and Verlet {} rad. The motion is {REACH}, at a timestep of {}.",
            scientific(rk4.outcome.error),
            scientific(verlet.outcome.error),
            seconds(rk4.outcome.timestep)
        ));
    }
}

fn verdicts(section: &mut Section, data: &[Data]) {
    let all = data
        .iter()
        .flat_map(|data| Method::ALL.map(|method| (data, method)));
    let fitted = all.filter_map(|(data, method)| {
        let expected = if data.scene.is_held {
            1.0
        } else {
            f64::from(method.order())
        };
        let order = data.order(method)?;
        let title = data.scene.title;
        Some((
            (order - expected).abs(),
            format!("{method} in {title}, {order:.2} for {expected:.0}"),
        ))
    });
    let furthest = fitted.max_by(|one, other| one.0.total_cmp(&other.0));
    let (off, seen) = furthest.unwrap_or((f64::INFINITY, "no slope fitted".to_owned()));
    section.claim(
        "Every method converges at its order, and at order 1 where the effort is held (slopes within 0.35)",
        format!("furthest off: {seen}"),
        off <= 0.35,
    );
    let errors = data
        .iter()
        .flat_map(|data| &data.runs)
        .map(|run| run.outcome.error);
    let smallest = errors
        .filter(|error| *error > 0.0)
        .fold(f64::INFINITY, f64::min);
    let uncertainty = largest(data.iter().map(|data| data.scene.task.uncertainty));
    section.claim(
        "References are at least 100 times better known than the smallest error shown",
        format!(
            "uncertainty at most {}, smallest error {}",
            scientific(uncertainty),
            scientific(smallest)
        ),
        uncertainty * 100.0 <= smallest,
    );
}
