//! The writes of frames.

use std::cell::RefCell;
use std::io::IoSlice;
use std::pin::Pin;
use std::rc::Rc;
use std::sync::Arc;
use std::task::{Context, Poll};

use super::*;
use pendularm::actors::gateway::connection::Connection;
use tokio::io::{AsyncRead, AsyncWrite, AsyncWriteExt, DuplexStream, ReadBuf};

/// A stream that records the number of frames in every write, and accepts all bytes.
struct Noting {
    input: DuplexStream,
    writes: Rc<RefCell<Vec<usize>>>,
}

impl AsyncRead for Noting {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.input).poll_read(context, buffer)
    }
}

impl AsyncWrite for Noting {
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<std::io::Result<usize>> {
        self.poll_write_vectored(context, &[IoSlice::new(bytes)])
    }

    fn poll_write_vectored(
        self: Pin<&mut Self>,
        _: &mut Context<'_>,
        slices: &[IoSlice<'_>],
    ) -> Poll<std::io::Result<usize>> {
        let bytes: Vec<u8> = slices.iter().flat_map(|slice| slice.to_vec()).collect();
        let frames = bytes.iter().filter(|&&byte| byte == b'\n').count();
        self.writes.borrow_mut().push(frames);
        Poll::Ready(Ok(bytes.len()))
    }

    fn poll_flush(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<std::io::Result<()>> {
        Poll::Ready(Ok(()))
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<std::io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

#[test]
fn several_frames_leave_in_one_write_but_not_to_a_client_that_ends_no_line() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        for (end, expected) in [("\n", vec![1, 5]), ("", vec![1, 1, 1, 1, 1, 1])] {
            let writes = Rc::default();
            let (mut client, input) = tokio::io::duplex(WIDE);
            let stream = Noting {
                input,
                writes: Rc::clone(&writes),
            };
            Connection::start_on(
                stream,
                gateway.registry.clone(),
                Arc::clone(&gateway.gauges),
            );
            let subscribe = format!("{{\"op\":\"subscribe\",\"topic\":\"/joint_states\"}}{end}");
            client.write_all(subscribe.as_bytes()).await.unwrap();
            settle().await;
            for n in 0..5 {
                gateway.registry.do_send(Publish {
                    topic: Topic::JointStates,
                    frame: Box::new(move || messages::publish("/joint_states", &json!({"n": n}))),
                });
            }
            settle().await;
            assert_eq!(*writes.borrow(), expected);
        }
    });
}
