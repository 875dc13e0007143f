//! The unread bytes of a client bound the messages that wait in its socket. `tests/actors/connection/pace.rs` has the
//! delays of slow clients.

use std::thread::sleep;
use std::time::Duration;

use crate::common::{Client, Runtime};

/// The time for which a client reads nothing. Its socket would hold all 240 messages of that time.
const PAUSE: Duration = Duration::from_secs(4);
/// The messages of the last second, of half a second of reading, and the 0.1 s in the socket, with as many again for a
/// busy machine.
const MOST: usize = 2 * (60 + 30 + 6);

#[test]
fn a_client_that_has_read_nothing_for_a_while_gets_the_messages_of_the_last_second() {
    let runtime = Runtime::start();
    let mut clients = [runtime.connect(), Client::web(runtime.address)];
    for client in &mut clients {
        client.send(&serde_json::json!({"op": "subscribe", "topic": "/joint_states"}));
    }
    sleep(PAUSE);
    for client in &mut clients {
        let count = client.receive_for(Duration::from_millis(500)).len();
        assert!(count < MOST, "{count} messages");
    }
}
