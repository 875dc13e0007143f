//! Unit tests of the workers' turns.
//!
//! **Invariant:** the tests check the order of the pool, never the speed of a thread.

use std::sync::mpsc;

use super::*;
use crate::actors::ConnectionId;

struct Counting {
    name: &'static str,
    slices: usize,
    log: mpsc::Sender<String>,
}

impl Computation for Counting {
    fn advance(&mut self, _deadline: Instant) -> Progress {
        assert!(self.name != "panics", "asked to");
        self.log.send(self.name.to_owned()).unwrap();
        self.slices -= 1;
        if self.slices == 0 {
            Progress::Finished
        } else {
            Progress::Unfinished
        }
    }

    fn is_abandoned(&self) -> bool {
        self.name == "gone"
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
    fn advance(&mut self, _deadline: Instant) -> Progress {
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
    fn advance(&mut self, _deadline: Instant) -> Progress {
        match self.0.try_recv() {
            Err(mpsc::TryRecvError::Empty) => Progress::Unfinished,
            _ => Progress::Finished,
        }
    }

    fn refuse(&mut self, _why: &'static str) {}
}

#[test]
fn a_task_waiting_for_memory_retries_while_others_compute() {
    let pool = WorkerPool::start(1).unwrap();
    let (done, endless) = mpsc::channel();
    let (began, seen) = mpsc::channel();
    pool.submit(ConnectionId(1), Box::new(Endless(endless)));
    pool.submit(ConnectionId(2), Box::new(InitiallyFull { tries: 3, began }));
    seen.recv_timeout(Duration::from_secs(60))
        .expect("room is looked for again");
    drop(done);
    while !pool.is_idle() {
        thread::yield_now();
    }
}

#[test]
fn one_too_many_is_refused_and_there_is_always_room_for_the_runtimes_own() {
    let (log, seen) = mpsc::channel();
    let pool = WorkerPool::start(1).unwrap();
    for client in 1..=MAX_ADMITTED as u64 {
        let endless = computation("endless", usize::MAX, &log);
        pool.submit(ConnectionId(client), endless);
    }
    let late = ConnectionId(MAX_ADMITTED as u64 + 1);
    pool.submit(late, computation("late", 1, &log));
    pool.submit(RUNTIME, computation("own", 1, &log));
    let mut refused = seen.iter().filter(|line| line != "endless");
    assert_eq!(refused.next(), Some(format!("late: {BUSY}")));
    assert_eq!(refused.next().as_deref(), Some("own"));
    pool.close("the test is over");
}

/// Abandoned ones are removed, so clients that disconnect do not block others.
#[test]
fn a_client_is_admitted_when_all_others_are_abandoned() {
    let (log, seen) = mpsc::channel();
    let pool = WorkerPool::without_threads();
    for client in 1..=MAX_ADMITTED as u64 {
        let gone = computation("gone", usize::MAX, &log);
        pool.submit(ConnectionId(client), gone);
    }
    pool.submit(
        ConnectionId(MAX_ADMITTED as u64 + 1),
        computation("newcomer", 1, &log),
    );
    assert!(pool.turn());
    assert_eq!(seen.try_recv().as_deref(), Ok("newcomer"));
    assert!(pool.is_idle(), "the others have been dropped");
    assert!(seen.try_recv().is_err());
}

#[test]
fn a_panic_leaves_the_worker_working() {
    let (log, seen) = mpsc::channel();
    let pool = WorkerPool::start(1).unwrap();
    pool.submit(ConnectionId(1), computation("panics", 1, &log));
    pool.submit(ConnectionId(2), computation("next", 1, &log));
    assert_eq!(seen.recv().unwrap(), "next");
}
