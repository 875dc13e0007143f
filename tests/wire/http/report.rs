//! The report's folder: the files served from it, and that no path leads out of it.

use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
#[cfg(unix)]
use std::process::Command;
use std::time::{Duration, Instant};

use crate::common::Runtime;
use crate::folder::Folder;
use crate::web_client::get;
use pendularm::web::report::{FILES, MAX_FILE};

#[test]
fn the_report_is_served_from_its_folder_with_a_policy_of_its_own() {
    let folder = Folder::new("report");
    fs::write(folder.join("index.html"), "<h1>report</h1>").unwrap();
    fs::create_dir(folder.join("data")).unwrap();
    fs::write(folder.join("data/error.csv"), "h,e\n").unwrap();
    fs::write(folder.join("data/index.html"), "<h1>data</h1>").unwrap();
    fs::write(folder.join("figure.svg"), "<svg/>").unwrap();
    let runtime = Runtime::with(&["--report", folder.to_str().unwrap()]);
    for (path, kind, body) in [
        ("/report/", "text/html", "<h1>report</h1>"),
        ("/report/index.html", "text/html", "<h1>report</h1>"),
        ("/report/data/error.csv?x=1", "text/csv", "h,e\n"),
        ("/report/data/", "text/html", "<h1>data</h1>"),
        ("/report/figure.svg", "image/svg+xml", "<svg/>"),
        ("/report/%66igure.svg", "image/svg+xml", "<svg/>"),
    ] {
        let file = get(runtime.address, path);
        assert_eq!((file.status, file.text()), (200, body), "{path}");
        assert!(file.header("content-type").unwrap().starts_with(kind));
        let policy = file.header("content-security-policy").unwrap();
        assert!(
            policy.contains("default-src 'none'") && policy.contains("style-src 'unsafe-inline'")
        );
        assert!(!policy.contains("script-src") && !policy.contains("connect-src"));
    }
    let long = fs::File::create(folder.join("long.csv")).unwrap();
    long.set_len(MAX_FILE + 1).unwrap();
    let long = get(runtime.address, "/report/long.csv");
    assert_eq!(long.status, 503);
    assert!(long.text().contains("longer than 4194304 bytes"));
    let moved = get(runtime.address, "/report");
    assert_eq!(
        (moved.status, moved.header("location")),
        (301, Some("/report/"))
    );
}

#[test]
fn readers_of_the_report_that_read_nothing_do_not_delay_the_page() {
    let folder = Folder::new("unread");
    fs::write(folder.join("index.html"), "<h1>report</h1>").unwrap();
    let long = fs::File::create(folder.join("long.csv")).unwrap();
    long.set_len(MAX_FILE).unwrap();
    let runtime = Runtime::with(&["--report", folder.to_str().unwrap()]);
    let link = "href=\"report/\" hidden";
    assert!(!get(runtime.address, "/").text().contains(link));
    let readers: Vec<TcpStream> = (0..2 * FILES)
        .map(|_| {
            let mut stream = TcpStream::connect(runtime.address).unwrap();
            let request = format!(
                "GET /report/long.csv HTTP/1.1\r\nHost: {}\r\n\r\n",
                runtime.address
            );
            stream.write_all(request.as_bytes()).unwrap();
            stream
        })
        .collect();
    let mut begin = [0; 12];
    readers
        .iter()
        .take(1)
        .for_each(|mut first| first.read_exact(&mut begin).unwrap());
    assert_eq!(&begin, b"HTTP/1.1 200");
    // Without a free permit the page has no link to the report.
    let deadline = Instant::now() + Duration::from_secs(10);
    loop {
        let began = Instant::now();
        let page = get(runtime.address, "/");
        assert!(page.status == 200 && began.elapsed() < Duration::from_secs(5));
        if page.text().contains(link) {
            break;
        }
        assert!(began < deadline, "all permits are taken");
    }
}

/// Paths below `/report/` that lead to no file of the report.
const PATHS: [&str; 22] = [
    "../secret.txt",
    "%2e%2e/secret.txt",
    "..%2fsecret.txt",
    "..%5csecret.txt",
    "/secret.txt",
    "link.txt",
    "up/secret.txt",
    ".hidden.txt",
    "program.exe",
    "program.SVG",
    "a%20program.svg",
    "program.js",
    "program",
    "1/2/3/4/5/6/7/8/9.svg",
    "folder.txt",
    "missing.txt",
    "%00.txt",
    "",
    "%252e%252e/secret.txt",
    "secret.txt%00.svg",
    "loop.txt",
    "pipe.txt",
];

#[test]
fn no_path_leads_out_of_the_reports_folder() {
    let outside = Folder::new("outside");
    let inside = outside.join("inside");
    fs::create_dir(&inside).unwrap();
    fs::write(outside.join("secret.txt"), "secret\n").unwrap();
    fs::write(inside.join(".hidden.txt"), "secret\n").unwrap();
    fs::write(inside.join("program.exe"), "secret\n").unwrap();
    for name in ["program.SVG", "a program.svg", "program.js", "program"] {
        fs::write(inside.join(name), "secret\n").unwrap();
    }
    let deep = inside.join("1/2/3/4/5/6/7/8");
    fs::create_dir_all(&deep).unwrap();
    fs::write(deep.join("9.svg"), "secret\n").unwrap();
    fs::create_dir(inside.join("folder.txt")).unwrap();
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(outside.join("secret.txt"), inside.join("link.txt")).unwrap();
        std::os::unix::fs::symlink(&*outside, inside.join("up")).unwrap();
        std::os::unix::fs::symlink("loop.txt", inside.join("loop.txt")).unwrap();
        // Its reader would wait for a writer.
        let mut made = Command::new("mkfifo");
        assert!(
            made.arg(inside.join("pipe.txt"))
                .status()
                .unwrap()
                .success()
        );
    }
    let absolute = outside.join("secret.txt").to_str().unwrap().to_owned();
    let runtime = Runtime::with(&["--report", inside.to_str().unwrap()]);
    let more = [
        absolute.clone(),
        absolute.replace('/', "%2f"),
        "../".repeat(9),
        "a/".repeat(2000),
        "a".repeat(5000),
    ];
    for rest in PATHS.iter().copied().chain(more.iter().map(String::as_str)) {
        let answer = get(runtime.address, &format!("/report/{rest}"));
        assert_eq!(answer.status, 404, "{rest}");
        assert!(answer.text().contains("--report"), "{}", answer.text());
        assert!(!answer.text().contains("secret\n"));
    }
    for path in [
        "/../secret.txt",
        "/report/../../secret.txt",
        "/report%2f..%2fsecret.txt",
        "//etc/passwd",
    ] {
        assert_eq!(get(runtime.address, path).status, 404, "{path}");
    }
}
