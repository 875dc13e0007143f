//! The rules, a file for each part of the specification, in its order.

pub mod checkpoint;
pub mod control_services;
pub mod dynamics;
pub mod envelope;
pub mod goals;
pub mod kinematics;
pub mod methods;
pub mod pid;
pub mod topics;
pub mod trials;

use crate::Rule;

/// All rules, in the order of the specification's sections.
pub fn all() -> impl Iterator<Item = Rule> {
    let sections = [
        envelope::RULES,
        checkpoint::RULES,
        topics::RULES,
        control_services::RULES,
        pid::RULES,
        dynamics::RULES,
        methods::RULES,
        kinematics::RULES,
        goals::RULES,
        trials::RULES,
    ];
    sections.into_iter().flatten().copied()
}
