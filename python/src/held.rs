//! The sampled loop of any robot, with the fields of `/study/held_limit`.
//!
//! **Invariant:** a result has the members of the service's answer, with the same names.

use numpy::ToPyArray;
use pendularm::study::held_loop::{self, Between, Given, HeldError, HeldLimit, HeldLoop};
use pendularm::study::paused::Paused;
use pyo3::prelude::{FromPyObject, PyDictMethods, PyResult, Python, pyfunction};
use pyo3::types::PyDict;

use crate::fields::{Held, refused};
use crate::patience::until_done;

type Rows = Vec<Vec<f64>>;

/// The arguments of [`held_limit`]. `held.py` has checked their types.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct HeldArguments {
    #[pyo3(item("M"))]
    mass: Rows,
    kp: Rows,
    kd: Rows,
    ki: Rows,
    damping: Rows,
    stiffness: Rows,
    period: Option<f64>,
    delay: u64,
    between: String,
    steps: u64,
}

#[pyfunction]
#[pyo3(signature = (arguments, /))]
pub(crate) fn held_limit<'py>(
    py: Python<'py>,
    arguments: HeldArguments,
) -> PyResult<Held<'py, PyDict>> {
    let HeldArguments { period, .. } = arguments;
    let between = Between::named(&arguments.between).ok_or_else(|| {
        let names = Between::NAMES.join(", ");
        refused(format_args!(
            "between must be one of {names}, got {:?}",
            arguments.between
        ))
    })?;
    if let Some(period) = period.filter(|it| !(*it > 0.0 && it.is_finite())) {
        return Err(refused(HeldError::period(period)));
    }
    let given = Given {
        mass: arguments.mass,
        kp: arguments.kp,
        kd: arguments.kd,
        ki: arguments.ki,
        damping: arguments.damping,
        stiffness: arguments.stiffness,
        delay: arguments.delay,
        between,
        steps: arguments.steps,
    };
    let held = HeldLoop::try_from(&given).map_err(refused)?;
    let mut search = Paused::new(held_loop::held_limit(held, period));
    listed(py, &until_done(py, || search.advance())?)
}

fn listed<'py>(py: Python<'py>, limit: &HeldLimit) -> PyResult<Held<'py, PyDict>> {
    let critical = limit.critical.as_ref().map(|critical| {
        let found = PyDict::new(py);
        found.set_item("growth_per_period", critical.growth_per_period)?;
        found.set_item("frequency", critical.frequency)?;
        found.set_item("joint", critical.joint)?;
        found.set_item("mode", critical.mode.to_pyarray(py))?;
        found.set_item("reverses", critical.reverses)?;
        PyResult::Ok(found)
    });
    let at = limit.at.as_ref();
    let found = PyDict::new(py);
    let unknown = f64::NAN;
    let no_limit = f64::INFINITY;
    found.set_item("period_limit", limit.period_limit.unwrap_or(no_limit))?;
    found.set_item("critical", critical.transpose()?)?;
    found.set_item("effective_inertia", limit.effective_inertia.to_pyarray(py))?;
    found.set_item("stable", at.map(|at| at.is_stable))?;
    let growth = at.map_or(unknown, |at| at.growth_per_period);
    found.set_item("growth_per_period", growth)?;
    let timestep = at.map_or(unknown, |at| at.timestep_limit.unwrap_or(no_limit));
    found.set_item("timestep_limit", timestep)?;
    let factor = at.and_then(|at| at.kd_factor);
    found.set_item("kd_factor_limit", factor.unwrap_or(unknown))?;
    let armature = at.and_then(|at| at.armature);
    found.set_item("armature", armature.unwrap_or(unknown))?;
    found.set_item("explanation", &limit.explanation)?;
    Ok(found)
}
