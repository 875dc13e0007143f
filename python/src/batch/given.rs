//! Readers of a batch's arguments: numbers, steps, methods, and the selected arms.
//!
//! **Invariant:** a refusal names its field, as in `fields`.

use std::fmt::Display;

use numpy::{PyArray1, PyArrayMethods};
use pendularm::math::sensors::MAX_DELAY;
use pyo3::prelude::{PyAnyMethods, PyErr, PyResult};
use pyo3::types::{PyBool, PyByteArray, PyBytes, PyDict, PyInt, PyString};

use crate::arrays::{ArrayArgument, collected, laid_out, room};
use crate::fields::{self, Name, Object, is_masked, is_too_long, refused, shown, wrong_type};
use crate::robot::delay;

/// The array, if there is an argument.
pub(super) fn read<'py>(
    field: &str,
    value: Option<&Object<'py>>,
) -> PyResult<Option<ArrayArgument<'py>>> {
    value
        .map(|value| ArrayArgument::read(field, value))
        .transpose()
}

/// The entries of a sequence of `count` entries; `None` if it is not a sequence, or has another length.
fn entries<'py>(value: &Object<'py>, count: usize) -> PyResult<Option<Vec<Object<'py>>>> {
    let is_sequence = !value.is_instance_of::<PyDict>() && value.hasattr("__getitem__")?;
    if !is_sequence || !value.len().is_ok_and(|length| length == count) {
        return Ok(None);
    }
    // An object may have more entries than its length says.
    let mut all = room(count + 1)?;
    for one in value.try_iter()?.take(count + 1) {
        all.push(one?);
    }
    Ok((all.len() == count).then_some(all))
}

/// One value for all arms, or one for each. `read` returns `None` for a value of another type. `expected` begins the
/// refusal: the field, and what one value must be.
fn one_or_each<T>(
    value: &Object<'_>,
    arms: usize,
    expected: &str,
    read: impl Fn(&Object<'_>) -> PyResult<Option<T>>,
) -> PyResult<Vec<T>> {
    let wrong = |reason: &Object<'_>| not_one_or_each(reason, value, arms, expected);
    if let Some(alike) = read(value)? {
        return Ok(vec![alike]);
    }
    let mut each = room(arms)?;
    for one in entries(value, arms)?.ok_or_else(|| wrong(value))? {
        each.push(read(&one)?.ok_or_else(|| wrong(&one))?);
    }
    Ok(each)
}

/// The same for whole numbers. Bytes are none, and neither is an array with hidden entries.
fn one_or_each_whole<T>(
    value: &Object<'_>,
    arms: usize,
    expected: &str,
    read: impl Fn(&Object<'_>) -> PyResult<Option<T>>,
) -> PyResult<Vec<T>> {
    if is_bytes(value) || is_masked(value)? {
        return Err(not_one_or_each(value, value, arms, expected));
    }
    one_or_each(value, arms, expected, read)
}

/// The refusal of `value`, because of itself or its entry `reason`.
fn not_one_or_each(reason: &Object<'_>, value: &Object<'_>, arms: usize, expected: &str) -> PyErr {
    refusal(reason, one_or_each_rule(value, arms, expected))
}

/// What `value` must be, and what it is.
fn one_or_each_rule(value: &Object<'_>, arms: usize, expected: &str) -> String {
    format!(
        "{expected}, or one for each of {arms} arms, got {}",
        shown(value)
    )
}

/// The refusal of an argument because of itself or one of its entries: a `ValueError` for a number out of range and a
/// sequence with a wrong number of entries, else a `TypeError`.
fn refusal(reason: &Object<'_>, why: impl Display) -> PyErr {
    let is_text = reason.is_instance_of::<PyString>() || is_bytes(reason);
    let is_sequence = reason.len().is_ok() && !is_text && !reason.is_instance_of::<PyDict>();
    let is_number = reason.is_instance_of::<PyInt>() && !reason.is_instance_of::<PyBool>();
    if is_sequence || is_number {
        refused(why)
    } else {
        wrong_type(why)
    }
}

/// For Python, bytes are a sequence of numbers.
fn is_bytes(value: &Object<'_>) -> bool {
    value.is_instance_of::<PyBytes>() || value.is_instance_of::<PyByteArray>()
}

/// One number of steps for all arms, or one for each.
pub(super) fn read_steps(steps: &Object<'_>, arms: usize) -> PyResult<Vec<u64>> {
    let expected = "steps must be a whole number, at least 0 and less than 2^64";
    one_or_each_whole(steps, arms, expected, |one| Ok(fields::count(one)))
}

/// One choice for all arms, or one for each, by their names. `choose` reads one.
pub(super) fn read_names<T>(
    field: &str,
    value: Option<&Object<'_>>,
    arms: usize,
    choose: impl Fn(Name) -> PyResult<T>,
) -> PyResult<Option<Vec<T>>> {
    let expected = format!("{field} must be a name");
    let all = |value: &Object<'_>| {
        let read = |one: &Object<'_>| match one.extract::<String>() {
            Ok(name) => choose(Name::Is(name)).map(Some),
            // A number has a wrong type here, and is not out of range.
            Err(_) if one.is_instance_of::<PyInt>() => {
                Err(wrong_type(one_or_each_rule(value, arms, &expected)))
            }
            Err(_) => Ok(None),
        };
        one_or_each(value, arms, &expected, read)
    };
    value.map(all).transpose()
}

