//! A method of one's own, with the fields of `/study/method`.
//!
//! **Invariant:** an analysis has the members of the service's answer, with the same names.

use numpy::ToPyArray;
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::ControlPeriod;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::method::{self, Analysis, Given, NAMES, Swing, Typed};
use pendularm::study::paused::Paused;
use pendularm::study::tableau::coefficient;
use pyo3::prelude::{FromPyObject, PyDictMethods, PyResult, Python, pyfunction};
use pyo3::types::PyDict;

use crate::arm::{self, for_either, or_default};
use crate::arrays::{joints_or, room};
use crate::fields::{self, Bound, Held, Object, Real, known, or_none, refused};
use crate::floats::Promised;
use crate::gains;
use crate::patience::until_done;

/// A tableau. `method.py` has checked the types, and coefficients are texts.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Tableau {
    name: Option<String>,
    a: Option<Vec<Vec<String>>>,
    b: Option<Vec<String>>,
    c: Option<Vec<String>>,
    b_hat: Option<Vec<String>>,
    a_q: Option<Vec<Vec<String>>>,
    b_q: Option<Vec<String>>,
}

impl Tableau {
    pub(crate) fn read(self) -> PyResult<Given> {
        if let Some(name) = self.name {
            let names = || format!("name must be one of {}, got {name:?}", NAMES.join(", "));
            return method::named(&name).ok_or_else(|| refused(names()));
        }
        let positions = match (self.a_q, self.b_q) {
            (None, None) => None,
            (a, b) => Some((
                rows("a_q", &a.unwrap_or_default())?,
                row("b_q", &b.unwrap_or_default())?,
            )),
        };
        let list = |name, texts: Option<Vec<String>>| texts.map(|it| row(name, &it)).transpose();
        let typed = Typed {
            a: rows("a", &self.a.unwrap_or_default())?,
            b: row("b", &self.b.unwrap_or_default())?,
            c: list("c", self.c)?,
            b_hat: list("b_hat", self.b_hat)?,
            positions,
        };
        Given::try_from(&typed).map_err(refused)
    }
}

fn rows(name: &str, rows: &[Vec<String>]) -> PyResult<Vec<Vec<f64>>> {
    let named = |(index, texts): (usize, &Vec<String>)| row(&format!("{name}[{index}]"), texts);
    rows.iter().enumerate().map(named).collect()
}

fn row(name: &str, texts: &[String]) -> PyResult<Vec<f64>> {
    let read = |(index, text): (usize, &String)| {
        coefficient(text).ok_or_else(|| {
            refused(format_args!(
                "{name}[{index}] must be a number or a fraction such as \"1/3\", got {text:?}"
            ))
        })
    };
    texts.iter().enumerate().map(read).collect()
}

/// Checks a tableau. Returns its number of stages, and the evaluations of a step.
#[pyfunction]
#[pyo3(signature = (tableau, /))]
pub(crate) fn tableau(tableau: Tableau) -> PyResult<(usize, usize)> {
    let given = tableau.read()?;
    Ok((given.pair().stages(), given.pair().evaluations()))
}

/// The largest factor of a mode in a step, for each product of its eigenvalue and the timestep.
#[pyfunction]
#[pyo3(signature = (tableau, re, im, /))]
pub(crate) fn amplification(
    py: Python<'_>,
    tableau: Tableau,
    re: Vec<f64>,
    im: Vec<f64>,
) -> PyResult<Vec<f64>> {
    let given = tableau.read()?;
    let mut factors = room(re.len())?;
    let mut products = re.into_iter().zip(im);
    until_done(py, || match products.next() {
        Some((re, im)) => {
            factors.push(method::amplification(given.pair(), re, im));
            None
        }
        None => Some(()),
    })?;
    Ok(factors)
}

/// The arguments of [`analyse_method`].
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct MethodArguments<'py> {
    tableau: Tableau,
    arm: Option<arm::Given<'py>>,
    gains: Option<Object<'py>>,
    setpoint: Option<Object<'py>>,
    control_period: Real,
}

#[pyfunction]
#[pyo3(signature = (arguments, /))]
pub(crate) fn analyse_method<'py>(
    py: Python<'py>,
    arguments: MethodArguments<'py>,
) -> PyResult<Held<'py, PyDict>> {
    let _floats = Promised::begin();
    let given = arguments.tableau.read()?;
    let period = ControlPeriod {
        period: fields::number(
            "control_period",
            arguments.control_period,
            Bound::NotNegative,
        )?,
        delay: 0,
    };
    for_either!(or_default(arguments.arm)?, arm => {
        let gains = gains::read(arguments.gains.as_ref(), Gains::default())?;
        let setpoint = joints_or("setpoint", arguments.setpoint.as_ref(), Bound::Finite, [0.0; _])?;
        let control = ControlLoop::new(arm, gains, Setpoint::at(setpoint)).with_period(period);
        let mut search = Paused::new(async move {
            (method::analyse(given, control).await, method::swings(&arm).await)
        });
        let (found, beside) = until_done(py, || search.advance())?;
        listed(py, &found, &beside)
    })
}

fn listed<'py>(
    py: Python<'py>,
    analysis: &Analysis,
    beside: &[Swing; 4],
) -> PyResult<Held<'py, PyDict>> {
    let found = PyDict::new(py);
    found.set_item("stages", analysis.stages)?;
    found.set_item("evaluations", analysis.evaluations)?;
    found.set_item("order", analysis.order)?;
    found.set_item("failing_condition", &analysis.failing)?;
    found.set_item("embedded_order", analysis.embedded_order)?;
    found.set_item("faults", &analysis.faults)?;
    found.set_item("measured_order", known(analysis.swing.order))?;
    found.set_item("real_limit", or_none(analysis.real_limit))?;
    found.set_item("imaginary_limit", or_none(analysis.imaginary_limit))?;
    found.set_item("symplectic", analysis.is_symplectic)?;
    found.set_item("region_extent", analysis.region.extent.to_pyarray(py))?;
    found.set_item("region", &analysis.region.rows)?;
    found.set_item("timestep_limit_held", or_none(analysis.timestep_limit_held))?;
    found.set_item("timestep_limit", or_none(analysis.timestep_limit))?;
    found.set_item("swing_evaluations", analysis.swing.evaluations)?;
    found.set_item("methods", Method::ALL.map(Method::name).to_vec())?;
    let beside: Vec<_> = beside.iter().map(|it| it.evaluations).collect();
    found.set_item("swing_evaluations_of_methods", beside)?;
    Ok(found)
}
