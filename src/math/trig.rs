//! Sine and cosine of all joint angles of an arm at once.
//!
//! **Invariant:** the same angle gives the same bits, whatever stands beside it.

#![allow(
    clippy::indexing_slicing,
    reason = "indices run over the elements of arrays of one length"
)]

const LIMIT: f64 = 1.6e6;
const ROUND: f64 = 6_755_399_441_055_744.0;
const TWO_OVER_PI: f64 = 0.6366197723675814;
const HALF_PI: [f64; 3] = [
    1.5707963267341256,
    6.077100506303966e-11,
    2.0222662487959506e-21,
];
const S: [f64; 6] = [
    -0.1666666666666663,
    0.008333333333322118,
    -0.0001984126982958954,
    2.7557313621385676e-06,
    -2.505074776285035e-08,
    1.5896230157221552e-10,
];
const C: [f64; 6] = [
    0.041666666666666595,
    -0.0013888888888873056,
    2.4801587288851704e-05,
    -2.755731417929674e-07,
    2.0875700841974726e-09,
    -1.1358536521387477e-11,
];

/// Sines and cosines of `angles` \[rad\]: `(sin, cos)`.
#[must_use]
#[inline(always)]
pub fn sin_cos<const N: usize>(angles: &[f64; N]) -> ([f64; N], [f64; N]) {
    let t: [f64; N] = angles.map(|a| a * TWO_OVER_PI + ROUND);
    let k: [f64; N] = t.map(|t| t - ROUND);
    let r1: [f64; N] = std::array::from_fn(|i| angles[i] - k[i] * HALF_PI[0]);
    let kp: [f64; N] = k.map(|k| k * HALF_PI[1]);
    let r: [f64; N] = std::array::from_fn(|i| r1[i] - kp[i]);
    let tail: [f64; N] = std::array::from_fn(|i| ((r1[i] - r[i]) - kp[i]) - k[i] * HALF_PI[2]);
    let z: [f64; N] = r.map(|r| r * r);
    let z2: [f64; N] = z.map(|r| r * r);
    let z4: [f64; N] = z2.map(|r| r * r);
    let poly = |p: &[f64; 6]| -> [f64; N] {
        std::array::from_fn(|i| {
            (p[0] + p[1] * z[i]) + z2[i] * (p[2] + p[3] * z[i]) + z4[i] * (p[4] + p[5] * z[i])
        })
    };
    let ps = poly(&S);
    let pc = poly(&C);
    let sr: [f64; N] = std::array::from_fn(|i| r[i] + (tail[i] + r[i] * z[i] * ps[i]));
    let cr: [f64; N] = std::array::from_fn(|i| {
        let hz = 0.5 * z[i];
        let w = 1.0 - hz;
        w + (((1.0 - w) - hz) + (z2[i] * pc[i] - r[i] * tail[i]))
    });
    let mut sin = [0.0; N];
    let mut cos = [0.0; N];
    for i in 0..N {
        let n = t[i].to_bits();
        let odd = 0_u64.wrapping_sub(n & 1);
        let (sb, cb) = (sr[i].to_bits(), cr[i].to_bits());
        let flip = (sb ^ cb) & odd;
        sin[i] = f64::from_bits((sb ^ flip) ^ ((n & 2) << 62));
        cos[i] = f64::from_bits((cb ^ flip) ^ ((n.wrapping_add(1) & 2) << 62));
    }
    if !angles.iter().all(|a| a.abs() <= LIMIT) {
        beyond(angles, &mut sin, &mut cos);
    }
    (sin, cos)
}

#[cold]
#[inline(never)]
fn beyond<const N: usize>(angles: &[f64; N], sin: &mut [f64; N], cos: &mut [f64; N]) {
    for i in 0..N {
        if !(angles[i].abs() <= LIMIT) {
            (sin[i], cos[i]) = angles[i].sin_cos();
        }
    }
}
