//! Methods of textbooks, by name.
//!
//! Sources: Hairer, Nørsett and Wanner, *Solving Ordinary Differential Equations I* (1993), ch. II.1, II.4 and II.5; Butcher,
//! *Numerical Methods for Ordinary Differential Equations* (2016), ch. 3; for pairs, Hairer, Lubich and Wanner (2006), ch. VI.

use super::super::tableau::{Pair, Tableau};
use super::given::Given;

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

const THIRD: f64 = 1.0 / 3.0;

/// A Runge-Kutta method. Without an embedded method `b_hat` is empty.
struct Textbook {
    name: &'static str,
    a: &'static [&'static [f64]],
    b: &'static [f64],
    b_hat: &'static [f64],
}

/// The methods that are not the live arm's.
static TEXTBOOKS: [Textbook; 12] = [
    Textbook {
        name: "heun2",
        a: &[&[], &[1.0]],
        b: &[0.5, 0.5],
        b_hat: &[],
    },
    Textbook {
        name: "ralston2",
        a: &[&[], &[2.0 / 3.0]],
        b: &[0.25, 0.75],
        b_hat: &[],
    },
    Textbook {
        name: "kutta3",
        a: &[&[], &[0.5], &[-1.0, 2.0]],
        b: &[1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0],
        b_hat: &[],
    },
    Textbook {
        name: "heun3",
        a: &[&[], &[THIRD], &[0.0, 2.0 * THIRD]],
        b: &[0.25, 0.0, 0.75],
        b_hat: &[],
    },
    Textbook {
        name: "ralston3",
        a: &[&[], &[0.5], &[0.0, 0.75]],
        b: &[2.0 / 9.0, THIRD, 4.0 / 9.0],
        b_hat: &[],
    },
    Textbook {
        name: "ssprk3",
        a: &[&[], &[1.0], &[0.25, 0.25]],
        b: &[1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
        b_hat: &[],
    },
    Textbook {
        name: "bogacki_shampine3",
        a: &[&[], &[0.5], &[0.0, 0.75], &[2.0 / 9.0, THIRD, 4.0 / 9.0]],
        b: &[2.0 / 9.0, THIRD, 4.0 / 9.0, 0.0],
        b_hat: &[7.0 / 24.0, 0.25, THIRD, 0.125],
    },
    Textbook {
        name: "three_eighths",
        a: &[&[], &[THIRD], &[-THIRD, 1.0], &[1.0, -1.0, 1.0]],
        b: &[0.125, 0.375, 0.375, 0.125],
        b_hat: &[],
    },
    Textbook {
        name: "fehlberg4",
        a: &[
            &[],
            &[0.25],
            &[3.0 / 32.0, 9.0 / 32.0],
            &[1932.0 / 2197.0, -7200.0 / 2197.0, 7296.0 / 2197.0],
            &[439.0 / 216.0, -8.0, 3680.0 / 513.0, -845.0 / 4104.0],
            &[
                -8.0 / 27.0,
                2.0,
                -3544.0 / 2565.0,
                1859.0 / 4104.0,
                -11.0 / 40.0,
            ],
        ],
        b: &[
            25.0 / 216.0,
            0.0,
            1408.0 / 2565.0,
            2197.0 / 4104.0,
            -0.2,
            0.0,
        ],
        b_hat: &[
            16.0 / 135.0,
            0.0,
            6656.0 / 12825.0,
            28561.0 / 56430.0,
            -9.0 / 50.0,
            2.0 / 55.0,
        ],
    },
    Textbook {
        name: "cash_karp5",
        a: &[
            &[],
            &[0.2],
            &[3.0 / 40.0, 9.0 / 40.0],
            &[0.3, -0.9, 1.2],
            &[-11.0 / 54.0, 2.5, -70.0 / 27.0, 35.0 / 27.0],
            &[
                1631.0 / 55296.0,
                175.0 / 512.0,
                575.0 / 13824.0,
                44275.0 / 110_592.0,
                253.0 / 4096.0,
            ],
        ],
        b: &[
            37.0 / 378.0,
            0.0,
            250.0 / 621.0,
            125.0 / 594.0,
            0.0,
            512.0 / 1771.0,
        ],
        b_hat: &[
            2825.0 / 27648.0,
            0.0,
            18575.0 / 48384.0,
            13525.0 / 55296.0,
            277.0 / 14336.0,
            0.25,
        ],
    },
    Textbook {
        name: "dormand_prince5",
        a: &[
            &[],
            &[0.2],
            &[3.0 / 40.0, 9.0 / 40.0],
            &[44.0 / 45.0, -56.0 / 15.0, 32.0 / 9.0],
            &[
                19372.0 / 6561.0,
                -25360.0 / 2187.0,
                64448.0 / 6561.0,
                -212.0 / 729.0,
            ],
            &[
                9017.0 / 3168.0,
                -355.0 / 33.0,
                46732.0 / 5247.0,
                49.0 / 176.0,
                -5103.0 / 18656.0,
            ],
            &[
                35.0 / 384.0,
                0.0,
                500.0 / 1113.0,
                125.0 / 192.0,
                -2187.0 / 6784.0,
                11.0 / 84.0,
            ],
        ],
        b: &[
            35.0 / 384.0,
            0.0,
            500.0 / 1113.0,
            125.0 / 192.0,
            -2187.0 / 6784.0,
            11.0 / 84.0,
            0.0,
        ],
        b_hat: &[
            5179.0 / 57600.0,
            0.0,
            7571.0 / 16695.0,
            393.0 / 640.0,
            -92097.0 / 339_200.0,
            187.0 / 2100.0,
            0.025,
        ],
    },
    Textbook {
        name: "butcher6",
        a: &[
            &[],
            &[THIRD],
            &[0.0, 2.0 * THIRD],
            &[1.0 / 12.0, THIRD, -1.0 / 12.0],
            &[-1.0 / 16.0, 1.125, -3.0 / 16.0, -0.375],
            &[0.0, 1.125, -0.375, -0.75, 0.5],
            &[
                9.0 / 44.0,
                -9.0 / 11.0,
                63.0 / 44.0,
                18.0 / 11.0,
                0.0,
                -16.0 / 11.0,
            ],
        ],
        b: &[
            11.0 / 120.0,
            0.0,
            27.0 / 40.0,
            27.0 / 40.0,
            -4.0 / 15.0,
            -4.0 / 15.0,
            11.0 / 120.0,
        ],
        b_hat: &[],
    },
];

/// A method of the [`NAMES`].
pub fn named(name: &str) -> Option<Given> {
    if name == "semi_implicit" {
        return Some(Given::new(Pair::semi_implicit()));
    }
    let Some(found) = TEXTBOOKS.iter().find(|it| it.name == name) else {
        return Some(Given::new(Pair::of(name.parse().ok()?)));
    };
    let rows: Vec<Vec<f64>> = found.a.iter().map(|row| row.to_vec()).collect();
    let given = Given::new(Pair::same(Tableau::new(&rows, found.b).ok()?));
    if found.b_hat.is_empty() {
        return Some(given);
    }
    given.with_embedded(found.b_hat).ok()
}
