//! Numbers as a fuzzer should try them: the bits that it chose, or values at which things change.

use arbitrary::{Arbitrary, Result, Unstructured};

/// A finite number: any bits, a plain size, or an edge.
#[derive(Debug, Clone, Copy)]
pub struct Finite(pub f64);

const EDGES: [f64; 24] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    2.0,
    1e-3,
    9.81,
    std::f64::consts::PI,
    -std::f64::consts::PI,
    std::f64::consts::FRAC_PI_2,
    std::f64::consts::TAU,
    1e-9,
    1e9,
    1e-100,
    1e100,
    1e-300,
    1e300,
    f64::MIN_POSITIVE,
    5e-324,
    f64::MAX,
    f64::MIN,
    f64::EPSILON,
    9_007_199_254_740_993.0,
];

impl<'a> Arbitrary<'a> for Finite {
    fn arbitrary(input: &mut Unstructured<'a>) -> Result<Self> {
        let kind: u8 = input.arbitrary()?;
        let value = match kind {
            0..128 => {
                // Within some hundred, in steps of 1/64 that nothing rounds.
                f64::from(input.arbitrary::<i16>()?) / 64.0
            }
            128..192 => EDGES[usize::from(kind) % EDGES.len()],
            192..224 => {
                // An edge's neighbours.
                let edge = EDGES[usize::from(kind) % EDGES.len()];
                f64::from_bits(
                    edge.to_bits()
                        .wrapping_add_signed(input.arbitrary::<i8>()?.into()),
                )
            }
            _ => f64::from_bits(input.arbitrary()?),
        };
        Ok(Self(if value.is_finite() { value } else { 1.0 }))
    }

    fn size_hint(_: usize) -> (usize, Option<usize>) {
        (1, Some(9))
    }
}

/// A finite number greater than 0.
#[derive(Debug, Clone, Copy)]
pub struct Positive(pub f64);

impl<'a> Arbitrary<'a> for Positive {
    fn arbitrary(input: &mut Unstructured<'a>) -> Result<Self> {
        let Finite(value) = input.arbitrary()?;
        let value = value.abs();
        Ok(Self(if value > 0.0 { value } else { 1.0 }))
    }

    fn size_hint(depth: usize) -> (usize, Option<usize>) {
        Finite::size_hint(depth)
    }
}

/// The plain values.
#[must_use]
pub fn finite<const N: usize>(numbers: [Finite; N]) -> [f64; N] {
    numbers.map(|Finite(value)| value)
}

/// The plain values.
#[must_use]
pub fn positive<const N: usize>(numbers: [Positive; N]) -> [f64; N] {
    numbers.map(|Positive(value)| value)
}
