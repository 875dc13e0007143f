//! The figures in words: a table for each scene, and the bars at the end.
//!
//! **Invariant:** medians of the rounds are compared, with the better peer.

use crate::fleet::{Scene, Traffic};
use crate::message::Template;
use crate::{Played, Server};
use pendularm_benches::protocol::Protocol;

/// Largest drift of simulation time by wall time from 1.
const MOST_DRIFT: f64 = 0.001;
/// For 99 of 100 calls \[ms\].
const MOST_DELAY: f64 = 5.0;

pub fn print_rest(servers: &[Server]) {
    println!(
        "a message: {} bytes of JSON, made by the same client for all",
        Template::new().length()
    );
    let part = |one: &Server| format!("{} {:.2} %", one.protocol.name(), one.rest / 1e7);
    println!(
        "of one core without clients: {}",
        servers.iter().map(part).collect::<Vec<_>>().join(", ")
    );
}

pub fn print_scene(scene: &Scene, played: &[(Protocol, Played)]) {
    println!("\n=== {}", scene.name);
    println!(
        "{:<10} {:>12} {:>22} {:>9} {:>9} {:>9} {:>9} {:>8}",
        "",
        "deliveries/s",
        "CPU/delivery, us",
        "less rest",
        "p50, ms",
        "p99, ms",
        "p99.9, ms",
        "RSS, MB"
    );
    for (protocol, played) in played {
        let mut costs = costs(played);
        costs.sort_unstable_by(f64::total_cmp);
        let mut latencies: Vec<u32> = played
            .outcomes
            .iter()
            .flat_map(|one| &one.latencies)
            .copied()
            .collect();
        latencies.sort_unstable();
        let part = |part: f64| {
            quantile(&latencies, part).map_or("-".to_owned(), |time| format!("{time:.3}"))
        };
        let rate = median(
            played
                .outcomes
                .iter()
                .map(|one| one.deliveries as f64 / one.seconds)
                .collect(),
        );
        let resident = played.outcomes.last().map_or(0.0, |one| one.resident);
        println!(
            "{:<10} {rate:>12.0} {:>22} {:>9.2} {:>9} {:>9} {:>9} {resident:>8.1}",
            protocol.name(),
            format!(
                "{:.2} ({:.2} to {:.2})",
                median(costs.clone()),
                costs[0],
                costs[costs.len() - 1]
            ),
            net(played),
            part(0.5),
            part(0.99),
            part(0.999),
        );
    }
    for (protocol, played) in played.iter().filter(|(_, played)| !played.calls.is_empty()) {
        let [p50, p99] = [0.5, 0.99].map(|part| quantile(&played.calls, part).unwrap_or_default());
        let clock = played.clock.map_or(String::new(), |clock| {
            format!("; simulation / wall time {clock:.5}")
        });
        println!(
            "{:<10} a light request beside it: p50 {p50:.2} ms, p99 {p99:.2} ms{clock}",
            protocol.name()
        );
    }
}

pub fn print_bars(scenes: &[(Scene, Vec<(Protocol, Played)>)]) {
    println!("\n=== summary");
    // The arm's own topic has no peers. It is compared with the same fan-out between clients.
    let peers_of = |scene: &Scene| {
        let name = if scene.traffic == Traffic::Arm {
            "60 Hz to 250"
        } else {
            scene.name
        };
        scenes
            .iter()
            .find(|(other, _)| other.name == name)
            .map(|(_, played)| played)
    };
    for (scene, played) in scenes {
        let Some((_, ours)) = played
            .iter()
            .find(|(protocol, _)| *protocol == Protocol::Pendularm)
        else {
            continue;
        };
        let peers: Vec<_> = peers_of(scene)
            .into_iter()
            .flatten()
            .filter(|(protocol, _)| matches!(protocol, Protocol::Redis | Protocol::Mosquitto))
            .collect();
        if !peers.is_empty() {
            let to_best = |one: &Played, cost: fn(&Played) -> f64| {
                let costs = peers.iter().map(|(_, peer)| cost(peer));
                cost(one) / costs.fold(f64::INFINITY, f64::min)
            };
            let ratios = |one: &Played| (to_best(one, |one| median(costs(one))), to_best(one, net));
            let (ratio, net) = ratios(ours);
            let what = format!(
                "{}: CPU per delivery / better peer (less rest {net:.2})",
                scene.name
            );
            let (most, less_rest) = most_of_peer(scene);
            let of = if less_rest { " less rest" } else { "" };
            verdict(
                &what,
                format!("{ratio:.2}"),
                &format!("at most {most:.1}{of}"),
                (if less_rest { net } else { ratio }) < most + 0.005,
            );
            if let Some((_, bare)) = played.iter().find(|(one, _)| *one == Protocol::Bare) {
                let (ratio, net) = ratios(bare);
                println!("    bare actors beside it (less rest {net:.2}) {ratio:>39.2}");
            }
        }
        if let Some(clock) = ours.clock {
            let what = format!("{}: simulation time / wall time", scene.name);
            verdict(
                &what,
                format!("{clock:.5}"),
                "within 0.001 of 1",
                (clock - 1.0).abs() <= MOST_DRIFT,
            );
        }
        if !ours.calls.is_empty() {
            let p99 = quantile(&ours.calls, 0.99).unwrap_or_default();
            verdict(
                &format!("{}: call beside it, p99, ms", scene.name),
                format!("{p99:.2}"),
                "under 5",
                p99 < MOST_DELAY,
            );
        }
    }
}

/// Largest processor time for a delivery, as a share of the better peer's, and whether the time at rest is left out of
/// it. With few subscribers that is most of the figure, and ours simulates an arm meanwhile.
const fn most_of_peer(scene: &Scene) -> (f64, bool) {
    match scene.traffic {
        Traffic::Flood => (1.0, false),
        _ if scene.is_light() => (1.5, true),
        _ => (1.1, false),
    }
}

fn verdict(what: &str, figure: String, bar: &str, held: bool) {
    println!(
        "{what:<72} {figure:>9}   {bar:<21} {}",
        if held { "held" } else { "MISSED" }
    );
}

/// Processor time of a delivery, round by round \[us\].
fn costs(played: &Played) -> Vec<f64> {
    played
        .outcomes
        .iter()
        .map(|one| one.processor as f64 / one.deliveries.max(1) as f64 / 1e3)
        .collect()
}

/// The same as a median, without the server's time at rest.
fn net(played: &Played) -> f64 {
    let rounds = played.outcomes.iter().zip(&played.rests);
    let net = rounds.map(|(one, rest)| {
        (one.processor as f64 - rest * one.seconds) / one.deliveries.max(1) as f64 / 1e3
    });
    median(net.collect())
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// A quantile of sorted times \[ms\].
fn quantile(sorted: &[u32], part: f64) -> Option<f64> {
    let index = (sorted.len() as f64 * part) as usize;
    sorted
        .get(index.min(sorted.len().saturating_sub(1)))
        .map(|&time| f64::from(time) / 1e6)
}
