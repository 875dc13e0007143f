//! Arrays of numbers from Python, with their rows, and arrays for Python.
//!
//! **Invariant:** numbers are read in the order of their indices, for every memory layout.

use numpy::ndarray::Dimension;
use numpy::{
    Element, IntoPyArray, PyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyMemoryError, PyOverflowError, PyValueError};
use pyo3::intern;
use pyo3::prelude::{PyAnyMethods, PyDictMethods, PyResult, Python, pyfunction};
use pyo3::types::PyDict;

use crate::fields::{
    Bound, Held, MOST_LISTED, Object, Real, beyond, has_booleans, held, is_masked, is_too_long,
    refused, shown, wrong_type,
};

/// An empty vector with capacity for `count` entries.
///
/// # Errors
/// `MemoryError`. Every allocation whose size depends on the caller is made here or by NumPy.
pub(crate) fn room<T>(count: usize) -> PyResult<Vec<T>> {
    let mut room = Vec::new();
    match room.try_reserve_exact(count) {
        Ok(()) => Ok(room),
        Err(_) => Err(PyMemoryError::new_err(format!(
            "no memory for {count} entries of {} bytes",
            size_of::<T>()
        ))),
    }
}

/// The items in a vector. `count` is their number.
pub(crate) fn collected<T>(count: usize, items: impl Iterator<Item = T>) -> PyResult<Vec<T>> {
    let mut all = room(count)?;
    all.extend(items.take(count));
    Ok(all)
}

/// Makes an array read-only, as every array that a property returns, because writing to it would not change the object.
pub(crate) fn read_only<'py, T: Element, D: Dimension>(
    array: Held<'py, PyArray<T, D>>,
) -> PyResult<Held<'py, PyArray<T, D>>> {
    drop(array.try_readwrite()?.make_nonwriteable());
    Ok(array)
}

/// The value of a property that is an array.
pub(crate) fn property<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Held<'py, PyArray1<f64>>> {
    // Users cannot make it writable, because NumPy does not own its memory.
    read_only(values.to_vec().into_pyarray(py))
}

/// An argument with numbers in an array of any shape. Contiguous doubles, row by row, stay in the caller's memory.
pub(crate) struct ArrayArgument<'py> {
    field: String,
    array: PyReadonlyArrayDyn<'py, f64>,
}

impl<'py> ArrayArgument<'py> {
    pub(crate) fn read(field: &str, value: &Object<'py>) -> PyResult<Self> {
        if is_masked(value)? {
            return Err(refused(format_args!(
                "{field} must have no masked numbers, got {}",
                shown(value)
            )));
        }
        if is_too_long(value)? {
            return Err(refused(format_args!(
                "{field} must be a NumPy array if it has more than {MOST_LISTED} entries, got {}",
                shown(value)
            )));
        }
        let array = match value.cast::<PyArrayDyn<f64>>() {
            Ok(array) => array.clone(),
            Err(_) => as_doubles(value).map_err(|why| {
                if why.is_instance_of::<PyOverflowError>(value.py()) {
                    return beyond(field);
                }
                if why.is_instance_of::<PyMemoryError>(value.py()) {
                    return why;
                }
                let said = format!("{field} must be an array of numbers, got {}", shown(value));
                // NumPy refuses rows of different lengths by a ValueError.
                if why.is_instance_of::<PyValueError>(value.py()) {
                    refused(said)
                } else {
                    wrong_type(said)
                }
            })?,
        };
        let array = laid_out(&array)?.try_readonly().map_err(|_| {
            refused(format_args!(
                "{field} is being written by a batch: pass a copy of it"
            ))
        })?;
        Ok(Self {
            field: field.to_owned(),
            array,
        })
    }

    pub(crate) fn shape(&self) -> &[usize] {
        self.array.shape()
    }

