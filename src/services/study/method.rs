//! `/study/method`: what is known about a method by its tableau, on the arm and its loop.
//!
//! A coefficient is a number, or a string with a number or a fraction, such as `"1/3"`.
//!
//! **Invariant:** a tableau that is read has at most [`MAX_STAGES`] stages.

use bytes::Bytes;
use serde_json::value::RawValue;

use super::{Changed, Computed, Present, StudyWork};
use crate::math::arm::ArmError;
use crate::math::integrator::Method;
use crate::protocol::catalog::Service;
use crate::protocol::op::Arguments;
use crate::protocol::op::fields::{Fields, Rejections, mistyped};
use crate::protocol::wire::json;
use crate::services::{Address, Ask};
use crate::study::method::{Analysis, Given, MethodError, NAMES, Swing, Typed};
use crate::study::method::{analyse, named, swings};
use crate::study::tableau::{MAX_STAGES, Pair, coefficient};

// ---- question -------------------------------------------------------------------------------------------------------

request! {
    whole
    /// Analyses a method.
    #[derive(Debug, Clone, PartialEq)]
    pub struct AnalyseMethod<N> -> Result<Box<Analysed>, ArmError>, |fields| {
        /// The method. The catalog requires it: without it the request is rejected.
        method: Option<Given> = read(&mut fields),
        /// Changes of the present loop.
        changed: Changed<N> = Changed::read(&mut fields),
    }

    fn write(answer: Self::Answer, to: &Address) -> Bytes {
        let answer = answer.map_err(|why| format!("params {why}"));
        to.outcome(answer.as_ref().map(|analysed| {
            let Analysed { found, beside } = &**analysed;
            object! {
                stages: found.stages,
                evaluations: found.evaluations,
                order: found.order,
                failing_condition: found.failing.as_deref(),
                embedded_order: found.embedded_order,
                faults: found.faults.as_slice(),
                measured_order: found.swing.order,
                real_limit: found.real_limit,
                imaginary_limit: found.imaginary_limit,
                symplectic: found.is_symplectic,
                region_extent: found.region.extent.as_slice(),
                region: found.region.rows.as_slice(),
                timestep_limit_held: found.timestep_limit_held,
                timestep_limit: found.timestep_limit,
                swing_evaluations: found.swing.evaluations,
                methods: Method::ALL.map(Method::name),
                swing_evaluations_of_methods: beside.map(|it| it.evaluations),
            }
        }))
    }
}

/// An analysis, and the live arm's methods on the same swing.
pub struct Analysed {
    /// The analysis.
    pub found: Analysis,
    /// The swing with each of [`Method::ALL`].
    pub beside: [Swing; 4],
}

// ---- reading and writing --------------------------------------------------------------------------------------------

/// A question with a method of one's own, if it has one. The kernel of the page asks without.
pub struct Beside<A> {
    pub(super) ask: A,
    pub(super) own: Option<Pair>,
}

impl<A: Ask> Ask for Beside<A> {
    type Answer = A::Answer;

    fn read(service: Service, arguments: &Arguments) -> Result<Self, Rejections> {
        let asked = A::read(service, arguments);
        let mut fields = Fields::read(arguments, service)?;
        let own = read(&mut fields).map(|given| given.pair().clone());
        match (asked, fields.finish()) {
            (Ok(ask), rejected) if rejected.is_empty() => Ok(Self { ask, own }),
            (Ok(_), rejected) => Err(rejected),
            (Err(mut others), rejected) => {
                others.append(rejected);
                Err(others)
            }
        }
    }

    fn write(answer: A::Answer, to: &Address) -> Bytes {
        A::write(answer, to)
    }
}

/// The method of the field `tableau`, if there is one and it is valid.
fn read(fields: &mut Fields<'_>) -> Option<Given> {
    fields.object("tableau", from_fields).flatten()
}

