//! Reading what a batch is given: numbers, steps, methods, and which arms are meant.
//!
//! **Invariant:** as in `fields`, a refusal names its field.

use numpy::{PyArray1, PyArrayMethods};
use pendularm::math::integrator::Method;
use pyo3::prelude::{PyAnyMethods, PyResult};
use pyo3::types::{PyByteArray, PyBytes};

use super::Batch;
use crate::arrays::{Numbers, Rows, laid_out};
use crate::fields::{self, Bound, Object, is_masked, refused, shown};

impl Batch {
    /// A row for each arm, or one for all, where something was handed in.
    pub(super) fn rows<'a>(
        &self,
        given: Option<&'a Numbers<'_>>,
        bound: Bound,
    ) -> PyResult<Option<Rows<'a>>> {
        given
            .map(|given| given.rows(self.arms, self.links(), bound))
            .transpose()
    }

    /// A number for each arm, or one for all, where something was handed in.
    pub(super) fn column<'a>(
        &self,
        given: Option<&'a Numbers<'_>>,
        bound: Bound,
    ) -> PyResult<Option<Rows<'a>>> {
        given
            .map(|given| given.column(self.arms, bound))
            .transpose()
    }
}

/// Numbers, where something was handed in.
pub(super) fn read<'py>(
    field: &str,
    value: Option<&Object<'py>>,
) -> PyResult<Option<Numbers<'py>>> {
    value.map(|value| Numbers::read(field, value)).transpose()
}

/// One number of steps for all arms, or one for each.
pub(super) fn read_steps(steps: &Object<'_>, arms: usize) -> PyResult<Vec<u64>> {
    let expected = || {
        refused(format_args!(
            "steps must be a whole number, or one for each of {arms} arms"
        ))
    };
    // Bytes are a sequence of numbers to Python.
    let is_text = steps.is_instance_of::<PyBytes>() || steps.is_instance_of::<PyByteArray>();
    if is_text || is_masked(steps)? {
        return Err(expected());
    }
    if let Some(alike) = fields::count(steps) {
        return Ok(vec![alike]);
    }
    let each: Vec<Object<'_>> = steps.extract().map_err(|_| expected())?;
    let each: Option<Vec<u64>> = each.iter().map(fields::count).collect();
    each.filter(|each| each.len() == arms).ok_or_else(expected)
}

/// One method for all arms, or one for each.
pub(super) fn read_methods(method: &Object<'_>, arms: usize) -> PyResult<Vec<Method>> {
    if let Ok(alike) = method.extract::<String>() {
        return Ok(vec![fields::method("method", &alike)?]);
    }
    match method.extract::<Vec<String>>() {
        Ok(each) if each.len() == arms => each
            .iter()
            .map(|name| fields::method("method", name))
            .collect(),
        _ => Err(refused(format_args!(
            "method must be a name, or one for each of {arms} arms"
        ))),
    }
}

/// The lanes that `arms` names: all, those that a mask has, or those of these numbers.
pub(super) fn chosen(arms: Option<&Object<'_>>, count: usize) -> PyResult<Vec<usize>> {
    let Some(arms) = arms else {
        return Ok((0..count).collect());
    };
    if is_masked(arms)? {
        return Err(refused(format_args!(
            "arms must have no masked entries, got {}",
            shown(arms)
        )));
    }
    let expected = || {
        refused(format_args!(
            "arms must be a mask of {count} or indices below that"
        ))
    };
    let py = arms.py();
    let numpy = py.import("numpy")?;
    let mut array = numpy
        .call_method1("asarray", (arms,))
        .map_err(|_| expected())?;
    if array.getattr("dtype")?.getattr("kind")?.eq("O")? {
        // Truths among objects would be taken for the indices 0 and 1.
        let listed = array.call_method0("tolist")?;
        array = numpy
            .call_method1("asarray", (listed,))
            .map_err(|_| expected())?;
    }
    if let Ok(mask) = array.cast::<PyArray1<bool>>() {
        let mask = laid_out(mask)?.to_vec()?;
        if mask.len() != count {
            return Err(expected());
        }
        return Ok((0..count)
            .filter(|&lane| mask.get(lane) == Some(&true))
            .collect());
    }
    let indices: Vec<usize> = array.extract().map_err(|_| expected())?;
    if indices.iter().any(|&lane| lane >= count) {
        return Err(expected());
    }
    Ok(indices)
}
