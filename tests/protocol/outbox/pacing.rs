//! Clients that pause get everything, and clients that are slow get the present: a simulation of the outbox, its flow
//! control, a socket and a reader.
//!
//! **Invariant:** the clock is a number. The naps are from seeded random numbers.

use std::cell::Cell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use pendularm::protocol::outbox::Outbox;
use pendularm::protocol::outbox::flow::FlowControl;

/// Bytes that the buffers of a connection on one machine hold.
const SOCKET: usize = 285 * 1024;
/// Milliseconds after which written bytes are acknowledged. The system counts other bytes twice, unless all are read.
const ACKNOWLEDGED: u64 = 40;
/// Bytes of a message, as of `/joint_states`.
const MESSAGE: usize = 270;
/// Most frames and bytes of one write.
const WRITE: (usize, usize) = (64, 64 * 1024);
/// Largest age of a message when it is read, in milliseconds, for a client that is known to be slow.
const ABOUT_A_SECOND: u64 = 1300;

/// How a client reads.
#[derive(Clone, Copy)]
struct Reader {
    /// Most bytes of one read.
    read: usize,
    /// Milliseconds that it needs for a message; 0 for a client that only reads.
    work: f64,
}

/// A client that reads in a loop, without work.
const FAST: Reader = reader(65536, 0.0);

const fn reader(read: usize, work: f64) -> Reader {
    Reader { read, work }
}

/// A publisher of 60 messages a second, or another rate, and a client.
struct Link {
    outbox: Outbox,
    flow: FlowControl,
    topic: Arc<str>,
    began: Instant,
    /// Present time in milliseconds.
    now: u64,
    a_second: u64,
    published: u64,
    /// The number of the message after the last one.
    last: u64,
    unread: Rc<Cell<usize>>,
    socket: VecDeque<u8>,
    /// The writes that are not acknowledged: their times and bytes.
    sent: VecDeque<(u64, usize)>,
    /// Bytes that the client has read, and not yet looked at.
    bytes: VecDeque<u8>,
    /// When the client has done its work.
    busy_until: f64,
    /// The numbers of the messages that it has got.
    got: Vec<u64>,
    /// The time of its last read, before it has looked at the first message of it.
    read_at: Option<u64>,
    /// Age of the first message of its last read at that time, in milliseconds.
    late: u64,
}

impl Link {
    fn new(a_second: u64) -> Self {
        let (began, unread) = (Instant::now(), Rc::new(Cell::new(0)));
        let count = Rc::clone(&unread);
        Self {
            outbox: Outbox::default(),
            flow: FlowControl::new(Box::new(move || Some(count.get())), began),
            topic: "/t".into(),
            began,
            now: 0,
            a_second,
            published: 0,
            last: u64::MAX,
            unread,
            socket: VecDeque::new(),
            sent: VecDeque::new(),
            bytes: VecDeque::new(),
            busy_until: 0.0,
            got: Vec::new(),
            read_at: None,
            late: 0,
        }
    }

    fn clock(&self) -> Instant {
        self.began + Duration::from_millis(self.now)
    }

    fn produced_at(&self, number: u64) -> u64 {
        number * 1000 / self.a_second
    }

    fn publish(&mut self) {
        let frame = format!("{:0width$}\n", self.published, width = MESSAGE - 1);
        self.published += 1;
        self.outbox.push(&self.topic, frame.into(), self.clock());
    }

    /// Counts the unread bytes as the system does.
    fn count_unread(&mut self) {
        while self
            .sent
            .front()
            .is_some_and(|(at, _)| at + ACKNOWLEDGED <= self.now)
        {
            self.sent.pop_front();
        }
        let twice: usize = self.sent.iter().map(|(_, bytes)| bytes).sum();
        let is_empty = self.socket.is_empty();
        self.unread
            .set(self.socket.len() + if is_empty { 0 } else { twice });
    }

