//! The rules: `rules.txt` has them in words, in the order of the specification's sections, and a file for each part has the checks.

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

/// A heading names a category. A row has the id, with the number of links if the rule is for one, the rule, the expected outcome,
/// and the words of the specification, unless the rule rests on common sense alone.
const RULES: &str = include_str!("rules.txt");

/// All rules, in the order of the specification's sections.
pub fn all() -> impl Iterator<Item = Rule> {
    let mut category = "";
    RULES.lines().filter_map(move |line| {
        if let Some(name) = line.strip_prefix("# ") {
            category = name;
            return None;
        }
        let mut cells = line.splitn(4, " | ");
        let (head, says, expected) = (cells.next()?, cells.next()?, cells.next()?);
        let (id, links) = head.split_once(" (").unwrap_or((head, ""));
        let links = links.strip_suffix(" links)").and_then(|links| links.parse().ok());
        let (_, check) = checks().find(|(name, _)| *name == id)?;
        Some(Rule { id, category, links, says, expected, rests_on: cells.next().unwrap_or_default(), check: *check })
    })
}

/// The checks of all parts.
pub fn checks() -> impl Iterator<Item = &'static crate::Check> {
    let parts = [
        envelope::CHECKS,
        checkpoint::CHECKS,
        topics::CHECKS,
        control_services::CHECKS,
        pid::CHECKS,
        dynamics::CHECKS,
        methods::CHECKS,
        kinematics::CHECKS,
        goals::CHECKS,
        trials::CHECKS,
    ];
    parts.into_iter().flatten()
}
