//! The types that are inside requests and responses alone.
//!
//! **Invariant:** the members are the fields of the service that sets them.

use super::entry::{Field, Type, message, optional, required};

pub(super) const PARAMS: [Field; 3] = [
    optional("gravity", "float64", "m/s^2"),
    optional("masses", "float64[]", "kg"),
    optional("lengths", "float64[]", "m"),
];
pub(super) const GAINS: [Field; 3] = [
    optional("kp", "float64[]", "N m/rad"),
    optional("ki", "float64[]", "N m/(rad s)"),
    optional("kd", "float64[]", "N m s/rad"),
];
/// The type of a request's `gains`; its members are the fields of `/pid_controller/set_gains`.
pub(super) const GAINS_TYPE: &str = "pendularm_interfaces/msg/Gains";
/// The type of a request's `params`; its members are the fields of `/arm_sim/set_params`.
pub(super) const PARAMS_TYPE: &str = "pendularm_interfaces/msg/Params";
/// The type of `critical` in a response.
pub(super) const CRITICAL_TYPE: &str = "pendularm_interfaces/msg/CriticalMode";
pub(super) const CRITICAL: [Field; 3] = [
    required("growth_per_step", "float64", ""),
    required("frequency", "float64", "Hz"),
    required("joint", "int64", ""),
];

/// The types that are inside requests and responses alone.
pub(super) const TYPES: [Type; 3] = [
    message(GAINS_TYPE, &GAINS),
    message(PARAMS_TYPE, &PARAMS),
    message(CRITICAL_TYPE, &CRITICAL),
];

impl Field {
    /// The members of an object field of a request or a response, in documented order; empty for every other field.
    #[must_use]
    pub fn members(&self) -> &'static [Self] {
        match self.kind {
            GAINS_TYPE => &GAINS,
            PARAMS_TYPE => &PARAMS,
            CRITICAL_TYPE => &CRITICAL,
            _ => &[],
        }
    }
}
