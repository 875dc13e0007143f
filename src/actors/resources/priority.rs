//! Priorities of threads, if there are more threads than cores: the arm and the gateway before work for one client.
//!
//! **Invariant:** a thread lowers its priority once, when it starts.

/// The niceness of such a thread. Beside one thread of normal priority it still gets a quarter of a core, so other
/// programs cannot starve it.
#[cfg(target_os = "linux")]
const STEP_BACK: i32 = 5;

/// Lowers the priority of the present thread below the program's others. It works only on Linux, because
/// elsewhere it would change the whole process.
pub fn lower_priority() {
    // If this is forbidden, all threads have the same priority.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::nice(STEP_BACK);
}
