//! Service round trip through registry and arm, beside a bare tokio echo server, samples interleaved in one run.
//!
//! `cargo run --release --bin roundtrip -- PATH/TO/pendularm [SAMPLES]`
//!
//! Both servers are processes of their own with default settings; the client is one blocking socket to each. A sample is
//! one request written and one answer read to its newline. The echo server gets the bytes of the runtime's answer, so
//! that both send as much.

use std::io::{BufRead, BufReader, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use pendularm_benches::program::Program;
use tokio::io::{AsyncReadExt, AsyncWriteExt};

const REQUEST: &[u8] =
    b"{\"op\":\"call_service\",\"id\":\"1\",\"service\":\"/arm_sim/set_params\",\"args\":{}}\n";

/// A server, and a connection to it.
struct Server {
    _program: Program,
    stream: TcpStream,
    answers: BufReader<TcpStream>,
}

impl Server {
    fn start(path: &str, arguments: &[&str]) -> Self {
        let program = Program::start(path, arguments).expect("the server starts");
        let stream = TcpStream::connect(program.address).expect("the server accepts");
        stream.set_nodelay(true).expect("nodelay");
        let answers = BufReader::new(stream.try_clone().expect("clone"));
        Self {
            _program: program,
            stream,
            answers,
        }
    }

    fn exchange(&mut self, request: &[u8], answer: &mut Vec<u8>) -> Duration {
        answer.clear();
        let began = Instant::now();
        self.stream.write_all(request).expect("sent");
        self.answers.read_until(b'\n', answer).expect("answered");
        began.elapsed()
    }
}

/// The bare echo server, as tokio's own documentation would have it: the default runtime, a task per client.
#[tokio::main]
async fn echo() {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0")
        .await
        .expect("bound");
    println!("listening on {}", listener.local_addr().expect("address"));
    loop {
        let (mut stream, _) = listener.accept().await.expect("accepted");
        stream.set_nodelay(true).expect("nodelay");
        tokio::spawn(async move {
            let mut buffer = vec![0; 4096];
            while let Ok(read @ 1..) = stream.read(&mut buffer).await {
                if stream.write_all(&buffer[..read]).await.is_err() {
                    break;
                }
            }
        });
    }
}

fn median(samples: &mut [Duration]) -> Duration {
    samples.sort_unstable();
    samples[samples.len() / 2]
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let program = arguments
        .next()
        .expect("the path of the pendularm binary, or `echo`");
    if program == "echo" {
        return echo();
    }
    let count: usize = arguments
        .next()
        .map_or(20_000, |count| count.parse().expect("a number"));
    let own = std::env::current_exe().expect("own path");
    let mut arm = Server::start(&program, &["--bind", "127.0.0.1:0"]);
    let mut bare = Server::start(&own.to_string_lossy(), &["echo"]);
    let (mut answer, mut echoed) = (Vec::new(), Vec::new());
    for _ in 0..1000 {
        arm.exchange(REQUEST, &mut answer);
        bare.exchange(&answer, &mut echoed);
    }
    let (mut of_arm, mut of_bare) = (Vec::new(), Vec::new());
    for _ in 0..count {
        of_arm.push(arm.exchange(REQUEST, &mut answer));
        of_bare.push(bare.exchange(&answer, &mut echoed));
    }
    let (arm, bare) = (median(&mut of_arm), median(&mut of_bare));
    println!("samples                     {count} each, interleaved");
    println!(
        "call through registry, arm  median {arm:?}, p99 {:?}",
        of_arm[count * 99 / 100]
    );
    println!(
        "bare tokio echo             median {bare:?}, p99 {:?}",
        of_bare[count * 99 / 100]
    );
    println!(
        "ratio of medians            {:.2}",
        arm.as_secs_f64() / bare.as_secs_f64()
    );
}