    /// Offers the outbox to the socket, as the writer of a connection does.
    fn write(&mut self) {
        let now = self.clock();
        self.count_unread();
        while self.outbox.is_writing() || !self.outbox.is_empty() {
            if !self.outbox.is_writing() {
                let room = self.flow.room(now);
                self.outbox.allow(room, self.flow.max_age());
                self.outbox.take_frames(now, WRITE.0, WRITE.1);
            }
            let offered: Vec<u8> = self.outbox.writing().flatten().copied().collect();
            let written = offered.len().min(SOCKET - self.socket.len());
            if written == 0 {
                return;
            }
            self.socket.extend(&offered[..written]);
            self.sent.push_back((self.now, written));
            self.count_unread();
            self.flow.note_written(written, now);
            self.outbox.note_written(written);
        }
    }

    /// One read. Returns `false` if nothing was there.
    fn read(&mut self, most: usize) -> bool {
        let read = most.min(self.socket.len());
        self.bytes.extend(self.socket.drain(..read));
        self.read_at = Some(self.now);
        self.write();
        read > 0
    }

    /// Takes a message out of the bytes that were read.
    fn next(&mut self) -> bool {
        if self.bytes.len() < MESSAGE {
            return false;
        }
        let line: Vec<u8> = self.bytes.drain(..MESSAGE).collect();
        let number = std::str::from_utf8(&line).unwrap().trim().parse().unwrap();
        assert!(
            self.got.last().is_none_or(|before| *before < number),
            "in order"
        );
        self.got.push(number);
        if let Some(at) = self.read_at.take() {
            self.late = at - self.produced_at(number);
        }
        true
    }

    /// A millisecond passes. A client that is not `awake` reads nothing. Returns whether it has found nothing more.
    fn pass(&mut self, awake: Option<Reader>) -> bool {
        self.now += 1;
        while self.published < self.last && self.produced_at(self.published) <= self.now {
            self.publish();
        }
        if self
            .flow
            .next_query()
            .is_none_or(|next| next <= self.clock())
        {
            self.write();
        }
        let Some(reader) = awake else {
            return false;
        };
        self.busy_until = self.busy_until.max((self.now - 1) as f64);
        while self.busy_until < self.now as f64 {
            while !self.next() {
                if !self.read(reader.read) {
                    return true;
                }
            }
            self.busy_until += reader.work;
        }
        false
    }

    fn sleep(&mut self, ms: u64) {
        (0..ms).for_each(|_| {
            self.pass(None);
        });
    }

    fn drain(&mut self, reader: Reader) {
        while !self.pass(Some(reader)) {}
    }

    /// All messages so far have arrived, and the newest is one that was published just now.
    fn check_all(&self, case: &str) {
        let all: Vec<u64> = (0..self.published).collect();
        assert!(
            self.got == all,
            "{case}: {} of {}",
            self.got.len(),
            all.len()
        );
        assert_eq!(self.outbox.dropped(), 0, "{case}");
    }
}

/// Numbers from 0 to 1.
fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut random = fastrand::Rng::with_seed(seed);
    move || random.f64()
}

#[test]
fn a_client_that_pauses_and_then_reads_everything_loses_nothing() {
    // Each reads faster than the topic publishes: at once, one message in a millisecond, and by small reads.
    for reader in [FAST, reader(8192, 1.0), reader(8192, 5.0), reader(270, 0.5)] {
        for nap in [200, 300, 400, 500, 750, 1000, 2000, 4000, 10_000] {
            for a_second in [1, 5, 60, 90] {
                let mut link = Link::new(a_second);
                for _ in 0..(20_000 / nap).max(3) {
                    link.sleep(nap);
                    link.drain(reader);
                    let case =
                        format!("naps of {nap}, {a_second}, {} {}", reader.read, reader.work);
                    link.check_all(&case);
                }
            }
        }
    }
}

