//! Explicit Runge-Kutta methods, by the tableaus of positions and of velocities.
//!
//! A stage `i` has the position `q + h Σ a[i][j] v_j` and the velocity `v + h Σ â[i][j] f_j`; the step ends at
//! `q + h Σ b[i] v_i` and `v + h Σ b̂[i] f_i`, where `f_i` is the acceleration of stage `i`. A Runge-Kutta method has the
//! same tableau for both. Semi-implicit Euler, velocity Verlet and Störmer's method have two.
//!
//! Source: Hairer, Lubich and Wanner, *Geometric Numerical Integration* (2006), ch. II.1 and II.2.
//!
//! **Invariant:** every tableau is explicit and finite, and has at most [`MAX_STAGES`] stages.

use crate::math::integrator::Method;
use crate::math::shown::Shown;

/// Most stages of a method.
pub const MAX_STAGES: usize = 12;

/// Largest coefficient. Textbook methods have coefficients below 100.
const LARGEST: f64 = 1e6;

/// One tableau.
#[derive(Debug, Clone, PartialEq)]
pub struct Tableau {
    /// Row `i` has `i` entries: those left of the diagonal.
    a: Vec<Vec<f64>>,
    b: Vec<f64>,
}

/// Why a tableau is not accepted, in words. Rows and columns are counted from 0.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct TableauError(pub(super) String);

/// A coefficient that is typed as a number or as a fraction, such as `1/3`. `None` if it is neither, or not finite.
pub fn coefficient(text: &str) -> Option<f64> {
    let number = |part: &str| part.trim().parse().ok().filter(|it: &f64| it.is_finite());
    let (numerator, denominator) = text.split_once('/').unwrap_or((text, "1"));
    let value = number(numerator)? / number(denominator)?;
    value.is_finite().then_some(value)
}

/// Rows of coefficients: `;` ends a row. `None` if one is no number.
pub(crate) fn rows(text: &str) -> Option<Vec<Vec<f64>>> {
    let row = |row: &str| row.split_whitespace().map(coefficient).collect();
    text.split(';').map(row).collect()
}

impl Tableau {
    /// The tableau with the rows of `a`, with or without the zeros on and right of the diagonal.
    ///
    /// # Errors
    /// The first fault.
    pub fn new(a: &[Vec<f64>], b: &[f64]) -> Result<Self, TableauError> {
        let stages = b.len();
        let refused = |why| Err(TableauError(why));
        if !(1..=MAX_STAGES).contains(&stages) {
            return refused(format!(
                "b must have 1 to {MAX_STAGES} stages, got {stages}"
            ));
        }
        if a.len() != stages {
            let got = a.len();
            return refused(format!(
                "a must have as many rows as b has entries, {stages}, got {got}"
            ));
        }
        for (row, entries) in a.iter().enumerate() {
            let got = entries.len();
            if !(row..=stages).contains(&got) {
                return refused(format!(
                    "row {row} of a must have {row} to {stages} entries, got {got}"
                ));
            }
            let mut beyond = entries.iter().enumerate().skip(row);
            if let Some((column, value)) = beyond.find(|(_, value)| **value != 0.0) {
                return refused(format!(
                    "row {row} of a is implicit: a[{row}][{column}] is {}, and only entries left of the diagonal may \
                     differ from 0",
                    Shown(*value)
                ));
            }
        }
        let mut all = a.iter().flatten().chain(b);
        if let Some(bad) = all.find(|it| !(-LARGEST..=LARGEST).contains(*it)) {
            return refused(format!(
                "a coefficient must be between -{LARGEST} and {LARGEST}, got {}",
                Shown(*bad)
            ));
        }
        let rows = a.iter().enumerate();
        Ok(Self {
            a: rows.map(|(row, entries)| entries[..row].to_vec()).collect(),
            b: b.to_vec(),
        })
    }

    /// The entries of `a` left of the diagonal, row by row.
    pub fn a(&self) -> &[Vec<f64>] {
        &self.a
    }

    /// The weights.
    pub fn b(&self) -> &[f64] {
        &self.b
    }
}

/// The tableaus of positions and of velocities, with equally many stages.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    q: Tableau,
    v: Tableau,
}

