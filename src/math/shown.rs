//! Numbers in sentences for people.
//!
//! **Invariant:** whatever the number, it is short.

use std::fmt;

/// A number as a person would write it: 1e300 is not spelled out in 301 digits.
pub(crate) struct Shown(pub(crate) f64);

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(number) = self;
        if *number == 0.0 || (1e-4..1e7).contains(&number.abs()) || !number.is_finite() {
            write!(f, "{number}")
        } else {
            write!(f, "{number:e}")
        }
    }
}
