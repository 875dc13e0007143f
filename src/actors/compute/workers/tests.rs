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

/// Finds no room a few times.
struct InitiallyFull {
    tries: usize,
    began: mpsc::Sender<()>,
}

impl Computation for InitiallyFull {
    fn advance(&mut self, _: Duration) -> Progress {
        if self.tries > 0 {
            self.tries -= 1;
            return Progress::Waiting;
        }
        let _ = self.began.send(());
        Progress::Finished
    }

    fn refuse(&mut self, _why: &'static str) {}
}

/// Continues until the others are done.
struct Endless(mpsc::Receiver<()>);

impl Computation for Endless {
    fn advance(&mut self, _: Duration) -> Progress {
        match self.0.try_recv() {
            Err(mpsc::TryRecvError::Empty) => Progress::Unfinished,
            _ => Progress::Finished,
        }
    }

    fn refuse(&mut self, _why: &'static str) {}
}

/// A worker counts its computation as ended after it has dropped it, so the pool may be idle a moment later.
fn wait_until_idle(pool: &WorkerPool) {
    while !pool.is_idle() {
        thread::yield_now();
    }
}

#[test]
fn a_task_waiting_for_memory_retries_while_others_compute() {
    let pool = WorkerPool::start(1).unwrap();
    let (done, endless) = mpsc::channel();
    let (began, seen) = mpsc::channel();
    pool.submit(Box::new(Endless(endless)));
    let full = || {
        Box::new(InitiallyFull {
            tries: 3,
            began: began.clone(),
        })
    };
    pool.submit(full());
    seen.recv_timeout(Duration::from_secs(60))
        .expect("room is looked for again");
    drop(done);
    wait_until_idle(&pool);
    // Alone it tries again after a pause.
    let since = std::time::Instant::now();
    pool.submit(full());
    seen.recv().unwrap();
    assert!(since.elapsed() >= 3 * TRY_AGAIN);
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
