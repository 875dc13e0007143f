//! Readers of arguments from Python, with the field names of the runtime's services.
//!
//! **Invariant:** a refused value raises an error with its field, the valid values and the given value: a `TypeError` if
//! its type is wrong, otherwise a `ValueError`.

use std::convert::Infallible;
use std::ffi::CString;
use std::fmt::{self, Display, Formatter};
use std::ops::RangeInclusive;

use numpy::PyUntypedArray;
use pendularm::math::integrator::Method;
use pyo3::exceptions::{PyDeprecationWarning, PyOverflowError, PyTypeError, PyValueError};
use pyo3::intern;
use pyo3::prelude::{FromPyObject, PyAny, PyAnyMethods, PyErr, PyResult, pyfunction};
use pyo3::types::{PyBool, PyFloat, PyInt, PyList, PyStringMethods, PyTuple};
use pyo3::{Borrowed, PyTypeInfo};

/// Most dimensions of an array, and so the largest depth of nested lists.
const MOST_DIMENSIONS: usize = 2;

/// Most entries of a sequence that is not a NumPy array. NumPy would allocate all of a range.
pub(crate) const MOST_LISTED: usize = 10_000_000;

/// The valid numbers of a field.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bound {
    Finite,
    Positive,
    NotNegative,
    /// Not negative. Infinity means no limit.
    Limit,
}

impl Bound {
    fn wants(self) -> &'static str {
        match self {
            Self::Finite => "finite",
            Self::Positive => "finite and greater than 0",
            Self::NotNegative => "finite and at least 0",
            Self::Limit => "at least 0, or inf for no limit",
        }
    }

    /// Whether the number is valid.
    pub(crate) fn admits(self, value: f64) -> bool {
        match self {
            Self::Finite => value.is_finite(),
            Self::Positive => value.is_finite() && value > 0.0,
            Self::NotNegative => value.is_finite() && value >= 0.0,
            Self::Limit => value >= 0.0,
        }
    }
}

/// The refusal of a value.
pub(crate) fn refused(why: impl Display) -> PyErr {
    PyValueError::new_err(why.to_string())
}

/// The refusal of a value of a wrong type.
pub(crate) fn wrong_type(why: impl Display) -> PyErr {
    PyTypeError::new_err(why.to_string())
}

/// A Python object, with the proof that the interpreter's lock is held.
pub(crate) type Held<'py, T> = pyo3::Bound<'py, T>;

/// Any object.
pub(crate) type Object<'py> = pyo3::Bound<'py, PyAny>;

/// An object as shown in an error. A long array is shortened.
pub(crate) fn shown(value: &Object<'_>) -> String {
    // Python does not print integers with thousands of digits.
    let Ok(text) = value.repr() else {
        return format!("an object of {}", value.get_type());
    };
    let text = text.to_string_lossy();
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}...", text.get(..end).unwrap_or_default()),
        None => text.into_owned(),
    }
}

/// The refusal of a number that is too large, such as a Python integer.
pub(crate) fn beyond(field: &str) -> PyErr {
    refused(format_args!(
        "{field} must be finite, got a number that no double holds"
    ))
}

/// Whether some of these numbers are masked. NumPy also reads masked numbers inside a list.
#[pyfunction]
pub(crate) fn is_masked(value: &Object<'_>) -> PyResult<bool> {
    is_masked_within(value, MOST_DIMENSIONS)
}

/// Whether this is a boolean, or some entries of a list or an array are. NumPy reads them as 0 and 1.
pub(crate) fn has_booleans(value: &Object<'_>) -> PyResult<bool> {
    has_booleans_within(value, MOST_DIMENSIONS)
}

