//! Admission with a token: from the connection to the token, whatever a client sends or does not send.
//!
//! **Invariant:** virtual time and in-memory pipes only. The holder of the token gets in at once, whatever the others
//! do.

use std::sync::Arc;
use std::time::Duration;

use crate::exchanges::admission;
use crate::system::in_virtual_time;
use crate::virtual_time::{Gateway, WIDE, assert_elapsed, settle};
use pendularm::actors::gateway::connection::admission::{
    Admission, MAX_NEWCOMERS, WRONG_TOKEN_TIME,
};
use pendularm::actors::gateway::connection::{Connection, Ends};
use pendularm::actors::gateway::limits::{HEAD_TIME, KEPT_PLACES};
use pendularm::options::DEFAULT_CLIENTS;
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream, duplex};
use tokio::time::{Instant, sleep, timeout};

const TOKEN: &str = "open-sesame-once-more";
const AUTH: &str = "{\"op\":\"auth\",\"token\":\"open-sesame-once-more\"}\n";
const WRONG: &str = "{\"op\":\"auth\",\"token\":\"open-barley\"}\n";
const LOCAL: ([u8; 4], u16) = ([127, 0, 0, 1], 9095);

/// A gateway whose clients have to show the token.
struct Guarded {
    gateway: Gateway,
    admission: Arc<Admission>,
}

impl Guarded {
    async fn new() -> Self {
        let admission = admission(&format!("--token {TOKEN}")).unwrap();
        Self {
            gateway: Gateway::bare().await,
            admission: Arc::new(admission),
        }
    }

    /// The client's end of a connection from this machine.
    fn connect(&self) -> DuplexStream {
        let (ours, theirs) = duplex(WIDE);
        let (registry, gauges) = (
            self.gateway.registry.clone(),
            Arc::clone(&self.gateway.gauges),
        );
        let ends = Ends {
            local: LOCAL.into(),
            peer: ([127, 0, 0, 1], 40000).into(),
        };
        Connection::start_with(Arc::clone(&self.admission), ends, theirs, registry, gauges);
        ours
    }

    /// This many connections that say nothing.
    fn silent(&self, count: usize) -> Vec<DuplexStream> {
        (0..count).map(|_| self.connect()).collect()
    }

    /// A client that has the token, and is served at once.
    async fn holder(&self) -> DuplexStream {
        let began = Instant::now();
        let mut stream = self.connect();
        let call = "{\"op\":\"call_service\",\"service\":\"/none\",\"id\":7}\n";
        stream.write_all(AUTH.as_bytes()).await.unwrap();
        stream.write_all(call.as_bytes()).await.unwrap();
        let mut answer = [0; 256];
        let read = timeout(HEAD_TIME, stream.read(&mut answer)).await;
        let answer = String::from_utf8_lossy(&answer[..read.expect("an answer").unwrap()]);
        assert!(answer.contains("\"id\":7"), "{answer}");
        assert_elapsed(began, Duration::ZERO);
        stream
    }

    fn connections(&self) -> u64 {
        self.gateway.gauges.connections()
    }
}

/// All that comes up to the end of the stream.
async fn rest(stream: &mut DuplexStream) -> String {
    let mut text = String::new();
    let reading = stream.read_to_string(&mut text);
    reading.await.expect("an orderly end");
    text
}

/// The time begins when the client connects, and nothing that it sends makes it longer.
#[test]
fn a_client_has_five_seconds_from_connecting_to_its_token() {
    in_virtual_time(async {
        for drip in [
            "",
            " ",
            "\n",
            "{",
            "{\"op\":\"auth\",",
            "G",
            "GE",
            "nonsense",
        ] {
            let guarded = Guarded::new().await;
            let began = Instant::now();
            let mut client = guarded.connect();
            sleep(HEAD_TIME / 2).await;
            client.write_all(drip.as_bytes()).await.unwrap();
            sleep(HEAD_TIME / 4).await;
            assert_eq!(guarded.connections(), 0, "the registry knows nothing of it");
            client.write_all(b" ").await.unwrap();
            let answer = rest(&mut client).await;
            assert!(answer.contains("\"level\":\"error\""), "{drip:?}: {answer}");
            if drip != "nonsense" {
                assert!(answer.contains("waited for 5 s"), "{drip:?}: {answer}");
                assert_elapsed(began, HEAD_TIME);
            }
        }
    });
}

