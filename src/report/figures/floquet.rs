//! Floquet multipliers of the methods, beside a periodic swing.
//!
//! **Invariant:** a verdict on a method is given only where the swing itself is stable.

use crate::math::integrator::Method;
use crate::report::experiments::nonlinear::PeriodicSwing;
use crate::report::section::Verdict;
use crate::report::svg::{number, scientific};

/// Amplitudes of the periodic swings \[rad\], and steps of a method in one of their periods.
const SWINGS: [f64; 9] = [0.1, 0.3, 0.6, 0.9, 1.2, 1.5, 1.8, 1.9, 2.0];
const PER_PERIOD: [u32; 7] = [16, 32, 64, 128, 256, 512, 1024];

/// The swing beside which the methods are compared.
const SHOWN: f64 = 0.6;

/// Steps of order 4 in a period whose multipliers are the true ones.
const TRUE_STEPS: u32 = 4096;

/// A multiplier beyond this is unstable: a double one on the unit circle is good to the root of the rounding error.
const UNSTABLE: f64 = 1.001;

/// Halvings of the last stride between a stable amplitude and an unstable one.
const HALVINGS: u32 = 4;

/// Multipliers of the methods, by amplitude and by timestep.
pub(super) struct Floquet {
    /// The largest amplitude up to which the swings are stable, and an unstable one close by.
    turns: Option<(f64, f64)>,
    /// Amplitude, and the true multiplier's modulus.
    true_ones: Vec<(f64, f64)>,
}

impl Floquet {
    pub(super) fn of_swings() -> Self {
        let mut floquet = Self {
            turns: None,
            true_ones: vec![],
        };
        for amplitude in SWINGS {
            let Some(swing) = PeriodicSwing::of(amplitude) else {
                continue;
            };
            let truth = swing.transverse(Method::Rk4, TRUE_STEPS);
            floquet.true_ones.push((amplitude, truth));
        }
        floquet.turns = floquet.turning_point();
        floquet
    }

    /// Between the last stable amplitude and the first unstable one.
    fn turning_point(&self) -> Option<(f64, f64)> {
        let first = self.true_ones.iter().position(|one| one.1 > UNSTABLE)?;
        let mut unstable = self.true_ones.get(first)?.0;
        let mut stable = self.true_ones.get(first.checked_sub(1)?)?.0;
        for _ in 0..HALVINGS {
            let middle = 0.5 * (stable + unstable);
            if PeriodicSwing::of(middle)?.transverse(Method::Rk4, TRUE_STEPS) > UNSTABLE {
                unstable = middle;
            } else {
                stable = middle;
            }
        }
        Some((stable, unstable))
    }

    pub(super) fn finding(&self) -> String {
        let swing = "**The periodic swing of 2 links that begins at small amplitude";
        let (Some((stable, _)), Some(last)) = (self.turns, self.true_ones.last()) else {
            return format!("{swing} is stable by itself at every amplitude that was tried**.");
        };
        format!(
            "{swing} is stable by itself up to {} rad of the first joint**: beyond, a deviation grows in every period \
             ({}-fold at {} rad), and no method can follow it for long.",
            number((100.0 * stable).floor() / 100.0),
            number(last.1),
            number(last.0),
        )
    }

    /// Where the true multipliers lie on the unit circle, a method's come to it with its order; Euler's and
    /// midpoint's from outside.
    pub(super) fn verdict(&self) -> Verdict {
        let swing = PeriodicSwing::of(SHOWN);
        let off = |method: Method| -> Vec<f64> {
            let of = |swing: &PeriodicSwing| PER_PERIOD.map(|n| swing.transverse(method, n) - 1.0);
            swing.as_ref().map_or(vec![], |swing| of(swing).to_vec())
        };
        let grows = [Method::Euler, Method::Midpoint]
            .iter()
            .all(|method| !off(*method).is_empty() && off(*method).iter().all(|off| *off > -1e-9));
        let seen: Vec<String> = Method::ALL
            .iter()
            .map(|method| {
                let at = off(*method).get(3).copied().unwrap_or(f64::NAN);
                format!(
                    "{method} 1 {} {}",
                    if at < 0.0 { "-" } else { "+" },
                    scientific(at.abs())
                )
            })
            .collect();
        Verdict {
            claim: format!(
                "Beside the swing of {SHOWN} rad, whose own multipliers are on the unit circle, deviations grow under \
                 Euler and midpoint at every timestep"
            ),
            seen: format!("at 128 steps a period: {}", seen.join(", ")),
            holds: grows,
        }
    }
}
