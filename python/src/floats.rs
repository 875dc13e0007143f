//! The floating-point environment of the results: rounding to nearest, and subnormal numbers kept.
//!
//! A program may have set another one for its threads, for example by `torch.set_flush_denormal(True)`, and threads
//! inherit it.
//!
//! **Invariant:** the caller's environment is back when [`Promised`] ends.

use std::marker::PhantomData;

use pyo3::prelude::{pyclass, pymethods};

use crate::fields::Object;

/// The thread's control word, which has rounding and the treatment of subnormal numbers.
#[cfg(target_arch = "x86_64")]
type Word = u32;
#[cfg(not(target_arch = "x86_64"))]
type Word = u64;

/// The promised control word. On x86-64 all exceptions are masked.
#[cfg(target_arch = "x86_64")]
const PROMISED: Word = 0x1f80;
#[cfg(not(target_arch = "x86_64"))]
const PROMISED: Word = 0;

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, reason = "no safe function reads this register")]
fn word() -> Word {
    let mut word: Word = 0;
    // SAFETY: stores the register in this variable.
    unsafe {
        std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut word, options(nostack, preserves_flags))
    };
    word
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code, reason = "no safe function writes this register")]
fn set(word: Word) {
    // SAFETY: only valid words are written: the promised one, or one that was read. Results of Rust's operations
    // are specified for the promised word, and no operation lies between this and the caller's code.
    unsafe {
        std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const word, options(nostack, preserves_flags))
    };
}

#[cfg(target_arch = "aarch64")]
#[allow(unsafe_code, reason = "no safe function reads this register")]
fn word() -> Word {
    let word: Word;
    // SAFETY: reads a register.
    unsafe { std::arch::asm!("mrs {}, fpcr", out(reg) word, options(nostack, preserves_flags)) };
    word
}

#[cfg(target_arch = "aarch64")]
#[allow(unsafe_code, reason = "no safe function writes this register")]
fn set(word: Word) {
    // SAFETY: as on x86-64.
    unsafe { std::arch::asm!("msr fpcr, {}", in(reg) word, options(nostack, preserves_flags)) };
}

/// Other processors are left as they are.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn word() -> Word {
    PROMISED
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn set(_word: Word) {}

/// The promised environment in this thread, until this is dropped.
#[derive(Debug)]
pub(crate) struct Promised {
    callers: Word,
    /// It stays in its thread.
    thread: PhantomData<*const ()>,
}

impl Promised {
    pub(crate) fn begin() -> Self {
        let callers = word();
        if callers != PROMISED {
            set(PROMISED);
        }
        Self {
            callers,
            thread: PhantomData,
        }
    }
}

impl Drop for Promised {
    fn drop(&mut self) {
        set(self.callers);
    }
}

/// A context manager with the promised environment, for the package's own computations.
#[pyclass(frozen, module = "pendularm._native")]
#[derive(Debug)]
pub(crate) struct PromisedFloats {
    callers: Word,
}

#[pymethods]
impl PromisedFloats {
    #[new]
    fn new() -> Self {
        Self { callers: word() }
    }

    fn __enter__(&self) {
        set(PROMISED);
    }

    fn __exit__(&self, _kind: &Object<'_>, _error: &Object<'_>, _trace: &Object<'_>) {
        set(self.callers);
    }
}