#[cfg(feature = "web")]
#[test]
fn over_http_the_same_five_seconds_run_from_connecting_to_the_end_of_the_head() {
    in_virtual_time(async {
        let guarded = Guarded::new().await;
        let began = Instant::now();
        let mut client = guarded.connect();
        sleep(4 * HEAD_TIME / 5).await;
        client
            .write_all(b"GET / HTTP/1.1\r\nHost: 127.0.0.1:9095\r\n")
            .await
            .unwrap();
        let answer = rest(&mut client).await;
        assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
        assert_elapsed(began, HEAD_TIME);
    });
}

#[test]
fn who_has_shown_the_token_in_time_may_be_silent() {
    in_virtual_time(async {
        let guarded = Guarded::new().await;
        let mut client = guarded.holder().await;
        sleep(Duration::from_secs(3600)).await;
        client.write_all(b"{\"op\":\"nonsense\"}\n").await.unwrap();
        assert_eq!(client.read_u8().await.unwrap(), b'{');
        assert_eq!(guarded.connections(), 1);
    });
}

/// More than there are places for clients: they take none of those, and of their own only as many as there are.
#[test]
fn silent_connections_without_end_keep_out_nobody_who_has_the_token() {
    in_virtual_time(async {
        let guarded = Guarded::new().await;
        let mut holders = Vec::new();
        let mut silent = Vec::new();
        for _ in 0..10 {
            silent.extend(guarded.silent(MAX_NEWCOMERS + 7));
            holders.push(guarded.holder().await);
        }
        assert_eq!(guarded.connections(), 10);
        // All but the newest got a message at once.
        let began = Instant::now();
        let newest = silent.split_off(silent.len() - MAX_NEWCOMERS + 1);
        for mut client in silent {
            let told = rest(&mut client).await;
            assert!(told.contains("others have yet to show it"), "{told}");
        }
        assert_elapsed(began, Duration::ZERO);
        for mut client in newest {
            assert!(rest(&mut client).await.contains("waited for 5 s"));
        }
    });
}

#[test]
fn clients_with_the_token_are_counted_apart_from_those_without() {
    in_virtual_time(async {
        let guarded = Guarded::new().await;
        let mut holders = Vec::new();
        let silent = guarded.silent(MAX_NEWCOMERS);
        for _ in 0..DEFAULT_CLIENTS - KEPT_PLACES {
            holders.push(guarded.holder().await);
        }
        let mut late = guarded.connect();
        late.write_all(AUTH.as_bytes()).await.unwrap();
        assert!(rest(&mut late).await.contains("too many connections"));
        // A command shows the token too, and has a kept place.
        let mut command = guarded.connect();
        let opening = AUTH.replace("}", ",\"command\":true}");
        command.write_all(opening.as_bytes()).await.unwrap();
        command.write_all(b"{\"op\":\"nonsense\"}\n").await.unwrap();
        let mut answer = [0; 40];
        command.read_exact(&mut answer).await.unwrap();
        assert!(!String::from_utf8_lossy(&answer).contains("too many"));
        assert_eq!(
            guarded.connections(),
            DEFAULT_CLIENTS as u64 - KEPT_PLACES as u64 + 1
        );
        drop(silent);
    });
}

/// A client that has sent its token is admitted even if its place is lost before the token is read.
#[test]
fn who_has_sent_the_token_loses_nothing_to_those_who_come_behind() {
    in_virtual_time(async {
        let guarded = Guarded::new().await;
        let mut holder = guarded.connect();
        holder.write_all(AUTH.as_bytes()).await.unwrap();
        let silent = guarded.silent(2 * MAX_NEWCOMERS);
        settle().await;
        assert_eq!(guarded.connections(), 1);
        holder.write_all(b"{\"op\":\"nonsense\"}\n").await.unwrap();
        assert_eq!(holder.read_u8().await.unwrap(), b'{');
        drop(silent);
    });
}

