//! Unread answers over HTTP. `exchanges/heads.txt` and `exchanges/http.txt` have requests.

use super::*;
use crate::folder::Folder;
use pendularm::web::Site;
use pendularm::web::access::Access;
use pendularm::web::report::{FILES, MAX_FILE};
use pendularm::web::stream::ANSWER_TIME;
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

/// Clients that do not read a file hold the permits for files until they are closed. The next one gets its file.
#[test]
fn clients_that_take_no_byte_of_a_file_keep_others_from_files_for_a_time_only() {
    in_virtual_time(async {
        let gateway = Gateway::bare().await;
        let folder = Folder::new("long");
        // It is sparse on the disk.
        let file = std::fs::File::create(folder.join("a.csv")).unwrap();
        file.set_len(MAX_FILE).unwrap();
        let admission = Arc::new(Admission {
            site: Site::new(Access::default(), folder.to_path_buf(), &[]),
            ..Admission::default()
        });
        let request = HEAD.replace("GET /", "GET /report/a.csv") + "\r\n";
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
        let (elapsed, most) = (began.elapsed(), ANSWER_TIME + Duration::from_millis(20));
        assert!((ANSWER_TIME..=most).contains(&elapsed), "{elapsed:?}");
        let mut text = vec![0; MAX_FILE as usize];
        late.read_exact(&mut text).await.unwrap();
        let head = String::from_utf8_lossy(&text[..1024]);
        let length = format!("\r\nContent-Length: {MAX_FILE}\r\n");
        assert!(
            head.starts_with("TTP/1.1 200 ") && head.contains(&length),
            "{head}"
        );
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
