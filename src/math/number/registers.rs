//! The registers that this machine has.
//!
//! **Invariant:** a level is used only if the processor reports it.

use std::sync::OnceLock;

use fearless_simd::{Level, Simd, dispatch};

use super::register::Wide;

/// Registers of one width. Each lane holds one arm or state.
#[derive(Debug, Clone, Copy)]
pub struct Registers(Level);

impl Registers {
    /// The widest registers of the machine.
    #[must_use]
    pub fn widest() -> Self {
        // The processor is queried once.
        static LEVEL: OnceLock<Level> = OnceLock::new();
        Self(*LEVEL.get_or_init(Level::new))
    }

    /// All register widths of the machine, the widest first. Results are the same for all.
    #[must_use]
    pub fn all() -> Vec<Self> {
        let widest = Self::widest();
        #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
        let narrower = [
            widest.0.as_avx2().map(Simd::level),
            widest.0.as_sse4_2().map(Simd::level),
        ];
        #[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
        let narrower: [Option<Level>; 0] = [];
        let mut all = vec![widest];
        for one in narrower.into_iter().flatten().map(Self) {
            if all.iter().all(|other| other.lanes() != one.lanes()) {
                all.push(one);
            }
        }
        all
    }

    /// The number of lanes of one register.
    #[must_use]
    pub fn lanes(self) -> usize {
        dispatch!(self.0, simd => lanes_of(simd))
    }

    /// Their name in the SIMD library.
    pub(in crate::math) fn level(self) -> Level {
        self.0
    }
}

#[inline(always)]
fn lanes_of<S: Simd>(_: S) -> usize {
    Wide::<S, 1>::WIDTH
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::number::Number;

    #[test]
    fn each_width_is_there_once_and_the_widest_first() {
        let lanes: Vec<_> = Registers::all().into_iter().map(Registers::lanes).collect();
        assert_eq!(lanes.first(), Some(&Registers::widest().lanes()));
        assert!(lanes.is_sorted_by(|one, next| one > next), "{lanes:?}");
        #[cfg(target_arch = "x86_64")]
        assert_eq!(lanes.last(), Some(&2));
    }

    /// How `K` registers judge values near a limit of 5, and values that are not finite.
    fn check_judgement<S: Simd, const K: usize>(simd: S) {
        let all = |value| Wide::<S, K>::splat(simd, value);
        assert!(Wide::all_within(&[all(3.0), all(-3.9)], 5.0));
        assert!(Wide::all_finite(&[all(1e308)], &[all(-1e308)]));
        for lane in 0..Wide::<S, K>::LANES {
            for (value, is_finite) in [(-5.1, true), (f64::NAN, false), (f64::INFINITY, false)] {
                let mut one = all(0.0);
                one.set_lane(lane, value);
                for values in [[one, all(0.0)], [all(0.0), one]] {
                    let [first, second] = values;
                    let case = format!("{value} in lane {lane}");
                    assert!(!Wide::all_within(&values, 5.0), "{case}");
                    assert_eq!(Wide::all_finite(&[first], &[second]), is_finite, "{case}");
                }
            }
        }
    }

    #[test]
    fn far_values_and_those_that_are_not_finite_are_found_in_every_lane() {
        for registers in Registers::all() {
            dispatch!(registers.level(), simd => {
                check_judgement::<_, 1>(simd);
                check_judgement::<_, 2>(simd);
            });
        }
        assert!(f64::all_within(&[3.0, -3.9], 5.0));
    }
}
