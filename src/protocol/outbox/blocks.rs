//! A queue in blocks, for what waits for one client.
//!
//! **Invariant:** it grows and shrinks by one block at a time. A thousand clients that take nothing are all sent the
//! same, so that their queues would all be doubled and copied at the same moment.

use std::collections::VecDeque;

/// Places that a queue may keep beside twice as many as are taken.
const FEW: usize = 4;
/// Places in a block: a tick's worth of frames. One block is kept while nothing waits.
const BLOCK: usize = 64;

/// A queue of blocks.
#[derive(Debug)]
pub(crate) struct Blocks<T> {
    /// None is empty, unless it is the only one.
    blocks: VecDeque<VecDeque<T>>,
    len: usize,
}

impl<T> Default for Blocks<T> {
    fn default() -> Self {
        Self {
            blocks: VecDeque::new(),
            len: 0,
        }
    }
}

impl<T> Blocks<T> {
    pub(crate) const fn len(&self) -> usize {
        self.len
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.len == 0
    }

    pub(crate) fn front(&self) -> Option<&T> {
        self.blocks.front()?.front()
    }

    pub(crate) fn front_mut(&mut self) -> Option<&mut T> {
        self.blocks.front_mut()?.front_mut()
    }

    pub(crate) fn push_back(&mut self, item: T) {
        self.len += 1;
        if let Some(last) = self.blocks.back_mut().filter(|last| last.len() < BLOCK) {
            return last.push_back(item);
        }
        // The first block grows to its size, since most queues stay short.
        let room = if self.blocks.is_empty() { 0 } else { BLOCK };
        let mut block = VecDeque::with_capacity(room);
        block.push_back(item);
        self.blocks.push_back(block);
    }

    pub(crate) fn pop_front(&mut self) -> Option<T> {
        let first = self.blocks.front_mut()?;
        let item = first.pop_front()?;
        self.len -= 1;
        if first.is_empty() && self.blocks.len() > 1 {
            self.blocks.pop_front();
            fit(&mut self.blocks);
        }
        Some(item)
    }
}

/// Gives back the places of a queue that is less than half full: constant time per item that has left, all told.
pub(super) fn fit<T>(queue: &mut VecDeque<T>) {
    if queue.capacity() > 2 * queue.len() + FEW {
        queue.shrink_to(queue.len() * 3 / 2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    impl<T> Blocks<T> {
        pub(crate) fn places(&self) -> usize {
            self.blocks.iter().map(VecDeque::capacity).sum()
        }
    }

    #[test]
    fn what_goes_in_comes_out_in_order_and_one_block_is_kept() {
        let mut queue = Blocks::default();
        let (mut pushed, mut popped) = (0, 0);
        for (more, less) in [
            (1, 1),
            (BLOCK, 1),
            (1000, 1030),
            (0, 33),
            (50 * BLOCK, 50 * BLOCK),
        ] {
            for _ in 0..more {
                queue.push_back(pushed);
                pushed += 1;
            }
            for _ in 0..less {
                assert_eq!(queue.front(), Some(&popped));
                assert_eq!(queue.pop_front(), Some(popped));
                popped += 1;
            }
            assert_eq!(queue.len(), pushed - popped);
            assert!(queue.blocks.len() <= queue.len() / BLOCK + 2);
            assert!(queue.blocks.capacity() <= 2 * queue.blocks.len() + FEW);
        }
        assert_eq!(
            (queue.pop_front(), queue.front(), queue.is_empty()),
            (None, None, true)
        );
        assert_eq!(queue.places(), BLOCK);
    }
}
