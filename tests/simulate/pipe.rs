//! The runtime's end of a connection: an in-memory pipe that may break, or panic, after a given number of bytes.

use std::cell::Cell;
use std::io::{Error, ErrorKind, Result};
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll};

use tokio::io::{AsyncRead, AsyncWrite, DuplexStream, ReadBuf};

/// Part of the message of every intended panic.
pub const MEANT: &str = "a panic that was put in";

/// The fates of a pipe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It works.
    Sound,
    /// The next read or write that moves a byte fails.
    Breaks,
    /// It panics.
    Panics,
}

/// A pipe and its fate, which may be set later.
pub struct Pipe {
    pub stream: DuplexStream,
    pub fate: Rc<Cell<Fate>>,
    /// Bytes that all pipes of the world have moved so far.
    pub moved: Rc<Cell<u64>>,
}

impl Pipe {
    fn meet(&self) -> Result<()> {
        match self.fate.get() {
            Fate::Sound => Ok(()),
            Fate::Breaks => Err(Error::from(ErrorKind::ConnectionReset)),
            Fate::Panics => {
                self.fate.set(Fate::Breaks);
                panic!("{MEANT}")
            }
        }
    }
}

impl AsyncRead for Pipe {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<Result<()>> {
        let before = buffer.filled().len();
        let polled = Pin::new(&mut self.stream).poll_read(cx, buffer);
        let read = buffer.filled().len() - before;
        if read > 0 {
            self.meet()?;
            self.moved.set(self.moved.get() + read as u64);
        }
        polled
    }
}

impl AsyncWrite for Pipe {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<Result<usize>> {
        self.meet()?;
        let polled = Pin::new(&mut self.stream).poll_write(cx, bytes);
        if let Poll::Ready(Ok(written)) = &polled {
            self.moved.set(self.moved.get() + *written as u64);
        }
        polled
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Result<()>> {
        Pin::new(&mut self.stream).poll_flush(cx)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(cx)
    }
}
