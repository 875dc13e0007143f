//! Messages between many clients: pendularm beside redis (pub/sub) and mosquitto, the same messages in the same run.
//!
//! `load ports` prints three free ports of loopback. `load PATH/TO/pendularm SERVER=ADDRESS=PID ... [--quick] [--scene=PART]`
//! starts pendularm and measures it beside servers that run already, for `benches/load/run.sh`. Round after round every scene
//! is played to each server in turn, by the same client on one thread. The processor time of the server for a delivery
//! is compared: it depends little on other work of the machine. Fails if a message is lost, comes twice or comes out of
//! order. Linux only: the figures are read from `/proc`.

mod fleet;
mod message;
mod probe;
mod report;

use std::net::{SocketAddr, TcpListener};
use std::time::{Duration, Instant};

use fleet::{ARM_RATE, Fleet, Outcome, Scene, Traffic};
use pendularm_benches::program::{Program, ThreadWork, threads, threads_since};
use pendularm_benches::protocol::Protocol;

/// All publishers that do not flood have the rate of the arm's topics.
const RATE: Traffic = Traffic::Rate(ARM_RATE);

/// The scenes. The last fan-out is that of the arm's own topic.
const SCENES: [Scene; 8] = [
    Scene::new("60 Hz to 1", RATE, 1),
    Scene::new("60 Hz to 10", RATE, 10),
    Scene::new("60 Hz to 100", RATE, 100),
    Scene::new("60 Hz to 250", RATE, 250),
    Scene::new("the arm to 250", Traffic::Arm, 250),
    Scene::new("flood 1 to 1", Traffic::Flood, 1),
    Scene {
        topics: 4,
        ..Scene::new("flood 4 to 4", Traffic::Flood, 1)
    },
    Scene::new("flood 1 to 50", Traffic::Flood, 50),
];

/// Duration and number of rounds.
struct Plan {
    rounds: usize,
    seconds: f64,
    /// Length of a run with probes \[s\].
    probed_seconds: f64,
    bars: bool,
}

/// A program that runs.
#[derive(Clone, Copy)]
struct Server {
    protocol: Protocol,
    address: SocketAddr,
    pid: u32,
}

/// The work of a server's threads without clients, for `seconds`.
pub struct Rest {
    pub threads: Vec<ThreadWork>,
    pub seconds: f64,
}

impl Rest {
    /// Processor time in a second \[ns\].
    pub fn processor(&self) -> f64 {
        self.threads.iter().map(|one| one.processor).sum::<u64>() as f64 / self.seconds
    }
}

/// The work of a server in a scene.
#[derive(Default)]
pub struct Played {
    /// Round by round.
    pub outcomes: Vec<Outcome>,
    /// Processor time in a second without clients, round by round \[ns\].
    pub rests: Vec<f64>,
    /// Times of light requests beside it \[ns\], in rising order.
    pub calls: Vec<u32>,
    /// Simulation time by wall time beside it, the arm's.
    pub clock: Option<f64>,
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.first().is_some_and(|first| first == "ports") {
        return print_free_ports();
    }
    let quick = arguments.iter().any(|argument| argument == "--quick");
    let part = arguments
        .iter()
        .find_map(|argument| argument.strip_prefix("--scene="));
    let mut words = arguments
        .iter()
        .filter(|argument| !argument.starts_with("--"));
    let path = words.next().expect("the path of the pendularm binary");
    // Some places are kept for HTTP.
    let options = ["--bind", "127.0.0.1:0", "--clients", "300", "--log", "warn"];
    let program = Program::start(path, &options).expect("the runtime starts");
    let plan = if quick {
        Plan {
            rounds: 1,
            seconds: 1.0,
            probed_seconds: 2.0,
            bars: false,
        }
    } else {
        Plan {
            rounds: 5,
            seconds: 3.0,
            probed_seconds: 8.0,
            bars: true,
        }
    };
    let ours = (Protocol::Pendularm, program.address, program.pid());
    let servers: Vec<Server> = std::iter::once(ours)
        .chain(words.map(|text| peer(text)))
        .map(|(protocol, address, pid)| Server {
            protocol,
            address,
            pid,
        })
        .collect();
    let resting = rest_in_turn(&servers, &plan);
    report::print_rest(&resting);
    let mut verdicts = Vec::new();
    for scene in SCENES
        .iter()
        .filter(|one| part.is_none_or(|part| one.name.contains(part)))
    {
        let played = play(scene, &servers, &resting, &plan);
        report::print_scene(scene, &played);
        verdicts.push((*scene, played));
    }
    report::print_threads(&resting, &verdicts);
    if plan.bars {
        report::print_bars(&resting, &verdicts);
    } else {
        println!("\nnothing was lost, nothing came out of order; too short a run for bars");
    }
}

