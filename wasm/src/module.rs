//! The WebAssembly module: a page writes a frame into memory, and reads frames there.
//!
//! **Invariant:** there is one kernel, and one calling thread.
#![allow(
    unsafe_code,
    reason = "an export must keep its name; the functions themselves are safe"
)]

use std::cell::RefCell;
use std::time::Duration;

use pendularm::score::replay;

use crate::kernel::{Kernel, LINKS};
use crate::runs;

#[link(wasm_import_module = "env")]
unsafe extern "C" {
    /// The page's clock \[ms\].
    safe fn milliseconds() -> f64;
}

/// The kernel of an arm with 2 or 3 links.
enum AnyKernel {
    Two(Kernel<2>),
    Three(Kernel<3>),
}

thread_local! {
    static KERNEL: RefCell<Option<AnyKernel>> = const { RefCell::new(None) };
    static INPUT: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
    static OUTPUT: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Calls the kernel, if there is one.
macro_rules! with_kernel {
    ($kernel:ident => $work:expr) => {
        KERNEL.with_borrow_mut(|kernel| match kernel {
            Some(AnyKernel::Two($kernel)) => $work,
            Some(AnyKernel::Three($kernel)) => $work,
            None => Default::default(),
        })
    };
}

fn clock() -> Duration {
    Duration::try_from_secs_f64(milliseconds() / 1000.0).unwrap_or_default()
}

/// Stores bytes for the page, and returns their length.
fn give(bytes: Vec<u8>) -> usize {
    let length = bytes.len();
    OUTPUT.set(bytes);
    length
}

/// Restarts with an arm of `links` links.
#[unsafe(no_mangle)]
pub extern "C" fn start(links: usize, seed: f64) {
    let seed = seed.to_bits();
    KERNEL.set(Some(if links == LINKS[1] {
        AnyKernel::Three(Kernel::new(clock, seed))
    } else {
        AnyKernel::Two(Kernel::new(clock, seed))
    }));
}

/// Allocates a buffer for a frame of `length` bytes, and returns its address.
#[unsafe(no_mangle)]
pub extern "C" fn input(length: usize) -> *mut u8 {
    INPUT.with_borrow_mut(|input| {
        input.clear();
        input.resize(length, 0);
        input.as_mut_ptr()
    })
}

/// Takes the frame in that buffer.
#[unsafe(no_mangle)]
pub extern "C" fn receive() {
    let frame = INPUT.take();
    if let Ok(frame) = std::str::from_utf8(&frame) {
        with_kernel!(kernel => kernel.receive(frame));
    }
}

/// Publishes due messages.
#[unsafe(no_mangle)]
pub extern "C" fn tick() {
    with_kernel!(kernel => kernel.tick());
}

/// Computes for at most this time \[ms\]. Returns whether a computation still waits.
#[unsafe(no_mangle)]
pub extern "C" fn compute(budget: u32) -> bool {
    let budget = Duration::from_millis(budget.into());
    with_kernel!(kernel => kernel.compute(budget))
}

/// Collects the frames for the page. Returns their number of bytes.
#[unsafe(no_mangle)]
pub extern "C" fn collect() -> usize {
    give(with_kernel!(kernel => kernel.take_frames()))
}

/// Recomputes the submission in that buffer. Returns the number of bytes of a JSON array: the words, then the poses and the
/// target of a submission that agrees.
#[unsafe(no_mangle)]
pub extern "C" fn score() -> usize {
    let found = replay(&INPUT.take());
    let told = found.map_or_else(
        |why| serde_json::to_vec(&(why,)),
        |replay| serde_json::to_vec(&(replay.words, replay.poses, replay.target)),
    );
    give(told.unwrap_or_default())
}

/// Makes the runs that are compared with the native ones. Returns the number of bytes of their text.
#[unsafe(no_mangle)]
pub extern "C" fn compare() -> usize {
    give(runs::text().into_bytes())
}

/// The address of the last collected bytes.
#[unsafe(no_mangle)]
pub extern "C" fn output() -> *const u8 {
    OUTPUT.with_borrow(|output| output.as_ptr())
}