    /// The numbers as one row of `width` per arm, or one row for all arms, (`width`,) or (1, `width`). Without `arms`
    /// only one row is valid.
    pub(crate) fn rows(
        &self,
        arms: Option<usize>,
        width: usize,
        bound: Bound,
    ) -> PyResult<Rows<'_>> {
        let field = &self.field;
        let shape = self.shape();
        let is_one = shape == [width] || shape == [1, width];
        if !is_one && arms.is_none_or(|arms| shape != [arms, width]) {
            let arms = arms.map_or_else(|| "n".to_owned(), |arms| arms.to_string());
            return Err(refused(format_args!(
                "{field} must have the shape ({width},) or ({arms}, {width}), got {}",
                in_python(shape)
            )));
        }
        self.checked(width, is_one, bound)
    }

    /// The numbers as one per arm, or one for all arms.
    pub(crate) fn column(&self, arms: usize, bound: Bound) -> PyResult<Rows<'_>> {
        let field = &self.field;
        let shape = self.shape();
        if !shape.is_empty() && shape != [arms] {
            return Err(refused(format_args!(
                "{field} must be a number or have the shape ({arms},), got {}",
                in_python(shape)
            )));
        }
        self.checked(1, shape.is_empty(), bound)
    }

    /// The numbers as a list.
    pub(crate) fn list(&self, bound: Bound) -> PyResult<&[f64]> {
        if self.shape().len() != 1 {
            return Err(refused(format_args!(
                "{} must have the shape (n,), got {}",
                self.field,
                in_python(self.shape())
            )));
        }
        Ok(self.checked(1, false, bound)?.values)
    }

    /// The numbers as one finite row of `N`, or as some.
    pub(crate) fn each<const N: usize>(&self) -> PyResult<Vec<[f64; N]>> {
        let count = match self.shape() {
            [count, _] => *count,
            _ => 1,
        };
        let rows = self.rows(Some(count), N, Bound::Finite)?;
        collected(count, (0..count).map(|row| rows.row(row)))
    }

    /// The numbers as rows of this width, all within a bound.
    fn checked(&self, width: usize, is_one: bool, bound: Bound) -> PyResult<Rows<'_>> {
        let values = self.array.as_slice()?;
        held(&self.field, values, bound, |at| match self.shape() {
            [] => String::new(),
            [_] => format!("[{at}]"),
            _ => format!("[{}][{}]", at / width, at % width),
        })?;
        Ok(Rows { values, is_one })
    }
}

/// A shape as Python prints it.
fn in_python(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        all => format!("{all:?}").replace('[', "(").replace(']', ")"),
    }
}

/// The array itself if it can be read as one slice, row after row; otherwise a copy.
///
/// A slice of a column-major array would have the numbers in another order. A field of a packed record has a
/// stride that is not a whole number of doubles. A read-only array may be one of a batch, and a borrow would block
/// the threads that step the batch.
pub(crate) fn laid_out<'py, T: Element, D: Dimension>(
    array: &Held<'py, PyArray<T, D>>,
) -> PyResult<Held<'py, PyArray<T, D>>> {
    if array.is_c_contiguous() && array.is_aligned() && is_writeable(array)? {
        return Ok(array.clone());
    }
    Ok(array.call_method1("copy", ("C",))?.cast_into()?)
}

fn is_writeable(array: &Object<'_>) -> PyResult<bool> {
    let py = array.py();
    let flags = array.getattr(intern!(py, "flags"))?;
    flags.getattr(intern!(py, "writeable"))?.is_truthy()
}

/// Converts everything that NumPy can convert to doubles, except booleans, complex numbers, text and `None`.
#[pyfunction]
pub(crate) fn as_doubles<'py>(value: &Object<'py>) -> PyResult<Held<'py, PyArrayDyn<f64>>> {
    let py = value.py();
    if has_booleans(value)? {
        return Err(wrong_type(shown(value)));
    }
    let numpy = py.import("numpy")?;
    let array = numpy.call_method1("asarray", (value,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    let array = if kind == "O" {
        // NumPy would read texts, and convert None to NaN. It refuses numbers beyond doubles itself.
        for one in array.getattr("flat")?.try_iter()? {
            let Ok(one) = one?.extract::<Real>();
            if let Real::Other(one) = one
                && !one.is_beyond
            {
                return Err(wrong_type(one));
            }
        }
        numpy.call_method1("asarray", (array, "float64"))?
    } else {
        let how = PyDict::new(py);
        how.set_item("casting", "same_kind")?;
        array.call_method("astype", ("float64",), Some(&how))?
    };
    Ok(array.cast_into()?)
}

/// One number per joint.
pub(crate) fn joints<const N: usize>(
    field: &str,
    value: &Object<'_>,
    bound: Bound,
) -> PyResult<[f64; N]> {
    let numbers = ArrayArgument::read(field, value)?;
    if *numbers.shape() != [N] {
        return Err(refused(format_args!(
            "{field} must be an array of {N} numbers, got {}",
            shown(value)
        )));
    }
    Ok(numbers.checked(N, true, bound)?.row(0))
}

/// As [`joints`], or `missing` without an argument.
pub(crate) fn joints_or<const N: usize>(
    field: &str,
    value: Option<&Object<'_>>,
    bound: Bound,
    missing: [f64; N],
) -> PyResult<[f64; N]> {
    value.map_or(Ok(missing), |value| joints(field, value, bound))
}

/// One row per arm, or one for all arms.
#[derive(Debug)]
pub(crate) struct Rows<'a> {
    values: &'a [f64],
    is_one: bool,
}

impl Rows<'_> {
    /// The row of an arm. `N` is the requested width.
    pub(crate) fn row<const N: usize>(&self, arm: usize) -> [f64; N] {
        let start = if self.is_one { 0 } else { arm * N };
        let row = self
            .values
            .get(start..start + N)
            .and_then(|row| row.try_into().ok());
        debug_assert!(row.is_some(), "the shape has been checked");
        row.unwrap_or([f64::NAN; N])
    }

    /// The number of an arm, from a column.
    pub(crate) fn number(&self, arm: usize) -> f64 {
        let [number] = self.row(arm);
        number
    }
}
