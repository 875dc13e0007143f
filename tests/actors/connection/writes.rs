//! The writes of frames.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use super::*;
use crate::virtual_time::Watched;
use pendularm::actors::gateway::connection::{self, Ends};
use tokio::io::AsyncWriteExt;

#[test]
fn several_frames_leave_in_one_write_but_not_to_a_client_that_ends_no_line() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        // The line end may come in a packet of its own.
        for (end, then, expected) in [
            ("\n", "", vec![1, 5]),
            ("", "", vec![1, 1, 1, 1, 1, 1]),
            ("", "\n", vec![1, 5]),
        ] {
            // The number of frames in every write.
            let writes: Rc<RefCell<Vec<usize>>> = Rc::default();
            let (mut client, theirs) = tokio::io::duplex(WIDE);
            let mut stream = Watched::new(theirs);
            let log = Rc::clone(&writes);
            stream.on_write = Box::new(move |bytes| {
                let frames = bytes.iter().filter(|&&byte| byte == b'\n').count();
                log.borrow_mut().push(frames);
            });
            connection::start(
                None,
                Arc::default(),
                Ends::default(),
                stream,
                gateway.registry.clone(),
                Arc::clone(&gateway.gauges),
            );
            let subscribe = format!("{{\"op\":\"subscribe\",\"topic\":\"/joint_states\"}}{end}");
            client.write_all(subscribe.as_bytes()).await.unwrap();
            settle().await;
            client.write_all(then.as_bytes()).await.unwrap();
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
