//! The points of rules, which a teacher chooses: a TOML file with a number for a rule, a section or a category.
//!
//! ```toml
//! method = 2                       # each rule of this section
//! method-4 = 5                     # this rule alone
//! "Inverse kinematics" = 0.5       # every other rule of this category
//! ```
//!
//! The narrowest line counts: of the rule, then of the section, then of the category. A rule without a line has 1 point.

use std::collections::BTreeMap;

use crate::{CATEGORIES, Results, Row, Rule, launch, rules};

/// The points of rules, sections and categories, by their names.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Points(BTreeMap<String, f64>);

impl Points {
    /// Reads a file's text.
    ///
    /// # Errors
    /// A line that is not `name = number`, names nothing or a name twice, or has a negative number. The error has its number.
    pub fn read(text: &str) -> Result<Self, String> {
        let mut points = BTreeMap::new();
        for (number, line) in (1..).zip(text.lines()) {
            let line = line.split('#').next().unwrap_or_default().trim();
            if line.is_empty() || line == "[points]" {
                continue;
            }
            let wrong = |why: &str| format!("line {number}: {why}, got {line:?}");
            let (name, value) = line.split_once('=').ok_or_else(|| wrong("must be `name = points`"))?;
            let name = name.trim().trim_matches(['"', '\'']);
            if !rules::all().chain(launch::RULES).any(|rule| names(&rule).contains(&name)) && !CATEGORIES.contains(&name) {
                return Err(wrong("must name a rule, a section or a category of --list"));
            }
            let value = value.trim().parse().ok().filter(|value: &f64| value.is_finite() && *value >= 0.0);
            let value = value.ok_or_else(|| wrong("points must be a number, at least 0"))?;
            if points.insert(name.to_owned(), value).is_some() {
                return Err(wrong("the name has points already"));
            }
        }
        Ok(Self(points))
    }

    /// The points of a rule.
    #[must_use]
    pub fn of(&self, rule: &Rule) -> f64 {
        names(rule).into_iter().find_map(|name| self.0.get(name).copied()).unwrap_or(1.0)
    }

    /// The earned points of a category, and all that can be earned; of all categories for an empty name.
    #[must_use]
    pub fn earned(&self, results: &Results, category: &str) -> [f64; 2] {
        let sum = |rows: &mut dyn Iterator<Item = &Row>| rows.map(|row| self.of(&row.rule)).sum();
        let counting = || results.rows.iter().filter(|row| row.counts_for(category));
        [sum(&mut counting().filter(|row| row.holds())), sum(&mut counting())]
    }
}

/// The names under which a rule has points, the narrowest first.
fn names(rule: &Rule) -> [&str; 3] {
    let section = rule.id.rsplit_once('-').map_or(rule.id, |(section, _)| section);
    [rule.id, section, rule.category]
}
