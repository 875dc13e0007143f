//! Random numbers that are the same in every run.
//!
//! **Invariant:** no figure depends on the day.

/// Numbers between minus and plus half of a range, the same in every run (xorshift).
pub fn spread() -> impl FnMut(f64) -> f64 {
    let mut bits = 0x9E37_79B9_7F4A_7C15_u64;
    move |range| {
        bits ^= bits << 13;
        bits ^= bits >> 7;
        bits ^= bits << 17;
        (bits as f64 / u64::MAX as f64 - 0.5) * range
    }
}
