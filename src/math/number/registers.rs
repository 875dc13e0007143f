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

    #[test]
    fn each_width_is_there_once_and_the_widest_first() {
        let lanes: Vec<_> = Registers::all().into_iter().map(Registers::lanes).collect();
        assert_eq!(lanes.first(), Some(&Registers::widest().lanes()));
        assert!(lanes.is_sorted_by(|one, next| one > next), "{lanes:?}");
        #[cfg(target_arch = "x86_64")]
        assert_eq!(lanes.last(), Some(&2));
    }
}
