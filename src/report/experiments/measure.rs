//! The largest stable timestep, measured on the arm itself: a small deviation from its equilibrium decays or grows.
//!
//! Held control runs through [`Simulation`], the live loop; control in every stage through [`ContinuousLoop`], where
//! the method steps the arm and its law as one system. Stable means that the deviation decays. Overflow is not the
//! criterion: just past the limit a nonlinear arm chatters between two poses without end. Decay is judged by energy,
//! `½ v M v + ½ x (Kp + ∂G/∂q) x`, which a loop with damping can only lose. A single joint may move further off for a
//! while.
//!
//! **Invariant:** no prediction enters a measurement but the equilibrium and a value to start the search from.

use std::fmt;

use crate::math::arm::{Arm, State};
use crate::math::dynamics::{gravity_load, mass_matrix};
use crate::math::pid::{Gains, Setpoint};
use crate::math::sensors::{Sensors, VelocitySource};
use crate::math::simulation::{Checkpoint, ControlPeriod, Held, Memory, Simulation};
use crate::study::beside::Steppable;
use crate::study::continuous::ContinuousLoop;
use crate::study::control_loop::ControlLoop;
use crate::study::linear::{Equilibrium, Linear, equilibrium, gravity_gradient};
use crate::study::stability::{Sampling, Stepping, bisect, largest_timestep};

/// Control periods of a run: a mode that is off the unit circle by 0.1 % changes 50-fold in this time.
pub const STEPS: u64 = 4000;

/// The initial deviation \[rad\]: small enough for linear behaviour, and a billion units of rounding.
const NUDGE: f64 = 1e-6;

/// A deviation, or a velocity times the control period, that counts as growth \[rad\]: two thousand times the initial
/// one, and still less than the chatter past a limit.
const ESCAPED: f64 = 2e-3;

/// A deviation that has decayed \[rad\]: a hundred thousand units of rounding. Below it rounding would be compared.
const DEAD: f64 = 1e-11;

/// Halvings of the search interval; the last one is narrower than 0.005 %.
const HALVINGS: u32 = 15;

/// Widenings of the search interval before the search is given up.
const WIDENINGS: u32 = 12;

/// A limit of a loop \[s\], predicted and measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitPair {
    /// By the linearised loop; none where no timestep is stable, or none limits.
    pub predicted: Option<f64>,
    /// By the arm itself, searched around the prediction; none if no value within a factor of about a thousand of it
    /// separates decay from growth.
    pub measured: Option<f64>,
}

impl LimitPair {
    /// Of the timestep, with the law held for a step or in every stage.
    pub fn of_timestep<const N: usize>(control: &ControlLoop<N>, sampling: Sampling) -> Self {
        let linear = Linear::at_setpoint(control);
        let predicted = largest_timestep(&linear, control.method, sampling);
        Self::of(predicted, |timestep| {
            growth(&control.with_timestep(timestep), sampling)
        })
    }

    /// Of the control period, with `substeps` steps of the method in each; every effort acts `delay` periods late.
    pub fn of_period<const N: usize>(control: &ControlLoop<N>, substeps: u32, delay: u8) -> Self {
        let linear = Linear::at_setpoint(control);
        let stepping = Stepping::held(&linear, control.method, substeps, delay);
        Self::of(stepping.limit(), |period| {
            let control = in_substeps(&control.with_timestep(period), substeps, delay);
            growth(&control, Sampling::Held)
        })
    }

    fn of(predicted: Option<f64>, growth: impl Fn(f64) -> Option<f64>) -> Self {
        let predicted = predicted.filter(|limit| *limit > 0.0);
        // The prediction itself is not among the tried values.
        let measure = |predicted: f64| boundary(0.9 * predicted, |limit| decays(growth(limit)));
        Self {
            predicted,
            measured: predicted.and_then(measure),
        }
    }

    /// Relative difference of the measured limit from the predicted one; `None` without a limit.
    pub fn off(&self) -> Option<f64> {
        let measured = self.measured.unwrap_or(f64::INFINITY);
        Some((measured / self.predicted? - 1.0).abs())
    }

    /// Whether both exist and agree to 1 %.
    pub fn agrees(&self) -> bool {
        self.off().is_some_and(|off| off < 0.01)
    }
}

impl fmt::Display for LimitPair {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [predicted, measured] = [self.predicted, self.measured].map(short);
        write!(f, "predicted {predicted} s, measured {measured} s")
    }
}

/// A limit as text for a table.
pub(super) fn short(value: Option<f64>) -> String {
    value.map_or_else(|| "none".to_owned(), |value| format!("{value:.4e}"))
}

/// Whether a deviation with this growth of its energy dies out.
pub fn decays(growth: Option<f64>) -> bool {
    growth.is_some_and(|growth| growth < 1.0)
}

/// The 2-link arm with the default gains stiffened by `factor`: kp by it, kd by its root, ki by its power of 3/2.
pub fn stiffened(factor: f64) -> ControlLoop<2> {
    let Gains { kp, ki, kd } = Gains::<2>::default();
    let gains = Gains {
        kp: kp.map(|kp| kp * factor),
        ki: ki.map(|ki| ki * factor.powf(1.5)),
        kd: kd.map(|kd| kd * factor.sqrt()),
    };
    ControlLoop::new(Arm::default(), gains, Setpoint::at([0.4, 0.8]))
}

