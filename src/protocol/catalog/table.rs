//! How a table of the catalog is written: rows, and the fields in them.
//!
//! **Invariant:** a table is an enum, so that the compiler asks what a row is for wherever rows are told apart.

/// Makes an enum of a table's rows: a variant for each, `ALL` in their order, and `entry`, which gives the row. A
/// variant behind the rows carries another table. A row with `if` and a feature is there only with that feature.
macro_rules! table {
    (
        $(#[$about:meta])*
        pub enum $name:ident of $entry:ty {
            $($(#[$doc:meta])* $row:ident $(if $feature:literal)? = $contents:expr,)*
        }
        $($(#[$nested_doc:meta])* $nested:ident($table:ident),)*
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum $name {
            $($(#[$doc])* $(#[cfg(feature = $feature)])? $row,)*
            $($(#[$nested_doc])* $nested($table),)*
        }

        impl $name {
            /// Every row of the table, in the order in which they are documented.
            pub const ALL: [Self; [$($(#[cfg(feature = $feature)])? stringify!($row)),*].len()] =
                [$($(#[cfg(feature = $feature)])? Self::$row),*];

            pub(super) const fn entry(self) -> &'static $entry {
                match self {
                    $($(#[cfg(feature = $feature)])? Self::$row => &const { $contents },)*
                    $(Self::$nested(row) => row.entry(),)*
                }
            }
        }
    };
}
pub(in crate::protocol) use table;

/// A list of fields in a row. It is a constant of its own: a row is an expression, and borrows its lists for ever.
macro_rules! fields {
    ($($field:expr),* $(,)?) => { const { &[$($field),*] } };
}
pub(super) use fields;
