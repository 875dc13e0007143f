//! Requests over HTTP: missing heads, and unread answers.

use super::*;
use crate::folder::Folder;
use pendularm::web::Site;
use pendularm::web::access::Access;
use pendularm::web::report::{FILES, MAX_FILE};
use pendularm::web::stream::{ANSWER_TIME, IDLE_TIME};
use tokio::io::{AsyncRead, split};

const HEAD: &str = "GET / HTTP/1.1\r\nHost: 127.0.0.1:9095\r\n";

/// All bytes up to the end of the stream.
async fn rest(stream: &mut (impl AsyncRead + Unpin)) -> String {
    let mut text = String::new();
    stream
        .read_to_string(&mut text)
        .await
        .expect("an orderly end");
    text
}

/// A report of one file, `a.csv`, which is sparse on the disk. Returns its folder and its path.
fn report_of(test: &str, length: u64) -> (Folder, Arc<Admission>) {
    let folder = Folder::new(test);
    let file = std::fs::File::create(folder.join("a.csv")).unwrap();
    file.set_len(length).unwrap();
    let admission = Admission {
        token: None,
        site: Site::new(Access::default(), folder.to_path_buf(), &[]),
        ..Admission::default()
    };
    (folder, Arc::new(admission))
}

fn file_request() -> String {
    HEAD.replace("GET /", "GET /report/a.csv") + "\r\n"
}

/// Clients that do not read a file hold the permits for files until they are closed. The next one gets its file.
#[test]
fn clients_that_take_no_byte_of_a_file_keep_others_from_files_for_a_time_only() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (folder, admission) = report_of("long", MAX_FILE);
        let request = file_request();
        let began = Instant::now();
        let mut deaf = Vec::new();
        for _ in 0..FILES {
            let mut stream = gateway.open(Arc::clone(&admission), 1024);
            stream.write_all(request.as_bytes()).await.unwrap();
            assert_eq!(stream.read_u8().await.unwrap(), b'H');
            deaf.push(stream);
        }
        sleep(ANSWER_TIME - Duration::from_secs(1)).await;
        let mut late = gateway.open(Arc::clone(&admission), WIDE);
        late.write_all(request.as_bytes()).await.unwrap();
        assert_eq!(late.read_u8().await.unwrap(), b'H');
        assert_elapsed(began, ANSWER_TIME);
        let mut text = vec![0; MAX_FILE as usize];
        late.read_exact(&mut text).await.unwrap();
        let head = String::from_utf8_lossy(&text[..1024]);
        let length = format!("\r\nContent-Length: {MAX_FILE}\r\n");
        assert!(
            head.starts_with("TTP/1.1 200 ") && head.contains(&length),
            "{head}"
        );
        drop(folder);
    });
}

#[test]
fn a_file_of_a_report_that_is_too_long_is_refused() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let (folder, admission) = report_of("longer", MAX_FILE + 1);
        let mut stream = gateway.open(Arc::clone(&admission), WIDE);
        stream.write_all(file_request().as_bytes()).await.unwrap();
        let answer = rest(&mut stream).await;
        assert!(answer.starts_with("HTTP/1.1 503 "), "{answer}");
        assert!(answer.contains("longer than 4194304 bytes"), "{answer}");
        drop(folder);
    });
}

/// The next request must arrive soon after an answer, also in pieces, because each connection takes a place.
#[test]
fn a_connection_without_a_next_request_is_closed_after_two_seconds() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        for further in ["", "GET", HEAD] {
            let mut stream = connect(&gateway, WIDE);
            let request = format!("{HEAD}\r\n");
            let mut page = Vec::new();
            for _ in 0..3 {
                page.clear();
                stream.write_all(request.as_bytes()).await.unwrap();
                while !page.ends_with(b"</html>\n") {
                    page.push(stream.read_u8().await.unwrap());
                }
                sleep(IDLE_TIME - Duration::from_millis(100)).await;
            }
            let began = Instant::now();
            stream.write_all(further.as_bytes()).await.unwrap();
            assert_eq!(rest(&mut stream).await, "", "{further}");
            assert_elapsed(began, Duration::from_millis(100));
        }
        settle().await;
        assert_eq!(gateway.gauges.connections(), 0);
    });
}

#[test]
fn a_client_that_takes_a_few_bytes_at_a_time_gets_the_last_answer_whole() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let request = format!("{HEAD}\r\n");
        let missing = request.replace("/ HTTP", "/nothing HTTP");
        for (request, status) in [
            (missing.clone() + "not a request\r\n\r\n", "400 Bad Request"),
            (
                request.replace("\r\n\r\n", "\r\nContent-Length: 9\r\n\r\n"),
                "400 Bad Request",
            ),
            (
                missing.clone() + &request.replace("GET", "DELETE"),
                "405 Method Not Allowed",
            ),
            (missing.replace("HTTP/1.1", "HTTP/1.0"), "404 Not Found"),
        ] {
            let (mut answers, mut requests) = split(connect(&gateway, 16));
            let send = async {
                requests.write_all(request.as_bytes()).await.unwrap();
                requests.shutdown().await.unwrap();
            };
            let ((), answers) = tokio::join!(send, rest(&mut answers));
            let (_, last) = answers.rsplit_once("HTTP/1.").expect(&answers);
            assert_eq!(last.get(2..2 + status.len()), Some(status), "{answers}");
            let (head, body) = last.split_once("\r\n\r\n").expect(last);
            let head = head.to_ascii_lowercase();
            let (_, length) = head.split_once("content-length: ").expect(last);
            let length = length.lines().next().expect(last);
            assert_eq!(body.len().to_string(), length, "{last}");
        }
        open(&gateway, 16).await;
    });
}