#[test]
fn irregular_naps_lose_nothing() {
    for seed in 0..10 {
        for (least, most) in [
            (50.0, 600.0),
            (200.0, 3000.0),
            (500.0, 1500.0),
            (200.0, 10_000.0),
        ] {
            let (mut link, mut random) = (Link::new(60), random(seed));
            while link.now < 60_000 {
                link.sleep((least + (most - least) * random()) as u64);
                // Some drains are slow, and some clients go on reading for a while.
                let work = [0.0, 0.2, 2.0][(random() * 3.0) as usize];
                link.drain(reader(65536, work));
                link.check_all(&format!("{least} to {most}, seed {seed}"));
                let rest = (random() * 2.0) as u64 * 700;
                (0..rest).for_each(|_| {
                    link.pass(Some(FAST));
                });
            }
        }
    }
}

#[test]
fn one_read_between_two_pauses_is_no_sign_of_slowness() {
    for (first, read, then) in [(1000, 4096, 4000), (500, 270, 4000), (2000, 8192, 9000)] {
        let mut link = Link::new(60);
        link.sleep(first);
        link.read(read);
        link.sleep(then);
        link.drain(FAST);
        link.check_all(&format!("{first} {read} {then}"));
    }
}

#[test]
fn a_burst_waits_for_a_client_that_is_busy() {
    let mut link = Link::new(3400);
    link.last = 500;
    link.sleep(150 + 800);
    link.drain(reader(8192, 1.5));
    assert_eq!(link.published, 500);
    link.check_all("a burst");
}

#[test]
fn a_client_that_never_reads_costs_its_buffers_and_a_second_of_messages() {
    let mut link = Link::new(60);
    link.sleep(120_000);
    assert!(link.socket.len() > SOCKET - MESSAGE);
    assert!(
        link.outbox.topic_count() <= 61,
        "{}",
        link.outbox.topic_count()
    );
    // What it finds then is the beginning, and the last second.
    link.drain(FAST);
    assert!(link.got.len() >= SOCKET / MESSAGE + 25);
    assert_eq!(link.got.last(), Some(&(link.published - 1)));
}

#[test]
fn a_client_that_reads_more_slowly_than_its_topic_gets_recent_messages() {
    // The milliseconds until it is known to be slow, and has read all that its socket held.
    for (a_second, read, known) in [
        (10.0, 270, 9000),
        (30.0, 270, 0),
        (45.0, 270, 0),
        (10.0, 8192, 65_000),
        (30.0, 8192, 10_000),
        (45.0, 8192, 7000),
        (10.0, 65536, 200_000),
        (30.0, 65536, 60_000),
        (45.0, 65536, 50_000),
    ] {
        let mut link = Link::new(60);
        let (mut worst, mut last_late, mut got) = (0, 0, 0);
        while link.now < 400_000 {
            link.pass(Some(reader(read, 1000.0 / a_second)));
            if link.late > ABOUT_A_SECOND {
                (worst, last_late) = (link.late.max(worst), link.now);
            }
            got += usize::from(link.now == known) * link.got.len();
        }
        let case = format!("{a_second} a second, reads of {read}: {worst} ms late, at {last_late}");
        println!("{case}");
        assert!(last_late <= known, "{case}");
        let got = (link.got.len() - got) as f64;
        let most = a_second * (400_000 - known) as f64 / 1000.0;
        assert!(
            got > 0.95 * most,
            "it has enough to do: {case}, {got} of {most}"
        );
    }
}

#[test]
fn a_client_that_keeps_up_again_may_pause() {
    for read in [270, 8192] {
        let mut link = Link::new(60);
        while link.now < 30_000 {
            link.pass(Some(reader(read, 1000.0 / 30.0)));
        }
        assert!(link.outbox.dropped() > 0);
        while link.now < 36_000 {
            link.pass(Some(FAST));
        }
        let (dropped, before) = (link.outbox.dropped(), link.got.len());
        link.sleep(4000);
        link.drain(FAST);
        assert_eq!(link.outbox.dropped(), dropped);
        assert!(link.got.len() - before >= 240);
    }
}
