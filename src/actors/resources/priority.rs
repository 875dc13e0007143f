//! Priorities of threads, if there are more threads than cores: the arm and the gateway before work for one client. And the
//! name of a thread that actix starts.
//!
//! **Invariant:** a thread lowers its priority once, when it starts.

use std::ffi::CStr;

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

/// Names the present thread for `ps -L` and debuggers, on Linux.
pub fn name_thread(name: &CStr) {
    // Without a name the thread works as well.
    #[cfg(target_os = "linux")]
    let _ = rustix::thread::set_name(name);
    #[cfg(not(target_os = "linux"))]
    let _ = name;
}