fn from_fields(fields: &mut Fields<'_>) -> Option<Given> {
    let name = fields.choice("name", &NAMES, |name| name);
    let [a, a_q] = ["a", "a_q"].map(|name| rows(fields, name));
    let [b, b_q] = ["b", "b_q"].map(|name| row(fields, name));
    let [c, b_hat] = ["c", "b_hat"].map(|name| row(fields, name));
    if !fields.accepted() {
        return None;
    }
    let is_alone = [&b, &c, &b_hat, &b_q].iter().all(|it| it.is_none()) && a.is_none();
    let typed = match (name, (a, b), (a_q, b_q)) {
        (Some(name), _, (None, _)) if is_alone => return named(name),
        (None, (Some(a), Some(b)), positions) => Typed {
            a,
            b,
            c,
            b_hat,
            positions: match positions {
                (None, None) => None,
                (a_q, b_q) => Some((a_q.unwrap_or_default(), b_q.unwrap_or_default())),
            },
        },
        _ => {
            fields.refuse("a", &"must come with b, or name alone");
            return None;
        }
    };
    match Given::try_from(&typed) {
        Ok(given) => Some(given),
        Err(MethodError { field, why }) => {
            fields.refuse(field, &format_args!("is wrong: {why}"));
            None
        }
    }
}

/// The coefficients of a field.
fn row(fields: &mut Fields<'_>, name: &'static str) -> Option<Vec<f64>> {
    let entries = fields.entries(name, MAX_STAGES)?;
    coefficients(fields, name, &entries)
}

/// The rows of a field: a list of lists, or n² coefficients row by row, as ROS 2 has them.
fn rows(fields: &mut Fields<'_>, name: &'static str) -> Option<Vec<Vec<f64>>> {
    let entries = fields.entries(name, MAX_STAGES * MAX_STAGES)?;
    let is_flat = |raw: &&RawValue| !raw.get().starts_with('[');
    if entries.first().is_some_and(is_flat) {
        let all = coefficients(fields, name, &entries)?;
        let n = all.len().isqrt();
        if n * n != all.len() {
            let count = all.len();
            fields.refuse(
                name,
                &format_args!("must have n² coefficients, got {count}"),
            );
            return None;
        }
        return Some(all.chunks(n).map(<[f64]>::to_vec).collect());
    }
    if entries.len() > MAX_STAGES {
        let count = entries.len();
        fields.refuse(
            name,
            &format_args!("must have at most {MAX_STAGES} rows, got {count}"),
        );
        return None;
    }
    let rows = entries.into_iter().enumerate().map(|(index, raw)| {
        let name = format!("{name}[{index}]");
        match json::entries(raw, MAX_STAGES).filter(|it| it.count <= MAX_STAGES) {
            Some(row) => coefficients(fields, &name, &row.first),
            None => {
                let expected = format!("an array of at most {MAX_STAGES} coefficients");
                fields.refuse(&name, &mistyped(&expected, raw));
                None
            }
        }
    });
    // All rows are read, so that each wrong one is named.
    let rows: Vec<Option<Vec<f64>>> = rows.collect();
    rows.into_iter().collect()
}

fn coefficients(fields: &mut Fields<'_>, name: &str, row: &[&RawValue]) -> Option<Vec<f64>> {
    let read = row.iter().enumerate().map(|(index, raw)| {
        let value = match json::text(raw) {
            Some(text) => coefficient(&text),
            None => json::number(raw).filter(|it| it.is_finite()),
        };
        if value.is_none() {
            let reason = mistyped("a number or a fraction such as \"1/3\"", raw);
            fields.refuse(&format!("{name}[{index}]"), &reason);
        }
        value
    });
    let read: Vec<Option<f64>> = read.collect();
    read.into_iter().collect()
}

// ---- work -----------------------------------------------------------------------------------------------------------

impl<const N: usize> Computed<N> for AnalyseMethod<N> {
    type Work = StudyWork<Self::Answer>;

    fn work(self, present: Present<N>) -> Self::Work {
        StudyWork::new::<N>(async move {
            let control = self.changed.applied_to(&present.control)?;
            let given = self
                .method
                .unwrap_or_else(|| Given::new(Pair::of(control.method)));
            Ok(Box::new(Analysed {
                beside: swings(&control.arm).await,
                found: analyse(given, control).await,
            }))
        })
    }
}