#[test]
fn a_wrong_token_is_answered_after_half_a_second_and_the_right_one_at_once() {
    in_virtual_time(async {
        let guarded = Guarded::new().await;
        let began = Instant::now();
        let mut guesses = guarded.silent(20);
        for guess in &mut guesses {
            guess.write_all(WRONG.as_bytes()).await.unwrap();
        }
        settle().await;
        drop(guarded.holder().await);
        for mut client in guesses {
            assert!(rest(&mut client).await.contains("not this runtime's"));
            assert_elapsed(began, WRONG_TOKEN_TIME);
        }
    });
}

#[cfg(feature = "web")]
#[test]
fn a_wrong_token_over_http_is_answered_no_sooner() {
    in_virtual_time(async {
        let guarded = Guarded::new().await;
        // A connection without a token does not count as a guess.
        for (query, cookie, status, time) in [
            ("token=open-barley", "", 403, WRONG_TOKEN_TIME),
            ("", "open-barley", 403, WRONG_TOKEN_TIME),
            ("", "", 403, Duration::ZERO),
            (&format!("token={TOKEN}"), "", 200, Duration::ZERO),
        ] {
            let began = Instant::now();
            let mut client = guarded.connect();
            let cookie = match cookie {
                "" => String::new(),
                token => format!("Cookie: pendularm_9095={token}\r\n"),
            };
            let request = format!(
                "GET /?{query} HTTP/1.1\r\nHost: 127.0.0.1:9095\r\n{cookie}Connection: close\r\n\r\n"
            );
            client.write_all(request.as_bytes()).await.unwrap();
            let answer = rest(&mut client).await;
            assert!(
                answer.starts_with(&format!("HTTP/1.1 {status} ")),
                "{answer}"
            );
            assert_elapsed(began, time);
        }
    });
}

/// Enough guesses that most lose their place before they are answered: none of them keeps the holder out, and in half a
/// second no more are answered than there are places.
#[test]
fn a_flood_of_guesses_is_answered_no_faster_and_keeps_out_nobody() {
    in_virtual_time(async {
        let guarded = Guarded::new().await;
        let mut guesses = Vec::new();
        for _ in 0..1000 {
            let mut client = guarded.connect();
            client.write_all(WRONG.as_bytes()).await.unwrap();
            guesses.push(client);
            if guesses.len() % 100 == 0 {
                drop(guarded.holder().await);
            }
        }
        let mut answered = 0;
        for mut client in guesses {
            answered += usize::from(rest(&mut client).await.contains("not this runtime's"));
        }
        assert!(
            (100..=MAX_NEWCOMERS).contains(&answered),
            "{answered} of 1,000 guesses answered"
        );
    });
}

#[cfg(feature = "web")]
#[test]
fn slow_requests_without_the_token_keep_out_no_page_of_who_has_it() {
    in_virtual_time(async {
        let guarded = Guarded::new().await;
        let mut slow = Vec::new();
        for _ in 0..5 * MAX_NEWCOMERS {
            let mut client = guarded.connect();
            client
                .write_all(b"GET / HTTP/1.1\r\nHost: 127.0.0.1:9095\r\n")
                .await
                .unwrap();
            slow.push(client);
        }
        settle().await;
        let mut client = guarded.connect();
        let right = format!("GET /?token={TOKEN} HTTP/1.1\r\nHost: 127.0.0.1:9095\r\n\r\n");
        client.write_all(right.as_bytes()).await.unwrap();
        assert!(rest(&mut client).await.starts_with("HTTP/1.1 200 "));
        let told = rest(&mut slow[0]).await;
        assert!(
            told.starts_with("HTTP/1.1 503 ") && told.contains("others have yet to show it"),
            "{told}"
        );
    });
}
