//! Turns of the fleet, and their reads: each message is compared with the previous ones.
//!
//! **Invariant:** a message that is out of order, comes twice or follows a lost one ends the run.

use std::io::{ErrorKind, Read};
use std::time::Duration;

use mio::{Events, Token};

use super::{Fleet, Traffic};
use crate::message::{now, stamp};
use pendularm_benches::protocol::Event;

impl Fleet {
    /// Waits for events, at most `wait`, and reads everything.
    pub(super) fn turn(&mut self, wait: Duration) {
        let mut events = std::mem::replace(&mut self.events, Events::with_capacity(0));
        match self.poll.poll(&mut events, Some(wait)) {
            Err(error) if error.kind() != ErrorKind::Interrupted => panic!("epoll: {error}"),
            _ => {}
        }
        for event in &events {
            let Token(number) = event.token();
            if event.is_writable() {
                self.links[number].flush();
            }
            if event.is_readable() {
                self.read(number);
            }
        }
        self.events = events;
    }

    fn read(&mut self, number: usize) {
        loop {
            let read = match self.links[number].stream.read(&mut self.chunk) {
                Ok(0) => panic!("{:?} has closed a connection", self.protocol),
                Ok(read) => read,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) => panic!("{:?}: {error}", self.protocol),
            };
            let mut unread = std::mem::take(&mut self.links[number].unread);
            if unread.is_empty() {
                let chunk = std::mem::take(&mut self.chunk);
                let taken = self.take(number, &chunk[..read]);
                unread.extend_from_slice(&chunk[taken..read]);
                self.chunk = chunk;
            } else {
                unread.extend_from_slice(&self.chunk[..read]);
                let taken = self.take(number, &unread);
                unread.drain(..taken);
            }
            self.links[number].unread = unread;
            // Less than asked for: there was no more.
            if read < self.chunk.len() {
                return;
            }
        }
    }

    /// Reads whole events at the front of `bytes`. Returns their number of bytes.
    fn take(&mut self, number: usize, bytes: &[u8]) -> usize {
        let mut taken = 0;
        while let Some((event, length)) = self.protocol.next(&bytes[taken..]) {
            taken += length;
            let link = &mut self.links[number];
            match event {
                Event::Message(payload) if self.scene.traffic == Traffic::Arm => {
                    let stamp = stamp(payload);
                    // A late message is followed at once by the next, and no step may be due between them. So two
                    // messages may have the same stamp, but not three.
                    let mut latest = link.stamps.iter().rev();
                    assert!(
                        latest.next() <= Some(&stamp) && latest.next() < Some(&stamp),
                        "the arm's messages came out of order"
                    );
                    link.stamps.push(stamp);
                    self.deliveries += 1;
                }
                Event::Message(payload) => {
                    let (sequence, sent) = self.template.read(payload).expect("a whole message");
                    assert_eq!(
                        sequence, link.received,
                        "{:?}: the next message",
                        self.protocol
                    );
                    link.received += 1;
                    self.deliveries += 1;
                    if self.measuring {
                        self.latencies
                            .push(u32::try_from(now() - sent).unwrap_or(u32::MAX));
                    }
                }
                Event::Ready => link.ready = true,
                Event::Complaint(what) => {
                    panic!("{:?} says {}", self.protocol, String::from_utf8_lossy(what))
                }
                Event::Answer | Event::Other => {}
            }
        }
        taken
    }
}
