//! The equation of motion and the kinematics, for one state or for many.
//!
//! **Invariant:** the same functions step the live arm. There is no second implementation.

use numpy::{IntoPyArray, PyArrayMethods, ToPyArray};
use pendularm::math::{self, dynamics, kinematics};
use pyo3::IntoPyObject;
use pyo3::prelude::{PyResult, Python, pyfunction};

use crate::arm::{Given, for_either};
use crate::arrays::{ArrayArgument, Rows, joints_or, room};
use crate::fields::{self, Bound, Held, Object, Real, refused};
use crate::floats::Promised;

/// The shape of a function's result for one state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shape {
    /// A number.
    One,
    /// A point of the plane.
    Point,
    /// A number per joint.
    Joints,
    /// A square matrix, with a row per joint.
    Square,
}

/// States per block. Their columns stay in the fastest cache.
const BLOCK: usize = 64;

/// Applies `function` to every row of the fields. A field with one row is combined with every row of the others. `N`
/// is the number of links of the arm.
fn each_row<'py, const N: usize, const K: usize>(
    py: Python<'py>,
    fields: [(&str, &Object<'py>); K],
    answer: Shape,
    function: impl Fn([[f64; N]; K], &mut Vec<f64>) + Sync,
) -> PyResult<Object<'py>> {
    all_rows(py, N, fields, answer, |rows, count, out| {
        for index in 0..count {
            function(rows.each_ref().map(|row| row.row(index)), out);
        }
    })
}

