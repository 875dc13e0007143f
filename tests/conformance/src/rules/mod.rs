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

use crate::{Category, Rule};

/// All rules, in the order of the specification's sections.
pub fn all() -> impl Iterator<Item = Rule> {
    let sections = [
        (Category::Dynamics, envelope::RULES),
        (Category::Integrators, checkpoint::RULES),
        (Category::Dynamics, topics::RULES),
        (Category::Dynamics, control_services::RULES),
        (Category::Pid, pid::RULES),
        (Category::Dynamics, dynamics::RULES),
        (Category::Integrators, methods::RULES),
        (Category::Kinematics, kinematics::RULES),
        (Category::Kinematics, goals::RULES),
        (Category::Kinematics, trials::RULES),
    ];
    sections.into_iter().flat_map(|(category, rules)| rules.iter().map(move |rule| Rule { category, ..*rule }))
}
