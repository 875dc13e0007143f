//! The arm of pendularm for Python: the steps of the live runtime, as a library that takes and returns NumPy arrays.
//!
//! Thin: values are read and named here, and everything is computed by the `pendularm` crate, whose simulation every
//! arm is stepped by. `package/pendularm/` is what users import; it words what this module answers.
//!
//! **Invariant:** work of more than some milliseconds runs with the interpreter's lock released, and ends when a
//! signal asks for it.

mod arm;
mod arrays;
mod batch;
mod dynamics;
mod fields;
mod gains;
mod patience;
mod simulation;
mod study;

/// The compiled part of the package `pendularm`.
#[pyo3::pymodule(name = "_native")]
mod native {
    #[pymodule_export]
    use crate::arm::Arm;
    #[pymodule_export]
    use crate::batch::Batch;
    #[pymodule_export]
    use crate::dynamics::{
        coriolis, end_effector, forward_dynamics, gravity_load, inverse_dynamics,
        inverse_kinematics, kinetic_energy, mass_matrix, potential_energy,
    };
    #[pymodule_export]
    use crate::gains::default_gains;
    #[pymodule_export]
    use crate::simulation::{Divergence, Simulation};
    #[pymodule_export]
    use crate::study::{plan, rollout, stability, suggest_gains};
}
