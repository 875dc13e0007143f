//! The arrays of a batch's values.
//!
//! **Invariant:** they are created once, and are read-only for users.

use numpy::{Element, PyArray, PyArrayMethods, PyReadwriteArray};
use pyo3::IntoPyObject;
use pyo3::prelude::{Py, PyAny, PyAnyMethods, PyResult, Python};
use pyo3::types::PyMemoryView;

use super::lanes::Shown;
use crate::fields::{Held, refused};

/// An array of the arms' values, and the users' view of it.
#[derive(Debug)]
pub(super) struct Window<T, D> {
    array: Py<PyArray<T, D>>,
    pub(super) view: Py<PyAny>,
}

impl<T: Element, D: numpy::ndarray::Dimension> Window<T, D> {
    pub(super) fn onto(array: Held<'_, PyArray<T, D>>) -> PyResult<Self> {
        // Users could make a view of the array writable, but not one of read-only memory.
        let py = array.py();
        let memory = PyMemoryView::from(&array)?.call_method0("toreadonly")?;
        let view = py.import("numpy")?.call_method1("asarray", (memory,))?;
        Ok(Self {
            array: array.unbind(),
            view: view.unbind(),
        })
    }

    fn write<'py>(&self, py: Python<'py>) -> PyResult<PyReadwriteArray<'py, T, D>> {
        let array = self.array.bind(py).try_readwrite();
        array.map_err(|_| {
            refused("this batch's own arrays are in use elsewhere: pass copies of them")
        })
    }
}

/// An array of zeros. `PyArray::zeros` would panic without memory.
fn zeros<'py, T: Element, D: numpy::ndarray::Dimension>(
    py: Python<'py>,
    shape: impl IntoPyObject<'py>,
) -> PyResult<Held<'py, PyArray<T, D>>> {
    let numpy = py.import("numpy")?;
    Ok(numpy
        .call_method1("zeros", (shape, T::get_dtype(py)))?
        .cast_into()?)
}

/// The arrays of the arms' values.
#[derive(Debug)]
pub(super) struct Windows {
    pub(super) position: Window<f64, numpy::Ix2>,
    pub(super) velocity: Window<f64, numpy::Ix2>,
    pub(super) effort: Window<f64, numpy::Ix2>,
    pub(super) time: Window<f64, numpy::Ix1>,
    pub(super) diverged: Window<bool, numpy::Ix1>,
}

impl Windows {
    /// Arrays of zeros.
    pub(super) fn of(py: Python<'_>, arms: usize, links: usize) -> PyResult<Self> {
        let joints = || Window::onto(zeros(py, (arms, links))?);
        Ok(Self {
            position: joints()?,
            velocity: joints()?,
            effort: joints()?,
            time: Window::onto(zeros(py, (arms,))?)?,
            diverged: Window::onto(zeros(py, (arms,))?)?,
        })
    }

    /// Calls `write` for them, with the interpreter's lock released. If they are in use elsewhere, `write` is not
    /// called.
    pub(super) fn write(
        &self,
        py: Python<'_>,
        write: impl FnOnce(Shown<'_>) + Send,
    ) -> PyResult<()> {
        let mut position = self.position.write(py)?;
        let mut velocity = self.velocity.write(py)?;
        let mut effort = self.effort.write(py)?;
        let mut time = self.time.write(py)?;
        let mut diverged = self.diverged.write(py)?;
        let shown = Shown {
            position: position.as_slice_mut()?,
            velocity: velocity.as_slice_mut()?,
            effort: effort.as_slice_mut()?,
            time: time.as_slice_mut()?,
            diverged: diverged.as_slice_mut()?,
        };
        py.detach(|| write(shown));
        Ok(())
    }
}
