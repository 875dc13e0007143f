//! The allowed cost of one execution: processor time and memory, by the bytes of its input.
//!
//! Wall time is checked first. If it is too long, the execution is repeated, and its thread's own time counts. This
//! time also increases if other programs use the caches and the core. So the least of a few measurements counts: a
//! busy machine causes no failure, and an expensive input always fails.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// The cost that an execution may have.
#[derive(Debug, Clone, Copy)]
pub struct Allowance {
    /// Processor time for an input of any length.
    pub time: Duration,
    /// For each of its bytes.
    pub time_per_byte: Duration,
    /// Bytes of memory at once for any input.
    pub memory: usize,
    /// For each of its bytes.
    pub memory_per_byte: usize,
}

/// For targets that read bytes: linear in their number. With the fuzzer's counting and the second reading it is about a
/// microsecond per byte. The second reading converts numbers by the standard library, which takes up to ten
/// microseconds per byte for difficult numbers.
pub const READING: Allowance = Allowance {
    time: Duration::from_millis(10),
    time_per_byte: Duration::from_micros(10),
    memory: 1 << 20,
    memory_per_byte: 1 << 10,
};
/// For targets that compute or play clients: the most that a script or a plan of a few hundred bytes can request.
pub const DOING: Allowance = Allowance {
    time: Duration::from_secs(5),
    time_per_byte: Duration::ZERO,
    memory: 256 << 20,
    memory_per_byte: 0,
};

/// Most repetitions of an execution that took too long.
const REPETITIONS: usize = 5;

/// Runs an execution on an input of this length, within its allowed cost.
pub fn hold(bytes: usize, allowance: Allowance, execution: impl Fn()) {
    let factor = u32::try_from(bytes).unwrap_or(u32::MAX);
    let time = allowance.time + allowance.time_per_byte * factor;
    let memory = allowance.memory + allowance.memory_per_byte * bytes;
    let before = NOW.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let began = Instant::now();
    execution();
    let peak = PEAK.load(Ordering::Relaxed).saturating_sub(before);
    assert!(
        peak <= memory,
        "{peak} bytes of memory for {bytes} of input"
    );
    if began.elapsed() <= time {
        return;
    }
    let mut least = Duration::MAX;
    for _ in 0..REPETITIONS {
        let began = processor_time();
        execution();
        least = least.min(processor_time().saturating_sub(began));
        if least <= time {
            return;
        }
    }
    panic!("{least:?} for {bytes} bytes of input");
}

/// The processor time of this thread.
fn processor_time() -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split(' ').next().and_then(|first| first.parse().ok());
    Duration::from_nanos(nanoseconds.unwrap_or_default())
}

/// The allocated bytes, and their maximum since the last query.
static NOW: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn count(more: usize) {
    let now = NOW.fetch_add(more, Ordering::Relaxed) + more;
    PEAK.fetch_max(now, Ordering::Relaxed);
}

// SAFETY: every call is forwarded to the system's allocator unchanged; counting does not allocate.
#[allow(unsafe_code, reason = "an allocator can't be written without")]
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size());
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size);
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        NOW.fetch_sub(layout.size(), Ordering::Relaxed);
        unsafe { System.dealloc(pointer, layout) }
    }
}
