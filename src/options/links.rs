//! The number of links, which decides everything about an arm.
//!
//! **Invariant:** there is an arm with default gains for each of them.

/// How many links the arm has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Links {
    /// A 2-link arm.
    #[default]
    Two,
    /// A 3-link arm.
    Three,
}

impl Links {
    /// The number itself.
    #[must_use]
    pub const fn count(self) -> usize {
        match self {
            Self::Two => 2,
            Self::Three => 3,
        }
    }
}