/// As [`each_row`], for an arm of `links` links, with a `function` that takes all rows and their number.
fn all_rows<'py, const K: usize>(
    py: Python<'py>,
    links: usize,
    fields: [(&str, &Object<'py>); K],
    answer: Shape,
    function: impl FnOnce(&[Rows<'_>; K], usize, &mut Vec<f64>) + Send,
) -> PyResult<Object<'py>> {
    let _floats = Promised::begin();
    let mut given = Vec::with_capacity(K);
    for (field, value) in fields {
        given.push((field, ArrayArgument::read(field, value)?));
    }
    let counts = || {
        given
            .iter()
            .filter_map(|(_, numbers)| match numbers.shape() {
                [count, _] => Some(*count),
                _ => None,
            })
    };
    // A table with one row is combined with those with more.
    let count = counts().find(|&count| count != 1).or(counts().next());
    let mut rows: Vec<Rows<'_>> = Vec::with_capacity(K);
    for (_, numbers) in &given {
        let each = match numbers.shape() {
            [1, _] => Some(1),
            _ => count,
        };
        rows.push(numbers.rows(each, links, Bound::Finite)?);
    }
    let rows: [Rows<'_>; K] = rows
        .try_into()
        .map_err(|_| refused("as many rows as fields"))?;
    let mut shape: Vec<usize> = count.into_iter().collect();
    match answer {
        Shape::One => {}
        Shape::Point => shape.push(2),
        Shape::Joints => shape.push(links),
        Shape::Square => shape.extend([links, links]),
    }
    let mut flat = room(shape.iter().product())?;
    match count {
        // This is less work than releasing the interpreter's lock.
        None => function(&rows, 1, &mut flat),
        Some(count) => py.detach(|| function(&rows, count, &mut flat)),
    }
    if shape.is_empty() {
        return Ok(flat
            .first()
            .copied()
            .unwrap_or(f64::NAN)
            .into_pyobject(py)?
            .into_any());
    }
    Ok(flat.into_pyarray(py).reshape(shape)?.into_any())
}

/// Functions of an arm and of one row or many of each field, applied row by row.
macro_rules! of_rows {
    ($(
        $(#[$doc:meta])*
        $name:ident($arm:ident, $($field:ident),+) -> $answer:ident, $out:ident => $body:expr;
    )+) => {$(
        $(#[$doc])*
        #[pyfunction]
        pub(crate) fn $name<'py>(
            py: Python<'py>,
            arm: Given<'py>,
            $($field: Object<'py>),+
        ) -> PyResult<Object<'py>> {
            for_either!(&arm.chain()?, $arm => {
                let fields = [$((stringify!($field), &$field)),+];
                each_row(py, fields, Shape::$answer, |[$($field),+], $out| $body)
            })
        }
    )+};
}

of_rows! {
    /// Mass matrix M(q) [kg m²] at joint positions `q` [rad], of shape (links,) or (n, links): (links, links) or (n,
    /// links, links).
    mass_matrix(arm, q) -> Square, out => out.extend(dynamics::mass_matrix(arm, &q).as_flattened());
    /// Coriolis and centrifugal effort C(q, qd) qd [N m] at positions `q` [rad] and rates `qd` [rad/s], of shape
    /// (links,) or (n, links).
    coriolis(arm, q, qd) -> Joints, out => out.extend(dynamics::coriolis(arm, &q, &qd));
    /// Gravity load G(q) [N m], the effort that holds the arm still at `q` [rad], of shape (links,) or (n, links).
    gravity_load(arm, q) -> Joints, out => out.extend(dynamics::gravity_load(arm, &q));
    /// The effort [N m] that gives the accelerations `qdd` [rad/s²] at `q` [rad] and `qd` [rad/s], each of shape
    /// (links,) or (n, links). Friction counts.
    inverse_dynamics(arm, q, qd, qdd) -> Joints, out => {
        let effort = dynamics::inverse_dynamics(arm, &q, &qd, &qdd);
        out.extend(with_friction(arm, &qd.map(|rate| -rate), effort));
    };
    /// Kinetic energy [J] at `q` [rad] and `qd` [rad/s], of shape (links,) or (n, links): a number, or (n,).
    kinetic_energy(arm, q, qd) -> One, out => out.push(dynamics::kinetic_energy(arm, &q, &qd));
    /// Potential energy [J] at `q` [rad], of shape (links,) or (n, links), zero with the arm along the x axis: a
    /// number, or (n,).
    potential_energy(arm, q) -> One, out => out.push(dynamics::potential_energy(arm, &q));
    /// Position of the end effector [m], (2,) or (n, 2), at `q` [rad] of shape (links,) or (n, links).
    end_effector(arm, q) -> Point, out => out.extend(kinematics::forward(arm.lengths(), &q).position.to_array());
}

/// The effort [N m] less the friction at these rates [rad/s]. Without friction it is the same, bit for bit.
fn with_friction<const N: usize>(
    arm: &math::arm::Arm<N>,
    rates: &[f64; N],
    effort: [f64; N],
) -> [f64; N] {
    if arm.has_friction() {
        dynamics::less_friction(arm.viscous(), rates, &effort)
    } else {
        effort
    }
}

/// Joint accelerations [rad/s²] under `effort` [N m] at `q` [rad] and `qd` [rad/s], each of shape (links,) or (n,
/// links). Friction counts.
#[pyfunction]
pub(crate) fn forward_dynamics<'py>(
    py: Python<'py>,
    arm: Given<'py>,
    q: Object<'py>,
    qd: Object<'py>,
    effort: Object<'py>,
) -> PyResult<Object<'py>> {
    for_either!(&arm.chain()?, arm => {
        let fields = [("q", &q), ("qd", &qd), ("effort", &effort)];
        all_rows(py, arm.lengths().len(), fields, Shape::Joints, |rows, count, out| {
            forward_dynamics_of_rows(arm, rows, count, out);
        })
    })
}

/// Appends the accelerations of `count` rows of positions, rates and efforts, a block in registers at a time.
fn forward_dynamics_of_rows<const N: usize>(
    arm: &math::arm::Arm<N>,
    rows: &[Rows<'_>; 3],
    count: usize,
    out: &mut Vec<f64>,
) {
    let mut given = [[[0.0; BLOCK]; N]; 3];
    let mut found = [[0.0; BLOCK]; N];
    for start in (0..count).step_by(BLOCK) {
        let block = start..count.min(start + BLOCK);
        for (columns, rows) in given.iter_mut().zip(rows) {
            for (at, index) in block.clone().enumerate() {
                let row: [f64; N] = rows.row(index);
                for (column, value) in columns.iter_mut().zip(row) {
                    column[at] = value;
                }
            }
        }
        let [_, rates, efforts] = &mut given;
        for at in 0..block.len() {
            let [rate, effort] =
                [&*rates, &*efforts].map(|columns| columns.map(|column| column[at]));
            let net = with_friction(arm, &rate, effort);
            for (column, value) in efforts.iter_mut().zip(net) {
                column[at] = value;
            }
        }
        let [q, qd, effort] = given
            .each_ref()
            .map(|columns| columns.each_ref().map(|column| &column[..block.len()]));
        let qdd = found.each_mut().map(|column| &mut column[..]);
        dynamics::batch::forward_dynamics(arm, q, qd, effort, qdd);
        out.extend((0..block.len()).flat_map(|at| found.each_ref().map(|column| column[at])));
    }
}

/// Joint positions [rad], (links,), each in (-pi, pi], that put the end effector on (`x`, `y`) [m].
///
/// `phi` [rad] is the heading of the last of 3 links, and is ignored for 2. `present` [rad] selects among the
/// solutions, as the arm's present pose in `/ik/solve`. Raises `ValueError` with the exceeded limit.
#[pyfunction]
#[pyo3(signature = (arm, x, y, phi=None, *, present=None))]
pub(crate) fn inverse_kinematics<'py>(
    py: Python<'py>,
    arm: Given<'py>,
    x: Real,
    y: Real,
    phi: Option<Real>,
    present: Option<Object<'py>>,
) -> PyResult<Held<'py, numpy::PyArray1<f64>>> {
    let _floats = Promised::begin();
    let (x, y) = (
        fields::number("x", x, Bound::Finite)?,
        fields::number("y", y, Bound::Finite)?,
    );
    let phi = phi.map(|phi| phi.read("phi")).transpose()?;
    for_either!(&arm.chain()?, arm => {
        if let (3, Some(phi)) = (arm.lengths().len(), phi) {
            fields::number("phi", Real::Is(phi), Bound::Finite)?;
        }
        let target = kinematics::Target { position: [x, y].into(), orientation: phi };
        let present = joints_or("present", present.as_ref(), Bound::Finite, [0.0; _])?;
        let positions = kinematics::solve(arm.lengths(), &present, &target).map_err(refused)?;
        Ok(positions.to_pyarray(py))
    })
}
