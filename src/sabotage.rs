//! `pendularm sabotage`: an arm with one planted fault, to be found by experiment.
//!
//! A proxy changes the frames between clients and a right server, which is this program, at a free port. The faults are
//! those of the self-test of the rules.
//!
//! **Invariant:** the server ends with this process, also after a signal.

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;

use clap::Args;
use pendularm_conformance::rules;
use pendularm_conformance::sabotage::faults::{self, Planted};
use pendularm_conformance::sabotage::proxy::Proxy;

use crate::output::{self, print_error};
use crate::signals;

/// Exit status if the arm could not be served.
const FAILED: u8 = 1;
/// Exit status for bad usage.
const BAD_USAGE: u8 = 2;
/// Where the arm is served by default.
const ADDRESS: &str = "127.0.0.1:9095";

/// Serve the arm with one planted fault, as an exercise
#[derive(Debug, Clone, PartialEq, Eq, Args)]
#[command(after_help = "\
Examples:
  pendularm sabotage                     a fault by chance, at 127.0.0.1:9095
  pendularm sabotage --seed 20260117     the same fault for the same number, such as a student's
  pendularm sabotage 17 127.0.0.1:9100   fault 17
  pendularm sabotage --list              all faults

ARM_SIM_LINKS=3 serves an arm of 3 links. Clients connect by TCP and end each frame with a newline.")]
pub struct SabotageOptions {
    /// The number of the fault, and where to listen
    #[arg(value_name = "N|ADDRESS", num_args = 0..=2)]
    named: Vec<String>,
    /// List the faults with their numbers, and serve nothing
    #[arg(long)]
    list: bool,
    /// Choose the fault by a whole number, always the same one
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Print the fault
    #[arg(long)]
    reveal: bool,
}

/// Serves the arm until a signal, and returns the exit status.
#[must_use]
pub fn run(options: &SabotageOptions) -> u8 {
    let all = faults::all();
    if options.list {
        for (number, planted) in (1..).zip(&all) {
            let told = output::print(&format!("{number:>3}  {}\n", told(planted)));
            if told.is_err() {
                break;
            }
        }
        return 0;
    }
    let links = if std::env::var("ARM_SIM_LINKS").is_ok_and(|links| links == "3") {
        3
    } else {
        2
    };
    let (number, address) = match chosen(options, &all, links) {
        Ok(chosen) => chosen,
        Err(why) => {
            print_error(&why);
            return BAD_USAGE;
        }
    };
    let Some(planted) = all.get(number - 1) else {
        return BAD_USAGE;
    };
    match serve(planted, links, &address, options.reveal) {
        Ok(()) => 0,
        Err(why) => {
            print_error(&why);
            FAILED
        }
    }
}

fn told(planted: &Planted) -> String {
    format!("{}: the server {}", planted.rule, planted.says)
}

/// The number of the fault and the address.
fn chosen(
    options: &SabotageOptions,
    all: &[Planted],
    links: usize,
) -> Result<(usize, String), String> {
    let (mut number, mut address) = (None, None);
    for text in &options.named {
        let place = if text.contains(':') {
            &mut address
        } else {
            &mut number
        };
        if place.replace(text).is_some() {
            return Err(format!(
                "{text:?} is one too many: usage is sabotage [N] [ADDRESS]"
            ));
        }
    }
    let number = match (number, options.seed) {
        (Some(_), Some(_)) => return Err("the fault has a number or a seed, not both".to_owned()),
        (Some(text), None) => {
            let number = text.parse().ok().filter(|n| (1..=all.len()).contains(n));
            number.ok_or_else(|| {
                let most = all.len();
                format!("N must be a whole number from 1 to {most}, got {text:?}")
            })?
        }
        (None, seed) => {
            let mut chance = seed.map_or_else(fastrand::Rng::new, fastrand::Rng::with_seed);
            // One that an arm with so many links can show.
            let applies = |planted: &&Planted| {
                rules::all().any(|rule| rule.id == planted.rule && rule.applies_to(links))
            };
            let able: Vec<usize> = (1..)
                .zip(all)
                .filter(|(_, planted)| applies(planted))
                .map(|(n, _)| n)
                .collect();
            chance.choice(able).unwrap_or(1)
        }
    };
    Ok((number, address.map_or(ADDRESS, String::as_str).to_owned()))
}

/// A started server, which is ended when this is dropped.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn serve(planted: &Planted, links: usize, address: &str, reveal: bool) -> Result<(), String> {
    let listener = TcpListener::bind(address).map_err(|error| format!("{address}: {error}"))?;
    let program = std::env::current_exe().map_err(|error| error.to_string())?;
    let child = Command::new(program)
        // Its log would name the address without the fault.
        .args(["--bind", "127.0.0.1:0", "--log", "error"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn();
    let mut server = Server(child.map_err(|error| error.to_string())?);
    let (ask, ended) = mpsc::channel();
    let asked = ask.clone();
    signals::at_request(move || drop(asked.send(Ok(())))).map_err(|error| error.to_string())?;
    let mut said = BufReader::new(server.0.stdout.take().ok_or("the server has no output")?);
    let mut line = String::new();
    let at = loop {
        line.clear();
        let length = said
            .read_line(&mut line)
            .map_err(|error| error.to_string())?;
        if length == 0 {
            return Err("the server did not start".to_owned());
        }
        if let Some(at) = line.strip_prefix("listening on ") {
            break at.split_whitespace().next().unwrap_or_default().to_owned();
        }
    };
    let proxy = Proxy::listen(listener, &at, planted.fault(links));
    let proxy = proxy.map_err(|error| format!("{address}: {error}"))?;
    let mut text = format!("listening on {}: an arm with one fault\n", proxy.address);
    if reveal {
        text += &format!("{}\n", told(planted));
    }
    output::print(&text).map_err(|error| format!("standard output: {error}"))?;
    // The server says no more, so its output ends with it.
    std::thread::spawn(move || {
        let _ = std::io::copy(&mut said, &mut std::io::sink());
        let _ = ask.send(Err("the server has ended".to_owned()));
    });
    ended.recv().unwrap_or(Ok(()))
}
