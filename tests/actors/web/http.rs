//! Requests of HTTP: heads that do not come, and answers that are not taken.

use std::path::{Path, PathBuf};

use super::*;
use pendularm::actors::gateway::connection::admission::MAX_HEADS;
use pendularm::web::access::Access;
use pendularm::web::serve::{ANSWER_TIME, STRETCH, TAKE_TIME};
use pendularm::web::{MAX_REQUESTS, Site};

const HEAD: &str = "GET / HTTP/1.1\r\nHost: 127.0.0.1:9095\r\n";
/// From the first bytes to the end of the head, and to the token.
const HEAD_TIME: Duration = Duration::from_secs(5);

/// All that comes up to the end of the stream.
async fn rest(stream: &mut DuplexStream) -> String {
    let mut text = String::new();
    stream
        .read_to_string(&mut text)
        .await
        .expect("an orderly end");
    text
}

#[test]
fn a_head_that_does_not_come_is_given_up_after_five_seconds() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut stream = connect(&gateway, WIDE);
        stream.write_all(HEAD.as_bytes()).await.unwrap();
        let began = Instant::now();
        // A header line every second is no head either.
        let dripping = async {
            for _ in 0..4 {
                sleep(Duration::from_secs(1)).await;
                stream.write_all(b"X: y\r\n").await.unwrap();
            }
            rest(&mut stream).await
        };
        let answer = dripping.await;
        assert!(answer.starts_with("HTTP/1.1 408 "), "{answer}");
        assert_elapsed(began, HEAD_TIME);
        drop(stream);
        settle().await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_request_that_is_not_even_begun_may_take_for_ever_and_one_that_is_may_not() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let mut silent = connect(&gateway, WIDE);
        let mut begun = connect(&gateway, WIDE);
        begun.write_all(b"GE").await.unwrap();
        let began = Instant::now();
        let answer = rest(&mut begun).await;
        assert!(answer.contains("\"level\":\"error\""), "{answer}");
        assert_elapsed(began, HEAD_TIME);
        // A stream that can only become JSON, or BSON, has more time: a frame's.
        let mut open = connect(&gateway, WIDE);
        open.write_all(b"{").await.unwrap();
        let began = Instant::now();
        let answer = rest(&mut open).await;
        assert!(answer.contains("\"level\":\"error\""), "{answer}");
        assert_elapsed(began, FRAME_TIME);
        sleep(Duration::from_secs(24 * 3600)).await;
        silent.write_all(b"{}\n").await.unwrap();
        let mut byte = [0];
        silent.read_exact(&mut byte).await.unwrap();
        assert_eq!(byte, *b"{");
    });
}

/// A report of one file, `a.csv`, that has a length, and no content on the disk: its folder, and the way to it.
fn report_of(test: &str, length: u64) -> (PathBuf, Arc<Admission>) {
    let folder = std::env::temp_dir().join(format!("pendularm-{test}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = std::fs::File::create(folder.join("a.csv")).unwrap();
    file.set_len(length).unwrap();
    let admission = Admission {
        token: None,
        site: Site::new(Access::default(), folder.clone()),
        ..Admission::default()
    };
    (folder, Arc::new(admission))
}

fn file_request() -> String {
    HEAD.replace("GET /", "GET /report/a.csv") + "\r\n"
}

/// The pipe takes all of it at once, as a system's buffer takes megabytes.
#[test]
fn a_file_of_a_report_is_sent_in_turns() {
    const LONG: usize = 4 << 20;
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (folder, admission) = report_of("turns", LONG as u64);
        let mut stream = connect_through(&gateway, &admission, WIDE);
        stream.write_all(file_request().as_bytes()).await.unwrap();
        assert_eq!(stream.read_u8().await.unwrap(), b'H');
        let mut rest = vec![0; LONG];
        let (turns, _) = turns_of_others(stream.read_exact(&mut rest)).await;
        // One piece has come with the first byte.
        assert!(turns >= LONG / TURN - 1, "{turns} turns");
        std::fs::remove_dir_all(&folder).unwrap();
    });
}

