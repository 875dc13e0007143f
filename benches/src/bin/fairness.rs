//! The cost to everybody else of a client that computes heavily: delays of calls and of `/joint_states`, lateness of the physics.
//!
//! `cargo run --release --bin fairness -- PATH/TO/pendularm [SECONDS]`
//!
//! The runtime with default settings, in three phases of the same length. First it is alone. Then a thread of this
//! program spins beside it, as on a machine with one core less. Then a client always has two `integration_step`
//! requests of a million steps under way and throws the answers away. In each, a second client calls a small service
//! every 2 ms, a third watches `/joint_states`, a fourth `/diagnostics`.
//!
//! Delay of a joint state: how much later than the punctual it came, that is its arrival less its stamp, less the smallest such difference
//! of the phase. The stamp is simulation time, so it holds what physics and delivery lost together.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use pendularm_benches::program::Program;

/// Between two calls of the second client.
const PACE: Duration = Duration::from_millis(2);
/// Longest acceptable delay \[ms\] beside a heavy computation.
const BOUND: f64 = 5.0;
const CALL: &[u8] =
    b"{\"op\":\"call_service\",\"id\":\"1\",\"service\":\"/arm_sim/set_params\",\"args\":{}}\n";
const HEAVY: &[u8] = b"{\"op\":\"call_service\",\"id\":\"heavy\",\"service\":\"/arm_sim/integration_step\",\"args\":\
    {\"function\":\"sin(3*t)*exp(-t/100)-0.1*sqrt(abs(t))\",\"x0\":0,\"xdot0\":1,\"dt\":0.0001,\"steps\":1000000,\
    \"integrator\":\"rk4\"}}\n";

fn connect(runtime: &Program, first: &[u8]) -> TcpStream {
    let mut stream = TcpStream::connect(runtime.address).expect("the runtime accepts");
    stream.set_nodelay(true).expect("nodelay");
    stream.write_all(first).expect("sent");
    stream
}

/// The load beside the clients that watch.
#[derive(Clone, Copy)]
enum Beside {
    Nothing,
    SpinningThread,
    Computation,
}

/// Delays that the others saw in one phase \[ms\].
#[derive(Default)]
struct Phase {
    calls: Vec<f64>,
    states: Vec<f64>,
    gaps: Vec<f64>,
    step_time: f64,
    real_time: f64,
    computed: u64,
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let program = arguments.next().expect("the path of the pendularm binary");
    let seconds: u64 = arguments
        .next()
        .map_or(15, |seconds| seconds.parse().expect("a number"));
    let phase = |beside| watch(&program, Duration::from_secs(seconds), beside);
    let mut phases = [Beside::Nothing, Beside::SpinningThread, Beside::Computation].map(phase);
    println!(
        "{seconds} s each; {} requests of a million steps answered",
        phases[2].computed
    );
    println!(
        "{:28}{:>26}{:>26}{:>26}",
        "ms", "alone", "a core spins", "a client computes"
    );
    println!(
        "{:28}{}",
        "",
        "     p50     p99     max  ".repeat(3).trim_end()
    );
    show("call, every 2 ms", &mut phases, |phase| &mut phase.calls);
    show("/joint_states, delay", &mut phases, |phase| {
        &mut phase.states
    });
    show("/joint_states, gap (16.7)", &mut phases, |phase| {
        &mut phase.gaps
    });
    let line = |what: &str, of: fn(&Phase) -> f64| {
        let cells = phases
            .each_ref()
            .map(|phase| format!("{:24.4}  ", of(phase)));
        println!("{what:28}{}", cells.concat().trim_end());
    };
    line("longest step, /diagnostics", |phase| phase.step_time * 1e3);
    line("least real-time factor", |phase| phase.real_time);
    let [_, _, beside] = phases;
    for (what, mut delays) in [("calls", beside.calls), ("joint states", beside.states)] {
        let late = delays.iter().filter(|delay| **delay > BOUND).count();
        let worst = quantile(&mut delays, 1.0);
        println!(
            "a client computes: {what} later than {BOUND} ms: {late} of {}, worst {worst:.2} ms",
            delays.len()
        );
    }
}

fn quantile(samples: &mut [f64], part: f64) -> f64 {
    samples.sort_unstable_by(f64::total_cmp);
    let last = samples.len().saturating_sub(1);
    samples
        .get((last as f64 * part) as usize)
        .copied()
        .unwrap_or(f64::NAN)
}

fn show(what: &str, phases: &mut [Phase], samples: fn(&mut Phase) -> &mut Vec<f64>) {
    let mut line = format!("{what:28}");
    for phase in phases {
        let samples = samples(phase);
        let [half, most, all] = [0.5, 0.99, 1.0].map(|part| quantile(samples, part));
        line += &format!("{half:8.3}{most:8.3}{all:8.3}  ");
    }
    println!("{}", line.trim_end());
}

