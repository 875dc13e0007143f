//! A method on a free swing of the arm, against its Taylor series.

use super::super::own_run::increment;
use super::super::paused::PieceWork;
use super::super::tableau::Pair;
use super::super::taylor::TaylorReference;
use crate::math::arm::{Arm, State};

/// Duration of the swing, from the horizontal at rest with every joint bent by 0.3 rad \[s\].
pub const SWING: f64 = 1.0;

/// The error of position \[rad\] for which the evaluations are counted.
pub const ALLOWED_ERROR: f64 = 1e-6;

/// Most steps of a run in each of its eight parts.
pub const MOST_STEPS: u64 = 1 << 11;

/// Every joint's angle at the start \[rad\].
const BENT: f64 = 0.3;

/// Times of the swing, evenly spaced, at which errors are taken. At a single one the leading error may vanish.
const PARTS: usize = 8;

/// Steps of the first run in each part.
const FIRST: u64 = 1;

/// Errors below this are rounding.
const ROUNDING: f64 = 5e-12;

/// Halvings of the range of steps, to 1/16.
const HALVINGS: u32 = 4;

/// A measurement.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Swing {
    /// The order by the errors of the three finest runs above rounding, extrapolated to a step of 0; `None` if they are not
    /// finite.
    pub order: Option<f64>,
    /// The fewest evaluations found with an error of at most [`ALLOWED_ERROR`]; `None` if [`MOST_STEPS`] are too few.
    pub evaluations: Option<u64>,
}

/// Runs the swing with more and more steps.
pub async fn measure<const N: usize>(pair: &Pair, arm: &Arm<N>) -> Swing {
    let start = State::at_rest([BENT; N]);
    let mut reference = TaylorReference::new(start);
    let mut exact = [start; PARTS];
    for state in &mut exact {
        if !reference.follow(arm, &[0.0; N], SWING / PARTS as f64) {
            return Swing::default();
        }
        *state = *reference.state();
    }
    let (mut order, mut before, mut enough) = (None, f64::NAN, None);
    let mut slope_before = f64::NAN;
    let mut steps = FIRST;
    while steps <= MOST_STEPS {
        let [position, error] = run(pair, arm, start, &exact, steps).await;
        if error > ROUNDING && error.is_finite() {
            // The next power of h bends the slope in proportion to h, so the difference of two slopes removes it.
            let slope = (before / error).log2();
            order = Some(2.0 * slope - slope_before).filter(|it| it.is_finite());
            slope_before = slope;
        }
        if enough.is_none() && position <= ALLOWED_ERROR {
            enough = Some(steps);
        }
        if error <= ROUNDING {
            break;
        }
        (before, steps) = (error, 2 * steps);
    }
    if let Some(found) = enough.filter(|it| *it > FIRST) {
        let (mut few, mut many) = (found / 2, found);
        for _ in 0..HALVINGS {
            let middle = few.midpoint(many);
            let [position, _] = run(pair, arm, start, &exact, middle).await;
            *(if position <= ALLOWED_ERROR {
                &mut many
            } else {
                &mut few
            }) = middle;
        }
        enough = Some(many);
    }
    let each = u64::try_from(pair.evaluations()).unwrap_or(u64::MAX);
    Swing {
        order,
        evaluations: enough.map(|steps| steps.saturating_mul(each * PARTS as u64)),
    }
}

/// The errors of a run with this number of steps in each part: the largest of positions, and the norm of all errors.
async fn run<const N: usize>(
    pair: &Pair,
    arm: &Arm<N>,
    mut state: State<N>,
    exact: &[State<N>; PARTS],
    steps: u64,
) -> [f64; 2] {
    let h = SWING / (PARTS as f64 * steps as f64);
    let each = u64::try_from(4 * pair.stages()).unwrap_or(u64::MAX);
    let mut work = PieceWork::default();
    let (mut largest, mut squares) = (0.0, 0.0);
    for exact in exact {
        for _ in 0..steps {
            let (dq, dv) = increment(pair, arm, &state, &[0.0; N], h);
            for j in 0..N {
                state.position[j] += dq[j];
                state.velocity[j] += dv[j];
            }
            work.spend(each).await;
        }
        for j in 0..N {
            let off = state.position[j] - exact.position[j];
            let speed = state.velocity[j] - exact.velocity[j];
            largest = maximum(largest, off.abs());
            squares += off * off + speed * speed;
        }
    }
    [largest, squares.sqrt()]
}

/// The larger one, or NaN.
fn maximum(one: f64, other: f64) -> f64 {
    if one > other { one } else { other }
}