fn print_free_ports() {
    let sockets = [(); 3].map(|()| TcpListener::bind("127.0.0.1:0").expect("a free port"));
    for socket in sockets {
        println!("{}", socket.local_addr().expect("bound").port());
    }
}

fn peer(text: &str) -> (Protocol, SocketAddr, u32) {
    let parts: Vec<&str> = text.split('=').collect();
    let [name, address, pid] = parts[..] else {
        panic!("{text} is not SERVER=ADDRESS=PID")
    };
    let protocol = Protocol::ALL.into_iter().find(|one| one.name() == name);
    (
        protocol.expect("a server that we know"),
        address.parse().expect("an address"),
        pid.parse().expect("a process id"),
    )
}

/// Measures a server without clients.
fn rest(pid: u32, seconds: f64) -> Rest {
    let (before, began) = (threads(pid), Instant::now());
    std::thread::sleep(Duration::from_secs_f64(seconds));
    Rest {
        threads: threads_since(pid, &before),
        seconds: began.elapsed().as_secs_f64(),
    }
}

/// Measures each server without clients, in turn for all rounds.
fn rest_in_turn(servers: &[Server], plan: &Plan) -> Vec<(Protocol, Vec<Rest>)> {
    let mut rests: Vec<_> = servers
        .iter()
        .map(|one| (one.protocol, Vec::new()))
        .collect();
    for _ in 0..plan.rounds {
        for (server, (_, rests)) in servers.iter().zip(&mut rests) {
            rests.push(rest(server.pid, plan.seconds));
        }
    }
    rests
}

/// Plays a scene to each server in turn for all rounds, then once more with probes.
fn play(
    scene: &Scene,
    servers: &[Server],
    resting: &[(Protocol, Vec<Rest>)],
    plan: &Plan,
) -> Vec<(Protocol, Played)> {
    let takes_part = |server: &&Server| match server.protocol {
        Protocol::Bare => scene.traffic != Traffic::Flood,
        _ => true,
    };
    let servers: Vec<&Server> = servers.iter().filter(takes_part).collect();
    let mut played: Vec<(Protocol, Played)> = servers
        .iter()
        .map(|server| (server.protocol, Played::default()))
        .collect();
    for round in 0..plan.rounds {
        // Another one begins each round.
        for turn in 0..servers.len() {
            let index = (round + turn) % servers.len();
            let server = servers[index];
            // It changes in minutes by more than few deliveries take, so then it is measured beside them.
            let mut starts = resting.iter().filter(|(one, _)| *one == server.protocol);
            let at_start = starts.find_map(|(_, rests)| rests.get(round));
            let at_rest = match at_start {
                Some(at_start) if !scene.is_light() => at_start.processor(),
                _ => rest(server.pid, plan.seconds).processor(),
            };
            played[index].1.rests.push(at_rest);
            let fleet = Fleet::open(server.protocol, server.address, scene.with(server.protocol));
            let outcome = fleet.run(server.pid, plan.seconds);
            played[index].1.outcomes.push(outcome);
        }
    }
    for (server, (protocol, played)) in servers.iter().zip(&mut played) {
        if *protocol != Protocol::Bare {
            probe(scene, server, plan.probed_seconds, played);
        }
    }
    played
}

fn probe(scene: &Scene, server: &Server, seconds: f64, played: &mut Played) {
    let (protocol, address) = (server.protocol, server.address);
    let fleet = Fleet::open(protocol, address, scene.with(protocol));
    let caller = probe::caller(protocol, address);
    let clock = (protocol == Protocol::Pendularm).then(|| probe::clock(address));
    fleet.run(server.pid, seconds);
    played.calls = caller.stop();
    played.calls.sort_unstable();
    played.clock = clock.map(probe::Probe::stop);
}