fn has_booleans_within(value: &Object<'_>, depth: usize) -> PyResult<bool> {
    if value.is_instance_of::<PyFloat>() || value.is_exact_instance_of::<PyInt>() {
        return Ok(false);
    }
    if value.is_instance_of::<PyBool>() {
        return Ok(true);
    }
    let is_listed = value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>();
    if !is_listed {
        let Some(kind) = value.getattr_opt(intern!(value.py(), "dtype"))? else {
            return Ok(false);
        };
        let kind = kind.getattr_opt(intern!(value.py(), "kind"))?;
        let kind = kind.and_then(|kind| kind.extract::<String>().ok());
        match kind.as_deref() {
            Some("b") => return Ok(true),
            Some("O") => {}
            _ => return Ok(false),
        }
        if !value.is_instance_of::<PyUntypedArray>() {
            return Ok(false);
        }
    }
    if depth > 0 {
        let parts = if is_listed {
            value.clone()
        } else {
            value.getattr("flat")?
        };
        for one in parts.try_iter()? {
            if has_booleans_within(&one?, depth - 1)? {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

fn is_masked_within(value: &Object<'_>, depth: usize) -> PyResult<bool> {
    if value.is_exact_instance_of::<PyFloat>() {
        return Ok(false);
    }
    let parts = if value.is_instance_of::<PyUntypedArray>() {
        if !value.is_exact_instance_of::<PyUntypedArray>() {
            let masked = value.py().import("numpy.ma")?;
            if masked.call_method1("is_masked", (value,))?.is_truthy()? {
                return Ok(true);
            }
        }
        if !value.getattr("dtype")?.getattr("hasobject")?.is_truthy()? {
            return Ok(false);
        }
        value.getattr("flat")?
    } else if value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>() {
        value.clone()
    } else {
        return Ok(false);
    };
    if depth > 0 {
        for one in parts.try_iter()? {
            if is_masked_within(&one?, depth - 1)? {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// Whether this, or a part of it, has more than [`MOST_LISTED`] entries and would be copied entry by entry.
#[pyfunction]
pub(crate) fn is_too_long(value: &Object<'_>) -> PyResult<bool> {
    is_too_long_within(value, MOST_DIMENSIONS)
}

fn is_too_long_within(value: &Object<'_>, depth: usize) -> PyResult<bool> {
    let (py, has) = (value.py(), |name| value.hasattr(name));
    if value.is_exact_instance_of::<PyFloat>()
        || value.is_exact_instance_of::<PyInt>()
        || !has(intern!(py, "__len__"))?
        || has(intern!(py, "__array__"))?
    {
        return Ok(false);
    }
    match value.len() {
        Ok(length) if length <= MOST_LISTED => {}
        Ok(_) => return Ok(true),
        Err(why) => return Ok(why.is_instance_of::<PyOverflowError>(py)),
    }
    let has_parts = value.is_instance_of::<PyList>() || value.is_instance_of::<PyTuple>();
    if has_parts && depth > 0 {
        for one in value.try_iter()? {
            if is_too_long_within(&one?, depth - 1)? {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// Checks numbers against a bound. `place` gives the index of a wrong one.
pub(crate) fn held(
    field: &str,
    values: &[f64],
    bound: Bound,
    place: impl Fn(usize) -> String,
) -> PyResult<()> {
    match values.iter().position(|&value| !bound.admits(value)) {
        None => Ok(()),
        Some(at) => Err(refused(format_args!(
            "{field}{} must be {}, got {}",
            place(at),
            bound.wants(),
            values.get(at).copied().unwrap_or(f64::NAN)
        ))),
    }
}

/// An argument for this type. It is checked where its field's name is known.
#[derive(Debug)]
pub(crate) enum Argument<T> {
    Is(T),
    Other(Other),
}

/// A value of another type, as shown in an error.
#[derive(Debug)]
pub(crate) struct Other {
    shown: String,
    /// Whether it has the right type but is too large.
    pub(crate) is_beyond: bool,
}

impl Display for Other {
    fn fmt(&self, text: &mut Formatter<'_>) -> fmt::Result {
        text.write_str(&self.shown)
    }
}

/// Any number.
pub(crate) type Real = Argument<f64>;
/// A whole number that is not negative.
pub(crate) type Whole = Argument<u64>;
/// True or false, Python's or NumPy's.
pub(crate) type Flag = Argument<bool>;
/// The name of a method.
pub(crate) type Name = Argument<String>;

/// A type of arguments.
pub(crate) trait LosslessArgument {
    /// The valid values, as in a refusal.
    fn rule() -> String;

    /// Whether Python's conversion of a value to this type loses nothing.
    fn is_lossless(_value: Borrowed<'_, '_, PyAny>) -> bool {
        true
    }

    /// The refusal of a value that does not have this type, or is too large for it.
    fn refusal(field: &str, value: &Other) -> PyErr {
        let why = format_args!("{field} {}, got {value}", Self::rule()).to_string();
        if value.is_beyond {
            refused(why)
        } else {
            wrong_type(why)
        }
    }
}

impl<'a, 'py, T: LosslessArgument + FromPyObject<'a, 'py>> FromPyObject<'a, 'py> for Argument<T> {
    type Error = Infallible;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> Result<Self, Infallible> {
        let is_beyond = match T::is_lossless(value).then(|| value.extract::<T>()) {
            Some(Ok(found)) => return Ok(Self::Is(found)),
            Some(Err(why)) => why.into().is_instance_of::<PyOverflowError>(value.py()),
            None => false,
        };
        Ok(Self::Other(Other {
            shown: shown(&value),
            is_beyond,
        }))
    }
}

impl<T: LosslessArgument> Argument<T> {
    /// The value, if it has the type.
    pub(crate) fn read(self, field: &str) -> PyResult<T> {
        match self {
            Self::Is(value) => Ok(value),
            Self::Other(value) => Err(T::refusal(field, &value)),
        }
    }
}

impl LosslessArgument for f64 {
    fn rule() -> String {
        "must be a number".to_owned()
    }

    /// Booleans would count as 0 and 1. NumPy's complex numbers would lose their imaginary parts, and masked ones
    /// their masks.
    fn is_lossless(value: Borrowed<'_, '_, PyAny>) -> bool {
        let is_real = || {
            // NumPy would allocate all of a range before it finds that it is not a number.
            if !value.hasattr("__float__")? && !value.hasattr("__index__")? {
                return Ok(false);
            }
            let numpy = value.py().import("numpy")?;
            let is_complex = numpy.call_method1("iscomplexobj", (value,))?;
            PyResult::Ok(!is_complex.is_truthy()? && !is_masked(&value)? && !has_booleans(&value)?)
        };
        value.is_instance_of::<PyFloat>() || is_real().unwrap_or(false)
    }

    fn refusal(field: &str, value: &Other) -> PyErr {
        if value.is_beyond {
            return beyond(field);
        }
        wrong_type(format_args!("{field} {}, got {value}", Self::rule()))
    }
}

impl LosslessArgument for u64 {
    fn rule() -> String {
        "must be a whole number, at least 0 and less than 2^64".to_owned()
    }

    /// Booleans would count as 0 and 1, and masked numbers would lose their masks.
    fn is_lossless(value: Borrowed<'_, '_, PyAny>) -> bool {
        !value.is_instance_of::<PyBool>() && is_masked(&value).is_ok_and(|is_masked| !is_masked)
    }
}

impl LosslessArgument for bool {
    fn rule() -> String {
        "must be True or False".to_owned()
    }
}

impl LosslessArgument for String {
    fn rule() -> String {
        "must be a text".to_owned()
    }
}

impl Name {
    /// The method of this name.
    pub(crate) fn method(self, field: &str) -> PyResult<Method> {
        self.choice(field, &Method::ALL, Method::name)
    }

    /// One of `all`, by its name.
    pub(crate) fn choice<T: Copy>(
        self,
        field: &str,
        all: &[T],
        name: impl Fn(T) -> &'static str,
    ) -> PyResult<T> {
        let rule = || {
            let names: Vec<_> = all.iter().map(|&one| name(one)).collect();
            format!("{field} must be one of {}", names.join(", "))
        };
        match self {
            Self::Is(given) => {
                let found = all.iter().find(|&&one| name(one) == given);
                let refusal = || refused(format_args!("{}, got {given:?}", rule()));
                found.copied().ok_or_else(refusal)
            }
            Self::Other(given) => Err(wrong_type(format_args!("{}, got {given}", rule()))),
        }
    }
}

impl Whole {
    /// The number, from 1 to `most`.
    pub(crate) fn up_to(self, most: usize, field: &str) -> PyResult<usize> {
        self.within(
            1..=most,
            format_args!("{field} must be between 1 and {most}"),
        )
    }

    /// The number in a range. `rule` is the start of the refusal of another value.
    pub(crate) fn within(
        self,
        range: RangeInclusive<usize>,
        rule: impl Display,
    ) -> PyResult<usize> {
        match self {
            Self::Is(value) => usize::try_from(value)
                .ok()
                .filter(|value| range.contains(value))
                .ok_or_else(|| refused(format_args!("{rule}, got {value}"))),
            Self::Other(value) if value.is_beyond => {
                Err(refused(format_args!("{rule}, got {value}")))
            }
            Self::Other(value) => Err(wrong_type(format_args!("{rule}, got {value}"))),
        }
    }
}

/// An argument under its name, or under an `older` one, with a `DeprecationWarning`.
pub(crate) fn renamed<'py>(
    name: &str,
    given: Option<&Object<'py>>,
    older: &str,
    value: Option<&Object<'py>>,
) -> PyResult<Option<Object<'py>>> {
    let Some(value) = value else {
        return Ok(given.cloned());
    };
    if given.is_some() {
        return Err(wrong_type(format_args!(
            "{older} is an older name of {name}: pass one of them"
        )));
    }
    let py = value.py();
    let text = CString::new(format!("{older} is an older name of {name}"))?;
    PyErr::warn(py, &PyDeprecationWarning::type_object(py), &text, 1)?;
    Ok(Some(value.clone()))
}

/// As [`renamed`], for an argument that must be given.
pub(crate) fn required<'py>(
    name: &str,
    given: Option<&Object<'py>>,
    older: &str,
    value: Option<&Object<'py>>,
) -> PyResult<Object<'py>> {
    let missing = || wrong_type(format_args!("missing the required argument {name}"));
    renamed(name, given, older, value)?.ok_or_else(missing)
}

/// A count, if this is one. It must not be masked.
pub(crate) fn count(value: &Object<'_>) -> Option<u64> {
    // Booleans would count as 0 and 1.
    if value.is_instance_of::<PyBool>() {
        return None;
    }
    value.extract().ok()
}

/// One number.
pub(crate) fn number(field: &str, value: Real, bound: Bound) -> PyResult<f64> {
    let value = value.read(field)?;
    held(field, &[value], bound, |_| String::new())?;
    Ok(value)
}

/// 2 or 3.
pub(crate) fn links(value: Whole) -> PyResult<usize> {
    value.within(2..=3, "links must be 2 or 3")
}

/// A limit; infinity if there is none.
pub(crate) fn or_none(limit: Option<f64>) -> f64 {
    limit.unwrap_or(f64::INFINITY)
}

/// A value; NaN if it is not known.
pub(crate) fn known(value: Option<f64>) -> f64 {
    value.unwrap_or(f64::NAN)
}
