//! The parameters of an arm.
//!
//! **Invariant:** every arm is valid and never changes.

use numpy::PyArray1;
use pendularm::math::arm::Arm as Rods;
use pyo3::prelude::{PyAnyMethods, PyDictMethods, PyResult, Python, pyclass, pymethods};
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{joints_or, property};
use crate::fields::{self, Argument, Bound, Held, LosslessArgument, Object, Real, Whole, refused};
use crate::floats::Promised;

/// A value for 2 links or for 3: an arm, a simulation or another type.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Either<Two, Three> {
    Two(Two),
    Three(Three),
}

impl<Two, Three> Either<Two, Three> {
    pub(crate) fn links(&self) -> usize {
        match self {
            Self::Two(_) => 2,
            Self::Three(_) => 3,
        }
    }
}

/// Rods of 2 or 3 links.
pub(crate) type Chain = Either<Rods<2>, Rods<3>>;

/// Runs the same code for both numbers of links.
macro_rules! for_either {
    ($value:expr, $one:ident => $body:expr) => {
        match $value {
            $crate::arm::Either::Two($one) => $body,
            $crate::arm::Either::Three($one) => $body,
        }
    };
}
pub(crate) use for_either;

/// An arm: a chain of 2 or 3 uniform rods on revolute joints, and gravity along -y. It never changes.
///
/// Joint angles are relative to the previous link (the first to +x), counter-clockwise. `lengths` [m] and `masses`
/// [kg] have one number per link, 1 by default. `gravity` [m/s²] is 9.81 by default. `viscous` [N m s/rad] is the
/// friction of each joint, 0 by default. Raises `ValueError` for an invalid number.
#[pyclass(frozen, eq, module = "pendularm")]
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Arm {
    pub(crate) chain: Chain,
}

#[pymethods]
impl Arm {
    #[new]
    #[pyo3(
        signature = (
            links=Whole::Is(2), *, lengths=None, masses=None, gravity=Real::Is(9.81), viscous=None
        ),
        text_signature = "(links=2, *, lengths=None, masses=None, gravity=9.81, viscous=None)"
    )]
    fn new(
        links: Whole,
        lengths: Option<&Object<'_>>,
        masses: Option<&Object<'_>>,
        gravity: Real,
        viscous: Option<&Object<'_>>,
    ) -> PyResult<Self> {
        let gravity = gravity.read("gravity")?;
        let chain = match fields::links(links)? {
            2 => Chain::Two(read(lengths, masses, gravity, viscous)?),
            _ => Chain::Three(read(lengths, masses, gravity, viscous)?),
        };
        Ok(Self { chain })
    }

    /// Number of links, 2 or 3.
    #[getter]
    fn links(&self) -> usize {
        self.chain.links()
    }

    /// Link lengths [m], (links,).
    #[getter]
    fn lengths<'py>(&self, py: Python<'py>) -> PyResult<Held<'py, PyArray1<f64>>> {
        for_either!(&self.chain, arm => property(py, arm.lengths()))
    }

    /// Link masses [kg], (links,).
    #[getter]
    fn masses<'py>(&self, py: Python<'py>) -> PyResult<Held<'py, PyArray1<f64>>> {
        for_either!(&self.chain, arm => property(py, arm.masses()))
    }

    /// Gravity along -y [m/s²].
    #[getter]
    fn gravity(&self) -> f64 {
        for_either!(&self.chain, arm => arm.gravity())
    }

    /// Viscous friction of each joint [N m s/rad], (links,).
    #[getter]
    fn viscous<'py>(&self, py: Python<'py>) -> PyResult<Held<'py, PyArray1<f64>>> {
        for_either!(&self.chain, arm => property(py, arm.viscous()))
    }

    /// Distance from the base to the end effector of the stretched arm [m].
    #[getter]
    fn reach(&self) -> f64 {
        let _floats = Promised::begin();
        for_either!(&self.chain, arm => arm.reach())
    }

    fn __repr__(&self) -> String {
        for_either!(&self.chain, arm => format!(
            "Arm({}, lengths={:?}, masses={:?}, gravity={:?}, viscous={:?})",
            self.links(), arm.lengths(), arm.masses(), arm.gravity(), arm.viscous()
        ))
    }

    fn __hash__(&self, py: Python<'_>) -> PyResult<isize> {
        let numbers = for_either!(&self.chain, arm => {
            [arm.lengths().as_slice(), arm.masses(), &[arm.gravity()], arm.viscous()].concat()
        });
        PyTuple::new(py, numbers)?.hash()
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((usize,), Held<'py, PyDict>)> {
        let given = PyDict::new(py);
        given.set_item("lengths", self.lengths(py)?)?;
        given.set_item("masses", self.masses(py)?)?;
        given.set_item("gravity", self.gravity())?;
        given.set_item("viscous", self.viscous(py)?)?;
        Ok(((self.links(),), given))
    }
}

fn read<const N: usize>(
    lengths: Option<&Object<'_>>,
    masses: Option<&Object<'_>>,
    gravity: f64,
    viscous: Option<&Object<'_>>,
) -> PyResult<Rods<N>> {
    let _floats = Promised::begin();
    let lengths = joints_or("lengths", lengths, Bound::Positive, [1.0; N])?;
    let masses = joints_or("masses", masses, Bound::Positive, [1.0; N])?;
    let viscous = joints_or("viscous", viscous, Bound::NotNegative, [0.0; N])?;
    let arm = Rods::new(lengths, masses, gravity).and_then(|arm| arm.with_friction(viscous));
    arm.map_err(refused)
}

/// An arm as an argument.
pub(crate) type Given<'py> = Argument<Held<'py, Arm>>;

impl LosslessArgument for Held<'_, Arm> {
    fn rule() -> String {
        "must be an Arm".to_owned()
    }
}

impl Given<'_> {
    /// Its rods.
    pub(crate) fn chain(self) -> PyResult<Chain> {
        Ok(self.read("arm")?.get().chain)
    }
}

/// The rods of the given arm, or the default ones.
pub(crate) fn or_default(arm: Option<Given<'_>>) -> PyResult<Chain> {
    arm.map_or_else(|| Ok(Chain::Two(Rods::default())), Given::chain)
}
