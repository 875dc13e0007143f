//! A method as the reader has typed it, and the faults of its sums.
//!
//! **Invariant:** `c` and the embedded method have one finite coefficient for each stage.

use super::super::tableau::{Pair, Tableau, TableauError};

/// Largest error of a sum, within the digits of a typed coefficient.
const TOLERANCE: f64 = 1e-10;

/// A method that the reader has typed.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// The tableaus of positions and of velocities.
    pub(super) pair: Pair,
    /// The times of the stages, which the sums of the rows should be.
    c: Option<Vec<f64>>,
    /// The embedded method.
    pub(super) embedded: Option<Pair>,
}

/// A method as it is typed.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Typed {
    /// The rows of `a`.
    pub a: Vec<Vec<f64>>,
    /// The weights.
    pub b: Vec<f64>,
    /// The times of the stages.
    pub c: Option<Vec<f64>>,
    /// The weights of an embedded method.
    pub b_hat: Option<Vec<f64>>,
    /// `a` and `b` of positions, if they differ from those of velocities.
    pub positions: Option<(Vec<Vec<f64>>, Vec<f64>)>,
}

/// Why a method is not accepted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{field} is wrong: {why}")]
pub struct MethodError {
    /// `a`, `b`, `c`, `b_hat`, `a_q` or `b_q`.
    pub field: &'static str,
    /// The fault.
    pub why: TableauError,
}

impl TryFrom<&Typed> for Given {
    type Error = MethodError;

    fn try_from(typed: &Typed) -> Result<Self, MethodError> {
        let at = |field| move |why| MethodError { field, why };
        let v = Tableau::new(&typed.a, &typed.b).map_err(at("a"))?;
        let pair = match &typed.positions {
            Some((a, b)) => {
                let q = Tableau::new(a, b).map_err(at("a_q"))?;
                Pair::new(q, v).map_err(at("b_q"))?
            }
            None => Pair::same(v),
        };
        // `c` and `b_hat` have one finite entry for each stage, as `b` has.
        let beside = |name, entries: &[f64]| {
            let (stages, got) = (typed.b.len(), entries.len());
            if got != stages {
                let why =
                    format!("{name} must have {stages} entries, one for each stage, got {got}");
                return Err(at(name)(TableauError(why)));
            }
            Tableau::new(&typed.a, entries).map_err(at(name))
        };
        if let Some(c) = &typed.c {
            beside("c", c)?;
        }
        let b_hat = typed.b_hat.as_ref();
        let embedded = b_hat.map(|b_hat| beside("b_hat", b_hat)).transpose()?;
        Ok(Self {
            pair,
            c: typed.c.clone(),
            embedded: embedded.map(Pair::same),
        })
    }
}

impl Given {
    /// A method by its tableaus only.
    pub const fn new(pair: Pair) -> Self {
        Self {
            pair,
            c: None,
            embedded: None,
        }
    }

    /// The tableaus of positions and of velocities.
    pub const fn pair(&self) -> &Pair {
        &self.pair
    }

    /// The embedded method.
    #[cfg(feature = "report")]
    pub(crate) const fn embedded(&self) -> Option<&Pair> {
        self.embedded.as_ref()
    }
}

/// A number as a fraction with a denominator of at most 10000, or with its digits.
pub(super) fn fraction(value: f64) -> String {
    let fits = |denominator: &i32| {
        let numerator = value * f64::from(*denominator);
        (numerator - numerator.round()).abs() <= 1e-12 * f64::from(*denominator)
    };
    match (1..=10_000).find(fits) {
        // Adding 0 removes the sign of a negative zero.
        Some(1) => format!("{}", value.round() + 0.0),
        Some(denominator) => format!("{}/{denominator}", (value * f64::from(denominator)).round()),
        None => format!("{value:?}"),
    }
}

/// The sums that are inconsistent.
pub(super) fn faults(given: &Given) -> Vec<String> {
    let mut faults = Vec::new();
    let mut weights = |name: &str, b: &[f64]| {
        let sum: f64 = b.iter().sum();
        if (sum - 1.0).abs() > TOLERANCE {
            faults.push(format!("{name} sums to {}", fraction(sum)));
        }
    };
    if given.pair.is_runge_kutta() {
        weights("b", given.pair.v().b());
    } else {
        weights("b of q", given.pair.q().b());
        weights("b of v", given.pair.v().b());
    }
    if let Some(embedded) = &given.embedded {
        weights("b_hat", embedded.v().b());
    }
    for (row, (c, a)) in given.c.iter().flatten().zip(given.pair.v().a()).enumerate() {
        let sum: f64 = a.iter().sum();
        if (sum - c).abs() > TOLERANCE {
            let (sum, c) = (fraction(sum), fraction(*c));
            faults.push(format!("row {row} of a does not sum to c: {sum}, not {c}"));
        }
    }
    faults
}
