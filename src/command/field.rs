//! A part of a message, as `--field` names it: `header.stamp`, `position[0]`.
//!
//! **Invariant:** a part is spelled as it came.

use std::collections::BTreeMap;

use serde_json::value::RawValue;

use super::error::CommandError;

/// The way from a message to a part of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FieldPath {
    text: String,
    steps: Vec<PathStep>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum PathStep {
    Member(String),
    Item(usize),
}

/// A path of names with dots between them, each with the number of an item in brackets if it is an array.
pub(super) fn read_path(text: &str) -> Result<FieldPath, String> {
    let mut steps = Vec::new();
    for part in text.split('.') {
        let (name, items) = part.split_at(part.find('[').unwrap_or(part.len()));
        let items: Option<Vec<PathStep>> = items
            .split_inclusive(']')
            .map(|item| item.strip_prefix('[')?.strip_suffix(']')?.parse().ok())
            .map(|item| item.map(PathStep::Item))
            .collect();
        match items {
            Some(items) if !name.is_empty() => {
                steps.push(PathStep::Member(name.to_owned()));
                steps.extend(items);
            }
            _ => return Err("must be a field's name, such as header.stamp or position[0]".into()),
        }
    }
    Ok(FieldPath {
        text: text.to_owned(),
        steps,
    })
}

impl FieldPath {
    /// The part of a message to which it leads.
    ///
    /// # Errors
    /// If there is none.
    pub(super) fn pick<'a>(&self, message: &'a RawValue) -> Result<&'a RawValue, CommandError> {
        let picked = self
            .steps
            .iter()
            .try_fold(message, |value, step| step.pick(value));
        picked.ok_or_else(|| CommandError::refused(&format!("the message has no {}", self.text)))
    }
}

impl PathStep {
    fn pick<'a>(&self, value: &'a RawValue) -> Option<&'a RawValue> {
        match self {
            Self::Member(name) => {
                let members: BTreeMap<String, &RawValue> =
                    serde_json::from_str(value.get()).ok()?;
                members.get(name).copied()
            }
            Self::Item(index) => {
                let items: Vec<&RawValue> = serde_json::from_str(value.get()).ok()?;
                items.get(*index).copied()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picked(path: &str) -> Result<String, String> {
        let message =
            r#"{"header": {"stamp": {"sec": 7}}, "position": [0.10, -2e0], "rows": [[1], [2, 3]]}"#;
        let message = RawValue::from_string(message.to_owned()).unwrap();
        let part = read_path(path)?;
        let part = part.pick(&message).map_err(|error| error.to_string())?;
        Ok(part.get().to_owned())
    }

    #[test]
    fn a_part_is_spelled_as_it_came() {
        for (path, expected) in [
            ("header.stamp", r#"{"sec": 7}"#),
            ("header.stamp.sec", "7"),
            ("position", "[0.10, -2e0]"),
            ("position[0]", "0.10"),
            ("rows[1][0]", "2"),
        ] {
            assert_eq!(picked(path).as_deref(), Ok(expected), "{path}");
        }
    }

    #[test]
    fn a_part_that_is_not_there_is_named() {
        for path in [
            "velocity",
            "header.stamp.sec.x",
            "position[2]",
            "header[0]",
            "position.x",
        ] {
            assert_eq!(picked(path), Err(format!("the message has no {path}")));
        }
    }

    #[test]
    fn other_paths_are_bad_usage() {
        for path in [
            "", ".", "a.", "a..b", "[0]", "a[", "a[x]", "a[-1]", "a[0", "a[0]b", "a[0]]", "a[]",
        ] {
            let refused = read_path(path).unwrap_err();
            assert!(
                refused.starts_with("must be a field's name"),
                "{path}: {refused}"
            );
        }
    }
}
