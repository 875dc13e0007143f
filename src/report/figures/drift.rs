//! Energy of a long free swing.
//!
//! **Invariant:** drift is divided by the arm's energy scale, never by its energy, which is 0 at the start.

use crate::math::arm::{Arm, State};
use crate::math::integrator::Method;
use crate::report::experiments::chaos::energy_drift;
use crate::report::experiments::solvers::Solver;
use crate::report::section::Section;
use crate::report::svg::{Axis, Curve, Key, Marker, Plot, Unit, number, one_digit, seconds};

const TIMESTEP: f64 = 1e-3;

/// Swings of the ensemble.
const ENSEMBLE: u32 = 8;

/// Largest energy error so far by time.
type Drift = Vec<(f64, f64)>;

/// The drifts of all methods and of implicit midpoint, a baseline.
struct Swing {
    title: &'static str,
    methods: [Drift; Method::ALL.len()],
    baseline: Drift,
}

impl Swing {
    fn of<const N: usize>(title: &'static str, angles: [f64; N], duration: f64) -> Self {
        let (arm, start) = (Arm::default(), State::at_rest(angles));
        Self {
            title,
            methods: Method::ALL.map(|it| energy_drift(&arm, &start, it, TIMESTEP, duration)),
            baseline: energy_drift(&arm, &start, Solver::ImplicitMidpoint, TIMESTEP, duration),
        }
    }

    fn end(&self, method: Method) -> f64 {
        let drift = self.methods.get(method as usize).and_then(|it| it.last());
        drift.map_or(f64::NAN, |point| point.1)
    }

    /// Whether the better method keeps energy better. A diverged run of Euler counts by its last value.
    fn is_ordered(&self) -> bool {
        let order_two = self.end(Method::Midpoint).min(self.end(Method::Verlet));
        let euler = self.end(Method::Euler);
        self.end(Method::Rk4) < order_two && (order_two < euler || !euler.is_finite())
    }
}

pub(super) fn make(section: &mut Section) {
    let duration = section.choose(1000.0, 60.0);
    let regular = [0.3 - std::f64::consts::FRAC_PI_2, 0.0];
    let swings = [
        Swing::of("Regular swing, 2 links from 0.3 rad", regular, duration),
        Swing::of("Chaotic swing, 2 links from horizontal", [0.0; 2], duration),
        Swing::of("Chaotic swing, 3 links from horizontal", [0.0; 3], duration),
    ];
    let [regular, chaotic, _] = &swings;
    let headline = format!(
        "Verlet keeps energy to {} on a regular swing but only to {} on a chaotic one; RK4 to {}",
        one_digit(regular.end(Method::Verlet)),
        one_digit(chaotic.end(Method::Verlet)),
        one_digit(chaotic.end(Method::Rk4))
    );
    section.findings.push(format!(
        "**The energy error of a chaotic 2-link swing of {} s at {} is {} with Verlet, {} with midpoint and {} with \
         RK4**. It is relative to the energy between the hanging and the upright arm. The figures are from {ENSEMBLE} \
         swings that start horizontally, a billionth of a radian apart. This Verlet is not symplectic, because the \
         forces of an arm depend on velocity.",
        number(duration),
        seconds(TIMESTEP),
        ends_of_ensemble(Method::Verlet, duration),
        ends_of_ensemble(Method::Midpoint, duration),
        ends_of_ensemble(Method::Rk4, duration)
    ));
    section.claim(
        "At 1 ms RK4 has the smallest energy error, then the methods of order 2, then Euler, in all three swings",
        headline.clone(),
        swings.iter().all(Swing::is_ordered),
    );
    // The error of a symmetric method is bounded on a regular swing. A tenth of the time is enough to reach the bound.
    let mut late = regular
        .baseline
        .iter()
        .skip_while(|point| point.0 < 0.1 * duration);
    let growth = late
        .next()
        .zip(late.last())
        .map_or(f64::NAN, |(tenth, end)| end.1 / tenth.1);
    section.claim(
        "The energy error of implicit midpoint does not grow on the regular swing (at most by half over the last nine \
         tenths of the time)",
        format!("to {} times that of the first tenth", number(growth)),
        growth <= 1.5,
    );
    figure(section, &headline, swings, duration);
}

fn figure(section: &mut Section, headline: &str, swings: [Swing; 3], duration: f64) {
    let x = Axis::log("simulated time [s]", Unit::Number, (1e-3, duration));
    let y = "largest energy error so far / scale";
    let y = Axis::log(y, Unit::Number, (1e-17, 1e2));
    let panels =
        swings.map(|swing| {
            let keys = Method::ALL.map(Key::of);
            let baseline = Key::line("ink", "implicit midpoint").marked(Marker::Down);
            let curves = keys.into_iter().chain([baseline]);
            let drifts = swing.methods.into_iter().chain([swing.baseline]);
            let plot = Plot::new(swing.title, x.clone(), y.clone());
            plot.with(curves.zip(drifts).map(|(key, drift)| {
                Curve::line(key, drift.into_iter().filter(|point| point.1 > 0.0))
            }))
        });
    section.figure(
        "energy-drift",
        headline,
        "Free swings from rest at a timestep of 1 ms, whose energy should stay constant. The regular one starts 0.3 rad \
         from hanging. The scale is the arm's largest change \
         of potential energy plus its kinetic energy at the start. A line that ends early is a run that diverged. \
         Implicit midpoint is a baseline of this report: it is symmetric in time, and on the regular swing its error does \
         not grow.",
        &panels,
    );
}

/// The least and the largest energy error that the 2-link chaotic swing ends with, of swings let go a billionth of a
/// radian apart. Each has one digit: chaos leaves no more.
fn ends_of_ensemble(method: Method, duration: f64) -> String {
    let ends = (0..ENSEMBLE).map(|index| {
        let start = State::at_rest([1e-9 * f64::from(index), 0.0]);
        let points = energy_drift(&Arm::<2>::default(), &start, method, TIMESTEP, duration);
        points.last().map_or(f64::NAN, |point| point.1)
    });
    let ends = ends.fold((f64::INFINITY, 0.0), |(least, most): (f64, f64), end| {
        (least.min(end), most.max(end))
    });
    let (least, most) = (one_digit(ends.0), one_digit(ends.1));
    if least == most {
        return least;
    }
    format!("{least} to {most}")
}
