//! The macros that define a table of the catalog, and the members that tables have in common.
//!
//! **Invariant:** a table is an enum, so a `match` on rows must handle every row.

/// Defines an enum of a table's rows: a variant for each, `ALL` in their order, and `entry`, which returns the row. A
/// variant after the rows holds another table. A row with `if` and a feature exists only with that feature. The rows of a
/// table `of name` are names.
macro_rules! table {
    ($(#[$about:meta])* pub enum $name:ident of name { $($rows:tt)* }) => {
        table! { $(#[$about])* pub enum $name of &'static str { $($rows)* } }

        impl $name {
            /// The row's name, as on the wire.
            #[must_use]
            pub const fn name(self) -> &'static str {
                self.entry()
            }
        }
    };
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

/// The members of a table whose rows have a name, a type and a node. `nested` finds a row of the nested table.
macro_rules! named {
    ($table:ident, $nested:expr) => {
        impl $table {
            /// The name on the wire.
            #[must_use]
            pub const fn name(self) -> &'static str {
                self.entry().name
            }

            /// The row of that name, if it is one of the runtime's own. The leading slash is optional.
            #[must_use]
            pub fn from_name(name: &str) -> Option<Self> {
                let name = $crate::protocol::names::absolute(name);
                let own = Self::ALL.into_iter().find(|row| row.name() == name);
                own.or_else(|| $nested(&name))
            }

            /// The type in ROS notation.
            #[must_use]
            pub const fn type_name(self) -> &'static str {
                self.entry().type_name
            }

            /// The node that serves or publishes it, or subscribes to it.
            #[must_use]
            pub const fn owner(self) -> Node {
                self.entry().owner
            }
        }
    };
}
pub(super) use named;
