//! Floquet multipliers of the methods, beside a periodic swing.
//!
//! **Invariant:** the true multipliers are shown beside those of the methods.

use crate::math::integrator::Method;
use crate::report::csv::Csv;
use crate::report::experiments::nonlinear::PeriodicSwing;
use crate::report::section::{Cell, Figure, Table, Verdict};
use crate::report::svg::{
    Axis, Curve, Key, Marker, Plot, Point, Unit, number, scientific, seconds,
};

/// Amplitudes of the periodic swings \[rad\], and steps of a method in one of their periods.
const SWINGS: [f64; 9] = [0.1, 0.3, 0.6, 0.9, 1.2, 1.5, 1.8, 1.9, 2.0];
const PER_PERIOD: [u32; 7] = [16, 32, 64, 128, 256, 512, 1024];

/// The swing whose multipliers are shown by timestep.
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
    /// Amplitude, period, and the true multiplier's modulus.
    true_ones: Vec<(f64, f64, f64)>,
    /// Method, amplitude, timestep, modulus.
    of_methods: Vec<(Method, f64, f64, f64)>,
}

impl Floquet {
    pub(super) fn of_swings() -> Self {
        let mut floquet = Self {
            turns: None,
            true_ones: vec![],
            of_methods: vec![],
        };
        for amplitude in SWINGS {
            let Some(swing) = PeriodicSwing::of(amplitude) else {
                continue;
            };
            let truth = swing.transverse(Method::Rk4, TRUE_STEPS);
            floquet.true_ones.push((amplitude, swing.period, truth));
            for method in Method::ALL {
                for steps in PER_PERIOD {
                    let modulus = swing.transverse(method, steps);
                    let h = swing.period / f64::from(steps);
                    floquet.of_methods.push((method, amplitude, h, modulus));
                }
            }
        }
        floquet.turns = floquet.turning_point();
        floquet
    }

    /// Between the last stable amplitude and the first unstable one.
    fn turning_point(&self) -> Option<(f64, f64)> {
        let first = self.true_ones.iter().position(|one| one.2 > UNSTABLE)?;
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

    pub(super) fn csv(&self) -> Csv {
        let mut csv = Csv::new("method,amplitude,dt,modulus");
        for (amplitude, _, modulus) in &self.true_ones {
            csv.row(&[
                "true".into(),
                (*amplitude).into(),
                0.0.into(),
                (*modulus).into(),
            ]);
        }
        for (method, amplitude, h, modulus) in &self.of_methods {
            csv.row(&[
                method.name().into(),
                (*amplitude).into(),
                (*h).into(),
                (*modulus).into(),
            ]);
        }
        csv
    }

    fn shown(&self, method: Method) -> impl Iterator<Item = (f64, f64)> {
        self.of_methods
            .iter()
            .filter(move |run| run.0 == method && run.1.to_bits() == SHOWN.to_bits())
            .map(|run| (run.2, run.3))
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
            number(last.2),
            number(last.0),
        )
    }

    /// Where the true multipliers lie on the unit circle, a method's come to it with its order; Euler's and
    /// midpoint's from outside.
    pub(super) fn verdict(&self) -> Verdict {
        let off = |method: Method| -> Vec<f64> {
            self.shown(method)
                .map(|(_, modulus)| modulus - 1.0)
                .collect()
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

    pub(super) fn figure(&self) -> Figure {
        let mut by_amplitude = Plot::new(
            "The swing itself",
            Axis::linear("amplitude of the first joint [rad]", 0.0, 2.1),
            Axis::log_between("largest multiplier of a period", Unit::Number, 0.5, 1e3),
        );
        let points = self.true_ones.iter().map(|(amplitude, period, modulus)| {
            let words = format!(
                "period {}, multiplier {}",
                seconds(*period),
                number(*modulus)
            );
            Point::new(*amplitude, *modulus, words)
        });
        by_amplitude.series.push(Curve {
            class: "ink",
            marker: Marker::Circle,
            line: true,
            dashed: false,
            points: points.collect(),
        });
        let mut by_timestep = Plot::new(
            format!("Methods, amplitude {SHOWN} rad"),
            Axis::log_between("timestep", Unit::Seconds, 1e-3, 0.3),
            Axis::log_between("| multiplier - 1 |", Unit::Number, 1e-13, 10.0),
        );
        for method in Method::ALL {
            let points = self.shown(method).map(|(h, modulus)| {
                let sign = if modulus > 1.0 { "grows" } else { "dies out" };
                let off = (modulus - 1.0).abs();
                Point::new(
                    h,
                    off.max(1e-13),
                    format!("{method}: {sign}, {}", scientific(off)),
                )
            });
            by_timestep.series.push(Curve::of(method, points.collect()));
        }
        Figure::new(
            "floquet",
            "Floquet multipliers along a periodic swing",
            "2 links swing from rest on one side through the hanging pose to rest on the other and back, without \
             control. First: the true multiplier of the pair beside the swing; above 1 the swing is unstable \
             by itself. Second: how far from the unit circle a method puts it, by timestep; the table says to which \
             side.",
            &Key::methods(),
            &[by_amplitude, by_timestep],
        )
    }

    pub(super) fn table(&self) -> Table {
        let mut head = vec!["Method".to_owned()];
        let steps: Vec<f64> = self.shown(Method::Euler).map(|(h, _)| h).collect();
        head.extend(steps.iter().map(|h| seconds(*h)));
        let head: Vec<&str> = head.iter().map(String::as_str).collect();
        let mut table = Table::new(
            "floquet",
            format!("Multiplier less 1 beside the swing of {SHOWN} rad"),
            "Positive: deviations grow; negative: they die out, where in truth they neither grow nor die out.",
            &head,
        );
        for method in Method::ALL {
            let mut row = vec![Cell::method(method)];
            row.extend(
                self.shown(method)
                    .map(|(_, modulus)| Cell::new(scientific(modulus - 1.0))),
            );
            table.rows.push(row);
        }
        table
    }
}