fn watch(program: &str, length: Duration, beside: Beside) -> Phase {
    let runtime = Program::start(program, &["--bind", "127.0.0.1:0", "--log", "off"])
        .expect("the runtime starts");
    let over = AtomicBool::new(false);
    let computed = AtomicU64::new(0);
    let mut phase = Phase::default();
    std::thread::scope(|scope| {
        match beside {
            Beside::Nothing => {}
            Beside::SpinningThread => {
                scope.spawn(|| {
                    while !over.load(Ordering::Relaxed) {
                        std::hint::spin_loop();
                    }
                });
            }
            Beside::Computation => {
                let stream = connect(&runtime, HEAVY);
                scope.spawn(|| compute(stream, &over, &computed));
            }
        }
        // Past the start, and in the midst of a computation.
        std::thread::sleep(Duration::from_secs(1));
        let states = connect(
            &runtime,
            b"{\"op\":\"subscribe\",\"topic\":\"/joint_states\"}\n",
        );
        let states = scope.spawn(|| joint_states(states, &over));
        let health = connect(
            &runtime,
            b"{\"op\":\"subscribe\",\"topic\":\"/diagnostics\"}\n",
        );
        let health = scope.spawn(|| diagnostics(health, &over));
        phase.calls = calls(connect(&runtime, b""), length);
        over.store(true, Ordering::Relaxed);
        (phase.states, phase.gaps) = states.join().expect("the watcher lives");
        (phase.step_time, phase.real_time) = health.join().expect("the watcher lives");
    });
    phase.computed = computed.into_inner();
    phase
}

/// Keeps two requests waiting until it is over, and throws away what comes.
fn compute(mut stream: TcpStream, over: &AtomicBool, computed: &AtomicU64) {
    stream
        .set_read_timeout(Some(Duration::from_millis(100)))
        .expect("timeout");
    stream.write_all(HEAVY).expect("sent");
    let mut buffer = vec![0; 1 << 18];
    while !over.load(Ordering::Relaxed) {
        let Ok(read) = stream.read(&mut buffer) else {
            continue;
        };
        let answers = buffer[..read].iter().filter(|byte| **byte == b'\n').count();
        for _ in 0..answers {
            computed.fetch_add(1, Ordering::Relaxed);
            stream.write_all(HEAVY).expect("sent");
        }
    }
}

/// Round trips of a small call \[ms\].
fn calls(mut stream: TcpStream, length: Duration) -> Vec<f64> {
    let mut answers = BufReader::new(stream.try_clone().expect("clone"));
    let (mut answer, mut delays) = (Vec::new(), Vec::new());
    let begun = Instant::now();
    while begun.elapsed() < length {
        answer.clear();
        let sent = Instant::now();
        stream.write_all(CALL).expect("sent");
        answers.read_until(b'\n', &mut answer).expect("answered");
        delays.push(sent.elapsed().as_secs_f64() * 1e3);
        std::thread::sleep(PACE);
    }
    delays
}

/// Lines with the time at which they came, until it is over. The first is the answer to the subscription.
fn lines(stream: TcpStream, over: &AtomicBool) -> Vec<(f64, String)> {
    let begun = Instant::now();
    let lines = BufReader::new(stream).lines().map_while(Result::ok);
    lines
        .map(|line| (begun.elapsed().as_secs_f64(), line))
        .take_while(|_| !over.load(Ordering::Relaxed))
        .collect()
}

/// Delays of joint states, and gaps between their arrivals \[ms\].
fn joint_states(stream: TcpStream, over: &AtomicBool) -> (Vec<f64>, Vec<f64>) {
    let stamped: Vec<(f64, f64)> = lines(stream, over)
        .iter()
        .filter_map(|(came, line)| {
            let stamp = number(line, "\"sec\":")? + 1e-9 * number(line, "\"nanosec\":")?;
            Some((*came, stamp))
        })
        .collect();
    let behind: Vec<f64> = stamped.iter().map(|(came, stamp)| came - stamp).collect();
    let punctual = behind.iter().copied().fold(f64::INFINITY, f64::min);
    let delays = behind
        .iter()
        .map(|behind| (behind - punctual) * 1e3)
        .collect();
    let gaps = stamped
        .windows(2)
        .map(|pair| (pair[1].0 - pair[0].0) * 1e3)
        .collect();
    (delays, gaps)
}

/// Longest step \[s\] and least real-time factor that were reported.
fn diagnostics(stream: TcpStream, over: &AtomicBool) -> (f64, f64) {
    let lines = lines(stream, over);
    let values = |key: &str| -> Vec<f64> {
        let key = format!("\"{key}\",\"value\":\"");
        lines
            .iter()
            .filter_map(|(_, line)| number(line, &key))
            .collect()
    };
    let longest = values("max_step_time").into_iter().fold(0.0, f64::max);
    // The first message covers less than its second.
    let least = values("real_time_factor")
        .into_iter()
        .skip(1)
        .fold(f64::INFINITY, f64::min);
    (longest, least)
}

/// The number that follows `key`.
fn number(line: &str, key: &str) -> Option<f64> {
    let rest = &line[line.find(key)? + key.len()..];
    let end = rest.find(|c: char| !(c.is_ascii_alphanumeric() || ".+-".contains(c)))?;
    rest[..end].parse().ok()
}
