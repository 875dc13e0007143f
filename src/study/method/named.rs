//! Methods of textbooks, by name.
//!
//! Sources: Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I* (1993), ch. II.1, II.4 and II.5; Butcher,
//! *Numerical Methods for Ordinary Differential Equations* (2016), ch. 3; for pairs, Hairer, Lubich and Wanner (2006), ch. VI.

use super::super::tableau::{Pair, rows};
use super::given::{Given, Typed};

/// The names of the methods.
pub const NAMES: [&str; 17] = [
    "euler",
    "midpoint",
    "heun2",
    "ralston2",
    "kutta3",
    "heun3",
    "ralston3",
    "ssprk3",
    "bogacki_shampine3",
    "rk4",
    "three_eighths",
    "fehlberg4",
    "cash_karp5",
    "dormand_prince5",
    "butcher6",
    "semi_implicit",
    "verlet",
];

/// The Runge-Kutta methods that are not the live arm's: name, rows of `a`, `b`, and `b_hat` where there is an embedded
/// method.
const TEXTBOOKS: &str = include_str!("textbooks.txt");

/// A method of the [`NAMES`].
pub fn named(name: &str) -> Option<Given> {
    if name == "semi_implicit" {
        return Some(Given::new(Pair::semi_implicit()));
    }
    let mut entries = TEXTBOOKS.split("- ");
    let Some(found) = entries.find_map(|it| it.strip_prefix(name)?.strip_prefix(": ")) else {
        return Some(Given::new(Pair::of(name.parse().ok()?)));
    };
    let mut parts = found.split('|').map(rows);
    let (a, b) = (parts.next()??, parts.next()??.concat());
    let b_hat = parts.next().flatten().map(|rows| rows.concat());
    let typed = Typed {
        a,
        b,
        b_hat,
        ..Typed::default()
    };
    Given::try_from(&typed).ok()
}