impl Pair {
    /// A pair of tableaus.
    ///
    /// # Errors
    /// They have different numbers of stages.
    pub fn new(q: Tableau, v: Tableau) -> Result<Self, TableauError> {
        if q.b.len() == v.b.len() {
            Ok(Self { q, v })
        } else {
            Err(TableauError(format!(
                "the tableaus of q and v must have equally many stages, got {} and {}",
                q.b.len(),
                v.b.len()
            )))
        }
    }

    /// The Runge-Kutta method of one tableau.
    pub fn same(tableau: Tableau) -> Self {
        Self {
            q: tableau.clone(),
            v: tableau,
        }
    }

    /// One of the four methods of the live arm.
    pub fn of(method: Method) -> Self {
        let rows = |rows: &[&[f64]], b: &[f64]| Tableau {
            a: rows.iter().map(|row| row.to_vec()).collect(),
            b: b.to_vec(),
        };
        let sixth = 1.0 / 6.0;
        match method {
            Method::Euler => Self::same(rows(&[&[]], &[1.0])),
            Method::Midpoint => Self::same(rows(&[&[], &[0.5]], &[0.0, 1.0])),
            // The second stage has the velocity in the middle, which moves the position.
            Method::Verlet => Self {
                q: rows(&[&[], &[0.0], &[0.0, 1.0]], &[0.0, 1.0, 0.0]),
                v: rows(&[&[], &[0.5], &[1.0, 0.0]], &[0.5, 0.0, 0.5]),
            },
            Method::Rk4 => Self::same(rows(
                &[&[], &[0.5], &[0.0, 0.5], &[0.0, 0.0, 1.0]],
                &[sixth, 2.0 * sixth, 2.0 * sixth, sixth],
            )),
        }
    }

    /// `v + h f(q, v)`, then `q + h v` with the new velocity: semi-implicit Euler, also called symplectic.
    pub fn semi_implicit() -> Self {
        let rows = |b: [f64; 2]| Tableau {
            a: vec![vec![], vec![1.0]],
            b: b.to_vec(),
        };
        Self {
            q: rows([0.0, 1.0]),
            v: rows([1.0, 0.0]),
        }
    }

    /// The tableau of positions.
    pub fn q(&self) -> &Tableau {
        &self.q
    }

    /// The tableau of velocities.
    pub fn v(&self) -> &Tableau {
        &self.v
    }

    /// Whether positions and velocities have one tableau.
    pub fn is_runge_kutta(&self) -> bool {
        self.q == self.v
    }

    /// Number of stages.
    pub fn stages(&self) -> usize {
        self.q.b.len()
    }

    /// Whether the acceleration of a stage is used.
    pub(crate) fn evaluates(&self, stage: usize) -> bool {
        let below = self.v.a.iter().filter_map(|row| row.get(stage));
        below.chain(self.v.b.get(stage)).any(|it| *it != 0.0)
    }

    /// Accelerations that one step evaluates.
    pub fn evaluations(&self) -> usize {
        (0..self.stages()).filter(|i| self.evaluates(*i)).count()
    }

    /// The changes of positions and velocities in a step of `h` \[s\] from the velocities `v`. The function returns the
    /// accelerations, given the change of positions and the velocities. All have the length of `v`.
    pub fn increment(
        &self,
        h: f64,
        v: &[f64],
        mut acceleration: impl FnMut(&[f64], &[f64]) -> Vec<f64>,
    ) -> (Vec<f64>, Vec<f64>) {
        let sum = |weights: &[f64], rates: &[Vec<f64>]| {
            let mut sum = vec![0.0; v.len()];
            for (weight, rate) in weights.iter().zip(rates).filter(|it| *it.0 != 0.0) {
                sum.iter_mut()
                    .zip(rate)
                    .for_each(|(sum, rate)| *sum += h * weight * rate);
            }
            sum
        };
        let (mut velocities, mut accelerations) = (Vec::new(), Vec::new());
        for stage in 0..self.stages() {
            let mut velocity = sum(&self.v.a[stage], &accelerations);
            velocity.iter_mut().zip(v).for_each(|(it, v)| *it += v);
            accelerations.push(if self.evaluates(stage) {
                acceleration(&sum(&self.q.a[stage], &velocities), &velocity)
            } else {
                vec![0.0; v.len()]
            });
            velocities.push(velocity);
        }
        (sum(&self.q.b, &velocities), sum(&self.v.b, &accelerations))
    }
}