/// One delay for all arms, or one for each.
pub(super) fn read_delays(value: &Object<'_>, arms: usize) -> PyResult<Vec<u8>> {
    let expected = format!("control_delay must be a whole number from 0 to {MAX_DELAY}");
    one_or_each_whole(value, arms, &expected, |one| {
        let is_count = fields::count(one).is_some() || one.extract::<bool>().is_ok();
        is_count.then(|| delay(one)).transpose()
    })
}

/// The value for an arm, from one for all or one for each.
pub(super) fn of_arm<T: Copy>(values: &[T], arm: usize) -> Option<T> {
    match values {
        [alike] => Some(*alike),
        each => each.get(arm).copied(),
    }
}

/// The lanes selected by `arms`: all, those of a mask, or those with these indices.
pub(super) fn chosen(arms: Option<&Object<'_>>, count: usize) -> PyResult<Vec<usize>> {
    let Some(arms) = arms else {
        return collected(count, 0..count);
    };
    if is_masked(arms)? {
        return Err(refused(format_args!(
            "arms must have no masked entries, got {}",
            shown(arms)
        )));
    }
    let expected = || {
        let why = format!(
            "arms must be a mask of {count} booleans, or indices from 0 to {}, got {}",
            count - 1,
            shown(arms)
        );
        refusal(arms, why)
    };
    if is_too_long(arms)? {
        return Err(expected());
    }
    let py = arms.py();
    let numpy = py.import("numpy")?;
    let mut array = numpy
        .call_method1("asarray", (arms,))
        .map_err(|_| expected())?;
    if array.getattr("dtype")?.getattr("kind")?.eq("O")? {
        // Booleans among objects would be read as the indices 0 and 1.
        let listed = array.call_method0("tolist")?;
        array = numpy
            .call_method1("asarray", (listed,))
            .map_err(|_| expected())?;
    }
    if let Ok(mask) = array.cast::<PyArray1<bool>>() {
        if mask.len()? != count {
            return Err(expected());
        }
        let mask = laid_out(mask)?.to_vec()?;
        let of_mask = (0..count).filter(|&lane| mask.get(lane) == Some(&true));
        return collected(count, of_mask);
    }
    let length = array.len().map_err(|_| expected())?;
    let mut indices = room(length)?;
    for one in entries(&array, length)?.ok_or_else(expected)? {
        let lane = one.extract().ok().filter(|&lane: &usize| lane < count);
        indices.push(lane.ok_or_else(expected)?);
    }
    Ok(indices)
}