/// Largest energy of the deviation in the last eighth of the periods, per largest in the second eighth. The first
/// eighth is skipped, in which the fast modes decay. Zero once the deviation has decayed, `None` once it has escaped.
pub fn growth<const N: usize>(control: &ControlLoop<N>, sampling: Sampling) -> Option<f64> {
    const WINDOW: u64 = STEPS / 8;
    let rest = equilibrium(control);
    let start = nudged(control, &rest.position);
    let energy_of = energy_about(control, &rest.position);
    let (mut run, every): (Box<dyn Steppable<N>>, u64) = match sampling {
        Sampling::Held => {
            let every = control.period.steps(control.timestep);
            (Box::new(live_at(control, &rest, start)), every)
        }
        Sampling::Continuous => {
            let run = ContinuousLoop::new(*control, start, rest.integral);
            (Box::new(run), 1)
        }
    };
    let (mut early, mut late) = (0.0_f64, 0.0_f64);
    for period in 0..STEPS {
        if run.advance(every) < every {
            return None;
        }
        let energy = energy_of(run.state())?;
        if energy == 0.0 {
            return Some(0.0);
        }
        if period / WINDOW == 1 {
            early = early.max(energy);
        } else if period >= STEPS - WINDOW {
            late = late.max(energy);
        }
    }
    Some(late / early)
}

/// The energy of a deviation from `rest` \[J\], zero below [`DEAD`]; `None` beyond [`ESCAPED`].
fn energy_about<const N: usize>(
    control: &ControlLoop<N>,
    rest: &[f64; N],
) -> impl Fn(&State<N>) -> Option<f64> + use<N> {
    let mass = mass_matrix(&control.arm, rest);
    let gravity = gravity_gradient(&control.arm, rest);
    let h = control.period.effective(control.timestep);
    let (rest, kp) = (*rest, control.gains.kp);
    move |state| {
        let x: [f64; N] = std::array::from_fn(|i| state.position[i] - rest[i]);
        let v = &state.velocity;
        if (0..N).all(|i| x[i].abs() < DEAD && h * v[i].abs() < DEAD) {
            return Some(0.0);
        }
        let mut energy = 0.0;
        for i in 0..N {
            energy += 0.5 * kp[i] * x[i] * x[i];
            for j in 0..N {
                let kinetic = v[i] * mass[i][j] * v[j];
                energy += 0.5 * (kinetic + x[i] * gravity[i.max(j)] * x[j]);
            }
        }
        // Past a flip of held control the velocity chatters, and the position hardly moves. NaN has escaped too.
        (0..N)
            .all(|i| x[i].abs() <= ESCAPED && h * v[i].abs() <= ESCAPED)
            .then_some(energy.abs())
    }
}

/// The live loop in `state`, with the integral and the efforts on their way of its equilibrium.
pub(super) fn live_at<const N: usize>(
    control: &ControlLoop<N>,
    rest: &Equilibrium<N>,
    state: State<N>,
) -> Simulation<N> {
    let live = control.simulation(state).checkpoint();
    let load = gravity_load(&control.arm, &rest.position);
    let held = Held {
        computed: load,
        ..live.held
    };
    Simulation::continued(&Checkpoint {
        integral: rest.integral,
        held,
        memory: Memory {
            measured: Some(State::at_rest(rest.position)),
            waiting: live.memory.waiting.map(|_| load),
        },
        ..live
    })
}

/// The same loop with its timestep \[s\] as its control period, in `substeps` steps; every effort acts `delay`
/// periods late.
pub fn in_substeps<const N: usize>(
    control: &ControlLoop<N>,
    substeps: u32,
    delay: u8,
) -> ControlLoop<N> {
    let period = control.timestep;
    control
        .with_timestep(period / f64::from(substeps))
        .with_period(ControlPeriod { period, delay })
}

/// A state slightly off `position`, differently in every joint, so that every mode is excited. The velocity excites the
/// fast ones.
fn nudged<const N: usize>(control: &ControlLoop<N>, position: &[f64; N]) -> State<N> {
    let mut state = State::at_rest(*position);
    let mut nudge = NUDGE;
    for i in 0..N {
        state.position[i] += nudge;
        state.velocity[i] -= 0.5 * nudge / control.period.effective(control.timestep);
        nudge *= -0.618;
    }
    state
}

/// The boundary above which `holds` no longer does, by bisection around `guess`.
pub(super) fn boundary(guess: f64, holds: impl Fn(f64) -> bool) -> Option<f64> {
    let (mut below, mut above) = (0.5 * guess, 2.0 * guess);
    for _ in 0..WIDENINGS {
        if !holds(below) {
            (below, above) = (0.5 * below, below);
        } else if holds(above) {
            (below, above) = (above, 2.0 * above);
        } else {
            return Some(bisect((below, above), HALVINGS, holds));
        }
    }
    None
}

/// The standard deviation of the velocities that encoders of this step \[rad\] give, from the mean velocities of their
/// periods \[rad/s\]: both joints of a free swing of this number of periods of `period` \[s\].
pub fn velocity_noise(step: f64, period: f64, periods: u32) -> f64 {
    let sensors = Sensors {
        encoder_step: [step; 2],
        velocity: VelocitySource::Difference,
    };
    let swing = ControlLoop::free(Arm::<2>::default()).with_timestep(period);
    let mut swing = swing.simulation(State::at_rest([0.4, -0.3]));
    let mut before = sensors.measured(swing.state(), None, period);
    let squares = (0..periods).map(|_| {
        let from = swing.state().position;
        swing.step();
        let now = sensors.measured(swing.state(), Some(&before), period);
        before = now;
        let mean = swing.state().position.iter().zip(from);
        let mean = mean.map(|(to, from)| (to - from) / period);
        let off = now.velocity.iter().zip(mean);
        off.map(|(found, mean)| (found - mean).powi(2)).sum::<f64>()
    });
    (squares.sum::<f64>() / f64::from(2 * periods)).sqrt()
}
