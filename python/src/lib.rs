//! The arm of pendularm for Python: the steps of the live runtime, as a library that takes and returns NumPy arrays.
//!
//! This layer is thin: it reads arguments, and the `pendularm` crate computes everything and steps every arm. Users
//! import `package/pendularm/`, which wraps this module.
//!
//! **Invariant:** every computation runs in the promised floating-point environment (`floats`). Work of more than some milliseconds runs with the interpreter's lock released, and ends at a
//! signal.

mod arm;
mod arrays;
mod batch;
mod dynamics;
mod fields;
mod floats;
mod gains;
mod held;
mod method;
mod patience;
mod robot;
mod simulation;
mod state;
mod study;

/// The compiled part of the package `pendularm`.
#[pyo3::pymodule(name = "_native")]
mod native {
    /// Version and sources of this wheel.
    #[pymodule_export]
    const BUILD: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("PENDULARM_SOURCES"));
    #[pymodule_export]
    use crate::arm::Arm;
    #[pymodule_export]
    use crate::arrays::as_doubles;
    #[pymodule_export]
    use crate::batch::Batch;
    #[pymodule_export]
    use crate::dynamics::{
        coriolis, end_effector, forward_dynamics, gravity_load, inverse_dynamics,
        inverse_kinematics, kinetic_energy, mass_matrix, potential_energy,
    };
    #[pymodule_export]
    use crate::fields::{is_masked, is_too_long};
    #[pymodule_export]
    use crate::floats::PromisedFloats;
    #[pymodule_export]
    use crate::gains::default_gains;
    #[pymodule_export]
    use crate::held::held_limit;
    #[pymodule_export]
    use crate::method::{amplification, analyse_method, tableau};
    #[pymodule_export]
    use crate::simulation::{Divergence, Simulation};
    #[pymodule_export]
    use crate::study::{linearize, plan, rollout, stability, suggest_gains};
}
