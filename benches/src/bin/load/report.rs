//! The figures in words: a table for each scene, and the bars at the end.
//!
//! **Invariant:** medians of the rounds are compared.

use crate::fleet::{Scene, Traffic};
use crate::message::Template;
use crate::{Played, Rest};
use pendularm_benches::program::ThreadWork;
use pendularm_benches::protocol::Protocol;

/// Largest drift of simulation time by wall time from 1.
const MOST_DRIFT: f64 = 0.001;
/// For 99 of 100 calls \[ms\].
const MOST_DELAY: f64 = 5.0;
/// Without clients \[% of a core\].
const MOST_AT_REST: f64 = 0.15;
/// Without clients, in a second.
const MOST_WAKE_UPS: f64 = 25.0;

pub fn print_rest(resting: &[(Protocol, Vec<Rest>)]) {
    println!(
        "a message: {} bytes of JSON, made by the same client for all",
        Template::new().length()
    );
    for (protocol, rests) in resting {
        let [percent, wake_ups] = at_rest(rests);
        let name = protocol.name();
        println!("{name:<10} without clients: {percent:.2} % of a core, {wake_ups:.0} wake-ups/s");
    }
}

/// Part of a core \[%\], and wake-ups in a second: medians of the rounds.
fn at_rest(rests: &[Rest]) -> [f64; 2] {
    let wake_ups = |rest: &Rest| {
        let all = rest.threads.iter().map(|thread| thread.wake_ups);
        all.sum::<u64>() as f64 / rest.seconds
    };
    [
        median(rests.iter().map(|rest| rest.processor() / 1e7).collect()),
        median(rests.iter().map(wake_ups).collect()),
    ]
}

/// The work of each thread in a second of the scenes with a rate: means of the rounds. Threads that do nothing are left out.
pub fn print_threads(
    resting: &[(Protocol, Vec<Rest>)],
    scenes: &[(Scene, Vec<(Protocol, Played)>)],
) {
    println!("\n=== threads, in a second");
    println!(
        "{:<18} {:<10} {:<18} {:>10} {:>10} {:>12}",
        "", "", "thread", "CPU, ms", "wake-ups", "preemptions"
    );
    for (protocol, rests) in resting {
        let rounds = rests.iter().map(|rest| (&rest.threads[..], rest.seconds));
        print_work("without clients", *protocol, rounds);
    }
    let with_rate = scenes
        .iter()
        .filter(|(scene, _)| scene.traffic != Traffic::Flood);
    for (scene, played) in with_rate {
        for (protocol, played) in played {
            let rounds = played.outcomes.iter();
            let rounds = rounds.map(|one| (&one.threads[..], one.seconds));
            print_work(scene.name, *protocol, rounds);
        }
    }
}

fn print_work<'a>(
    scene: &str,
    protocol: Protocol,
    rounds: impl Iterator<Item = (&'a [ThreadWork], f64)>,
) {
    let mut all: Vec<ThreadWork> = Vec::new();
    let mut seconds = 0.0;
    for (threads, measured) in rounds {
        seconds += measured;
        for thread in threads {
            match all.iter_mut().find(|one| one.id == thread.id) {
                Some(one) => {
                    one.processor += thread.processor;
                    one.wake_ups += thread.wake_ups;
                    one.preemptions += thread.preemptions;
                }
                None => all.push(thread.clone()),
            }
        }
    }
    for thread in all.iter().filter(|one| one.wake_ups > 0) {
        println!(
            "{scene:<18} {:<10} {:<18} {:>10.2} {:>10.1} {:>12.1}",
            protocol.name(),
            thread.name,
            thread.processor as f64 / 1e6 / seconds,
            thread.wake_ups as f64 / seconds,
            thread.preemptions as f64 / seconds,
        );
    }
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

pub fn print_bars(resting: &[(Protocol, Vec<Rest>)], scenes: &[(Scene, Vec<(Protocol, Played)>)]) {
    println!("\n=== summary");
    for (protocol, rests) in resting {
        if *protocol == Protocol::Pendularm {
            let [percent, wake_ups] = at_rest(rests);
            let what = "without clients: % of a core";
            verdict(
                what,
                percent,
                &format!("at most {MOST_AT_REST}"),
                percent <= MOST_AT_REST,
            );
            let what = "without clients: wake-ups/s";
            let bar = format!("at most {MOST_WAKE_UPS}");
            verdict(what, wake_ups, &bar, wake_ups <= MOST_WAKE_UPS);
        }
    }
    for (scene, played) in scenes {
        let find = |wanted| {
            played
                .iter()
                .find_map(|(protocol, played)| (*protocol == wanted).then_some(played))
        };
        let Some(ours) = find(Protocol::Pendularm) else {
            continue;
        };
        let (reference, most) = bar(scene);
        for protocol in [Protocol::Bare, Protocol::Redis, Protocol::Mosquitto] {
            let Some(peer) = find(protocol) else {
                continue;
            };
            let ratio = median(costs(ours)) / median(costs(peer));
            let net = net(ours) / net(peer);
            let name = protocol.name();
            let what = format!(
                "{}: CPU per delivery / {name} (less rest {net:.2})",
                scene.name
            );
            if protocol != reference {
                println!("{what:<72} {ratio:>9.3}");
            } else if scene.is_light() {
                verdict(
                    &what,
                    ratio,
                    &format!("at most {most} less rest"),
                    net <= most,
                );
            } else {
                verdict(&what, ratio, &format!("at most {most}"), ratio <= most);
            }
        }
        if let Some(clock) = ours.clock {
            let what = format!("{}: simulation time / wall time", scene.name);
            let is_close = (clock - 1.0).abs() <= MOST_DRIFT;
            verdict(&what, clock, "within 0.001 of 1", is_close);
        }
        if !ours.calls.is_empty() {
            let p99 = quantile(&ours.calls, 0.99).unwrap_or_default();
            let what = format!("{}: call beside it, p99, ms", scene.name);
            verdict(&what, p99, "under 5", p99 < MOST_DELAY);
        }
    }
}

/// The program whose processor time for a delivery is compared, and the largest ratio to it. With few subscribers the
/// time at rest is left out: it is most of the figure, and ours simulates an arm meanwhile.
const fn bar(scene: &Scene) -> (Protocol, f64) {
    match scene.traffic {
        Traffic::Flood => (Protocol::Redis, 1.0),
        Traffic::Arm => (Protocol::Redis, 1.1),
        Traffic::Rate(_) if scene.is_light() => (Protocol::Bare, 1.5),
        Traffic::Rate(_) => (Protocol::Bare, 1.2),
    }
}

fn verdict(what: &str, figure: f64, bar: &str, held: bool) {
    println!(
        "{what:<72} {figure:>9.3}   {bar:<21} {}",
        if held { "held" } else { "MISSED" }
    );
}

/// Processor time of a delivery, round by round \[us\].
fn costs(played: &Played) -> Vec<f64> {
    played
        .outcomes
        .iter()
        .map(|one| one.processor() as f64 / one.deliveries.max(1) as f64 / 1e3)
        .collect()
}

/// The same as a median, without the server's time at rest.
fn net(played: &Played) -> f64 {
    let rounds = played.outcomes.iter().zip(&played.rests);
    let net = rounds.map(|(one, rest)| {
        (one.processor() as f64 - rest * one.seconds) / one.deliveries.max(1) as f64 / 1e3
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
