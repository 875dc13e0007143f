//! Rows of comma-separated values, for whoever wants to draw the figures again.
//!
//! **Invariant:** numbers are written so that reading them back gives the same bits; a missing number is an empty
//! field.

use std::fmt::Write;

/// A table under construction.
#[derive(Debug, Clone)]
pub(crate) struct Csv {
    text: String,
}

/// One field.
#[derive(Debug, Clone)]
pub(crate) enum CsvField<'a> {
    Text(&'a str),
    Real(f64),
    Count(u64),
    Missing,
}

impl Csv {
    pub(crate) fn new(head: &str) -> Self {
        Self {
            text: format!("{head}\n"),
        }
    }

    pub(crate) fn row(&mut self, fields: &[CsvField<'_>]) {
        for (index, field) in fields.iter().enumerate() {
            if index > 0 {
                self.text.push(',');
            }
            // Writing to a string cannot fail.
            let _ = match field {
                CsvField::Text(text) if text.contains([',', '"', '\n']) => {
                    write!(self.text, "\"{}\"", text.replace('"', "\"\""))
                }
                CsvField::Text(text) => write!(self.text, "{text}"),
                CsvField::Real(value) if value.is_finite() => write!(self.text, "{value:e}"),
                CsvField::Count(value) => write!(self.text, "{value}"),
                CsvField::Real(_) | CsvField::Missing => Ok(()),
            };
        }
        self.text.push('\n');
    }

    pub(crate) fn into_text(self) -> String {
        self.text
    }
}

impl From<f64> for CsvField<'_> {
    fn from(value: f64) -> Self {
        Self::Real(value)
    }
}

impl From<u64> for CsvField<'_> {
    fn from(value: u64) -> Self {
        Self::Count(value)
    }
}

impl<'a> From<&'a str> for CsvField<'a> {
    fn from(text: &'a str) -> Self {
        Self::Text(text)
    }
}

impl<T: Into<Self>> From<Option<T>> for CsvField<'_> {
    fn from(value: Option<T>) -> Self {
        value.map_or(Self::Missing, Into::into)
    }
}
