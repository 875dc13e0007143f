//! Attacks on the release program, one after the other, and what a healthy client has of each.
//!
//! `attack PATH/TO/pendularm [--quick] [--peers] [--list] [--only=WORD,WORD]`. For every attack the program is started
//! anew on a free port. A healthy client makes a light call every 10 ms and watches `/joint_states`; four times a second
//! a newcomer connects, does a little of everything, and goes. SIGTERM comes in the middle of the attack. With `--peers`
//! redis and mosquitto come under the attacks that apply to them, beside ours. Exit status 1 if a bar is missed. Linux
//! only: memory is read from `/proc`.

mod healthy;
mod newcomer;
mod server;
mod table;
mod target;

use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use pendularm_benches::attack::script::Client;
use pendularm_benches::attack::stage::{Deeds, play};
use pendularm_benches::attack::{Attack, groups, peers};
use pendularm_benches::protocol::Protocol;

use server::{Server, Servers};
use table::{Bars, Row, Verdict};

/// From the healthy client's first call to the attack.
const CALM: Duration = Duration::from_millis(100);

/// How long, how strict, which.
struct Plan {
    attacked: Duration,
    /// Until a call or a newcomer counts as not answered.
    patience: Duration,
    bars: Bars,
    /// How often an attack is played until it is in time.
    tries: usize,
    only: Vec<String>,
}

impl Plan {
    fn of(arguments: &[String]) -> Self {
        let quick = arguments.iter().any(|argument| argument == "--quick");
        let only = arguments
            .iter()
            .find_map(|argument| argument.strip_prefix("--only="));
        let only = only
            .map(|words| words.split(',').map(str::to_owned).collect())
            .unwrap_or_default();
        if quick {
            // A machine that stands still for seconds answers late; a client that is not answered at all waits
            // for ever.
            let patience = Duration::from_secs(20);
            return Self {
                attacked: Duration::from_millis(900),
                patience,
                bars: Bars::QUICK,
                // A second's play is late as a whole where the machine stands still for one of its moments.
                tries: 3,
                only,
            };
        }
        Self {
            attacked: Duration::from_secs(4),
            patience: Duration::from_secs(2),
            bars: Bars::FULL,
            tries: 1,
            only,
        }
    }

    fn picks(&self, name: &str) -> bool {
        self.only.is_empty() || self.only.iter().any(|word| name.contains(word.as_str()))
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let has = |flag: &str| arguments.iter().any(|argument| argument == flag);
    if has("--list") {
        return list();
    }
    let plan = Plan::of(&arguments);
    let Some(program) = arguments.first().filter(|first| !first.starts_with("--")) else {
        eprintln!("attack: which program? attack PATH/TO/pendularm");
        return ExitCode::from(2);
    };
    match run(program, &plan, has("--peers")) {
        Ok(missed) if missed.is_empty() => ExitCode::SUCCESS,
        Ok(missed) => {
            println!(
                "\n{} attacks missed a bar: {}",
                missed.len(),
                missed.join(", ")
            );
            ExitCode::FAILURE
        }
        Err(why) => {
            eprintln!("attack: {why}");
            ExitCode::FAILURE
        }
    }
}

fn list() -> ExitCode {
    for (group, attacks) in groups() {
        println!("{group}");
        for attack in attacks {
            println!("  {:<24} {}", attack.name, attack.what);
        }
    }
    println!("beside redis and mosquitto");
    for attack in peers::ATTACKS {
        println!("  {:<24} {}", attack.name, attack.what);
    }
    ExitCode::SUCCESS
}

/// Plays everything that was picked; the names of what missed a bar.
fn run(program: &str, plan: &Plan, with_peers: bool) -> Result<Vec<String>, String> {
    let servers = Servers::new(program)?;
    let mut missed = Vec::new();
    println!("{}", plan.bars);
    table::print_head();
    let baseline = Attack::new("baseline", "nobody attacks", Vec::new);
    attacked(&servers, &baseline, plan, &mut missed)?;
    for (group, attacks) in groups() {
        let picked: Vec<&Attack> = attacks
            .iter()
            .filter(|attack| plan.picks(attack.name))
            .collect();
        if !picked.is_empty() {
            println!("-- {group}");
        }
        for attack in picked {
            attacked(&servers, attack, plan, &mut missed)?;
        }
    }
    if with_peers {
        beside_peers(&servers, plan, &mut missed)?;
    }
    Ok(missed)
}

fn attacked(
    servers: &Servers,
    attack: &Attack,
    plan: &Plan,
    missed: &mut Vec<String>,
) -> Result<(), String> {
    for left in (0..plan.tries).rev() {
        let server = servers.ours(attack)?;
        let mut row = endure(server, attack.name, &(attack.cast)(), attack.locked, plan)?;
        row.newcomers_welcome = !attack.fills;
        match row.print(&plan.bars) {
            Verdict::Held => break,
            Verdict::Late if left > 0 => println!("     late: once more"),
            Verdict::Late | Verdict::Missed => {
                println!("     {}: {}", attack.name, attack.what);
                missed.push(attack.name.to_owned());
                break;
            }
        }
    }
    Ok(())
}

/// The same attack on each server. Only ours is judged; misses of the others are marked as well.
fn beside_peers(servers: &Servers, plan: &Plan, missed: &mut Vec<String>) -> Result<(), String> {
    println!("-- beside redis and mosquitto, all as they come, nothing written to a disk");
    let calm = peers::Common {
        name: "baseline",
        what: "nobody attacks",
        cast: |_| Vec::new(),
    };
    for attack in std::iter::once(&calm).chain(
        peers::ATTACKS
            .iter()
            .filter(|attack| plan.picks(attack.name)),
    ) {
        println!("     {}: {}", attack.name, attack.what);
        for protocol in Protocol::ALL {
            let server = match protocol {
                Protocol::Pendularm => servers.ours(&Attack::new("", "", Vec::new))?,
                Protocol::Redis | Protocol::Mosquitto => servers.peer(protocol)?,
            };
            let row = endure(
                server,
                protocol.name(),
                &(attack.cast)(protocol),
                false,
                plan,
            )?;
            if row.print(&plan.bars) != Verdict::Held && protocol == Protocol::Pendularm {
                missed.push(attack.name.to_owned());
            }
        }
    }
    Ok(())
}

/// Puts a server under an attack; SIGTERM comes before the attack ends.
fn endure(
    server: Server,
    name: &str,
    cast: &[Client],
    locked: bool,
    plan: &Plan,
) -> Result<Row, String> {
    let Server {
        protocol,
        address,
        program,
    } = server;
    let pid = program.pid();
    let (over, deeds) = (AtomicBool::new(false), Deeds::default());
    let watched = target::Target {
        protocol,
        address,
        locked,
        patience: plan.patience,
    };
    let healthy = healthy::Healthy::start(watched)?;
    let (health, peak, ended) = std::thread::scope(|scope| {
        std::thread::sleep(CALM);
        let attackers =
            scope.spawn(|| play(cast, address, &deeds, || over.load(Ordering::Relaxed)));
        std::thread::sleep(plan.attacked);
        let health = healthy.finish();
        let peak = table::peak(pid);
        let ended = program.end();
        over.store(true, Ordering::Relaxed);
        let _ = attackers.join();
        (health, peak, ended)
    });
    Ok(Row {
        name: name.to_owned(),
        health,
        newcomers_welcome: true,
        peak: peak.unwrap_or(f64::NAN),
        ended: if peak.is_some() {
            ended
        } else {
            Err("it was gone before".to_owned())
        },
        deeds,
        attacked: !cast.is_empty(),
    })
}
