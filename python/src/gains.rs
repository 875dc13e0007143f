//! The controller's gains as arguments and results.
//!
//! **Invariant:** the caller of [`read`] provides missing gains.

use numpy::ToPyArray;
use pendularm::math::pid::Gains;
use pyo3::PyTypeInfo;
use pyo3::prelude::{PyAnyMethods, PyDictMethods, PyResult, Python, pyfunction};
use pyo3::types::{PyDict, PyMapping};

use crate::arrays::joints;
use crate::fields::{self, Bound, Held, Object, Whole, refused, shown, wrong_type};

/// The gains of a fresh runtime: `kp` [N m/rad], `ki` [N m/(rad s)] and `kd` [N m s/rad], (links,) each.
#[pyfunction]
#[pyo3(signature = (links=Whole::Is(2)), text_signature = "(links=2)")]
pub(crate) fn default_gains(py: Python<'_>, links: Whole) -> PyResult<Held<'_, PyDict>> {
    match fields::links(links)? {
        2 => listed(py, &Gains::<2>::default()),
        _ => listed(py, &Gains::<3>::default()),
    }
}

/// Gains by name, as a result.
pub(crate) fn listed<'py, const N: usize>(
    py: Python<'py>,
    gains: &Gains<N>,
) -> PyResult<Held<'py, PyDict>> {
    let found = PyDict::new(py);
    for (name, gain) in [("kp", gains.kp), ("ki", gains.ki), ("kd", gains.kd)] {
        found.set_item(name, gain.to_pyarray(py))?;
    }
    Ok(found)
}

/// Gains by name, `{"kp": …, "ki": …, "kd": …}`, or an object with these attributes, such as suggested gains. A
/// missing one comes from `missing`.
pub(crate) fn read<const N: usize>(
    value: Option<&Object<'_>>,
    missing: Gains<N>,
) -> PyResult<Gains<N>> {
    let Some(value) = value else {
        return Ok(missing);
    };
    let of_mapping = || {
        let mapping = value.cast::<PyMapping>().ok()?;
        let gains = PyDict::type_object(value.py()).call1((mapping,)).ok()?;
        gains.cast_into::<PyDict>().ok()
    };
    let of_attributes = || {
        let gains = PyDict::new(value.py());
        for name in ["kp", "ki", "kd"] {
            gains.set_item(name, value.getattr(name).ok()?).ok()?;
        }
        Some(gains)
    };
    let gains = of_mapping().or_else(of_attributes).ok_or_else(|| {
        wrong_type(format_args!(
            "gains must be a mapping with kp, ki and kd, got {}",
            shown(value)
        ))
    })?;
    for name in gains.keys() {
        let is_one = |name: String| ["kp", "ki", "kd"].contains(&name.as_str());
        if !name.extract().is_ok_and(is_one) {
            return Err(refused(format_args!(
                "gains must have only kp, ki and kd, got {}",
                shown(&name)
            )));
        }
    }
    let part = |name: &str, missing: [f64; N]| match gains.get_item(name)? {
        Some(value) if !value.is_none() => {
            joints(&format!("gains.{name}"), &value, Bound::NotNegative)
        }
        _ => Ok(missing),
    };
    Ok(Gains {
        kp: part("kp", missing.kp)?,
        ki: part("ki", missing.ki)?,
        kd: part("kd", missing.kd)?,
    })
}
