//! Unit tests of the workers' turns.
//!
//! **Invariant:** the tests check the order of the pool, never the speed of a thread.

use std::sync::mpsc;

use super::*;

struct Counting {
    name: &'static str,
    slices: usize,
    log: mpsc::Sender<String>,
}

impl Computation for Counting {
    fn advance(&mut self, _: Duration) -> Progress {
        assert!(self.name != "panics", "asked to");
        self.log.send(self.name.to_owned()).unwrap();
        self.slices -= 1;
        if self.slices == 0 {
            Progress::Finished
        } else {
            Progress::Unfinished
        }
    }

    fn refuse(&mut self, why: &'static str) {
        self.log.send(format!("{}: {why}", self.name)).unwrap();
    }
}

fn computation(
    name: &'static str,
    slices: usize,
    log: &mpsc::Sender<String>,
) -> Box<dyn Computation> {
    Box::new(Counting {
        name,
        slices,
        log: log.clone(),
    })
}

/// A worker counts its computation as ended after it has dropped it, so the pool may be idle a moment later.
fn wait_until_idle(pool: &WorkerPool) {
    while !pool.is_idle() {
        thread::yield_now();
    }
}

#[test]
fn a_panic_leaves_the_worker_working() {
    let (log, seen) = mpsc::channel();
    let pool = WorkerPool::start(1).unwrap();
    pool.submit(computation("panics", 1, &log));
    pool.submit(computation("next", 1, &log));
    assert_eq!(seen.recv().unwrap(), "next");
}

#[test]
fn the_end_of_the_pool_refuses_running_waiting_and_new_computations() {
    let (log, seen) = mpsc::channel();
    let pool = WorkerPool::start(1).unwrap();
    pool.submit(computation("runs", usize::MAX, &log));
    assert_eq!(seen.recv().unwrap(), "runs");
    pool.submit(computation("waits", usize::MAX, &log));
    pool.close("over");
    pool.submit(computation("comes", 1, &log));
    drop(log);
    let mut refused: Vec<String> = seen.iter().filter(|one| one.ends_with("over")).collect();
    refused.sort_unstable();
    assert_eq!(refused, ["comes: over", "runs: over", "waits: over"]);
    wait_until_idle(&pool);
}