/// Far longer than there is memory; of as many that don't read as there may be, the oldest makes room.
#[test]
fn a_file_of_a_report_may_have_any_length_and_is_sent_to_everybody() {
    const LONG: u64 = 1 << 36;
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (folder, admission) = report_of("long", LONG);
        let request = file_request();
        let mut deaf = Vec::new();
        for _ in 0..MAX_REQUESTS {
            let mut stream = connect_through(&gateway, &admission, 1024);
            stream.write_all(request.as_bytes()).await.unwrap();
            assert_eq!(stream.read_u8().await.unwrap(), b'H');
            deaf.push(stream);
        }
        settle().await;
        #[cfg(target_os = "linux")]
        assert_eq!(open_files_in(&folder), 0, "all wait for their clients");
        let mut late = connect_through(&gateway, &admission, WIDE);
        late.write_all(request.as_bytes()).await.unwrap();
        let mut begins = vec![0; 4 << 20];
        late.read_exact(&mut begins).await.unwrap();
        let head = String::from_utf8_lossy(&begins[..1024]);
        assert!(head.starts_with("HTTP/1.1 200 "), "{head}");
        let length = format!("\r\nContent-Length: {LONG}\r\n");
        assert!(head.contains(&length), "{head}");
        assert!(rest(&mut deaf[0]).await.len() < 2048, "the oldest gave way");
        let mut more = vec![0; 4096];
        for stream in &mut deaf[1..] {
            stream.read_exact(&mut more).await.unwrap();
        }
        std::fs::remove_dir_all(&folder).unwrap();
    });
}

/// How many files of a folder this process has open.
#[cfg(target_os = "linux")]
fn open_files_in(folder: &Path) -> usize {
    let open = std::fs::read_dir("/proc/self/fd").unwrap();
    open.filter_map(|entry| std::fs::read_link(entry.unwrap().path()).ok())
        .filter(|path| path.starts_with(folder))
        .count()
}

/// A client that takes 320 KiB a second gets 48 MiB, in two stretches of time; one that takes a piece just before it
/// would be given up for taking none gets a short file's time.
#[test]
fn a_file_of_a_report_has_time_for_its_length() {
    const PIECE: usize = 64 * 1024;
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let long = STRETCH + STRETCH / 2;
        for (length, pause, arrives) in [
            (long, Duration::from_millis(200), true),
            (STRETCH / 2, TAKE_TIME - Duration::from_secs(1), false),
        ] {
            let (folder, admission) = report_of("time", length);
            let mut stream = connect_through(&gateway, &admission, PIECE);
            let began = Instant::now();
            let request = file_request();
            stream.write_all(request.as_bytes()).await.unwrap();
            let (mut piece, mut taken) = (vec![0; PIECE], 0);
            loop {
                let read = stream.read(&mut piece).await.unwrap();
                if read == 0 {
                    break;
                }
                taken += read as u64;
                sleep(pause).await;
            }
            assert_eq!(taken > length, arrives, "{taken} bytes of {length}");
            if arrives {
                assert!(began.elapsed() > ANSWER_TIME);
            } else {
                let late = began.elapsed() - ANSWER_TIME;
                assert!(late <= 2 * pause, "{late:?}");
            }
            std::fs::remove_dir_all(&folder).unwrap();
        }
    });
}

/// Clients that take no byte of their answers keep nobody from one, nor do those that don't get to the end of their
/// heads.
#[test]
fn of_too_many_requests_at_once_the_oldest_makes_room() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let admission = Arc::default();
        let request = format!("{HEAD}\r\n");
        let mut begun = Vec::new();
        for _ in 0..=MAX_HEADS {
            let mut stream = connect_through(&gateway, &admission, WIDE);
            stream.write_all(HEAD.as_bytes()).await.unwrap();
            begun.push(stream);
        }
        let told = rest(&mut begun.remove(0)).await;
        assert!(told.starts_with("HTTP/1.1 408 "), "{told}");
        // The page is longer than the pipe.
        let mut deaf = Vec::new();
        for _ in 0..MAX_REQUESTS {
            let mut stream = connect_through(&gateway, &admission, 512);
            stream.write_all(request.as_bytes()).await.unwrap();
            deaf.push(stream);
        }
        settle().await;
        let mut stream = connect_through(&gateway, &admission, WIDE);
        stream.write_all(request.as_bytes()).await.unwrap();
        let page = rest(&mut stream).await;
        assert!(page.starts_with("HTTP/1.1 200 "), "{page}");
        drop(stream);
        // One of them has made room, the oldest; the others get all of it as soon as they read.
        for (number, mut stream) in deaf.into_iter().enumerate() {
            let whole = rest(&mut stream).await == page;
            assert_eq!(whole, number > 0, "{number}");
        }
        for mut stream in begun {
            stream.write_all(b"\r\n").await.unwrap();
            assert_eq!(rest(&mut stream).await, page);
        }
    });
}

#[test]
fn a_browser_that_takes_no_byte_of_its_answer_is_given_up() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        // The answer is longer than the pipe.
        let mut stream = connect(&gateway, 64);
        stream
            .write_all(format!("{HEAD}\r\n").as_bytes())
            .await
            .unwrap();
        settle().await;
        assert_eq!(gateway.gauges.connections(), 1);
        sleep(Duration::from_secs(11)).await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}
