//! The order in which threads run where they are more than cores: the arm and the gateway, which serve all, before
//! work for one client.
//!
//! **Invariant:** a thread steps back once, when it starts, and stays there.

/// How far a thread steps back, on the system's scale of niceness. Beside one that does not it still has a quarter of a
/// core: other programs, which have priority too, can't starve it.
#[cfg(target_os = "linux")]
const STEP_BACK: i32 = 5;

/// Lowers the priority of the present thread below the program's others. Only on Linux: elsewhere it would change
/// that of the whole process.
pub fn give_way() {
    // Where that is forbidden all threads are equals.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::nice(STEP_BACK);
}
