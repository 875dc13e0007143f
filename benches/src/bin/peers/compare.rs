//! Results of the programs against each other, then ratios of their times, then the bars.
//!
//! **Invariant:** no ratio is printed unless all results agree.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Two results of one name may differ by this much, relative to the largest number of the result. Mass matrices of these arms
/// have condition numbers up to some hundred, so rounding alone makes some 1e-14; a wrong inertia, sign or stage, 1e-3.
const BOUND: f64 = 1e-13;
/// The end of the swing, where the roundings of a thousand steps add up.
const SWING_BOUND: f64 = 1e-12;

/// The C that Pinocchio generates, by each of its builds.
const GENERATED: [&str; 3] = ["generated plain", "generated native", "generated fast"];
/// Rows in which one arm is to be ahead of it.
const GENERATED_ROWS: [&str; 6] = [
    FORWARD,
    "forward dynamics, chained",
    "euler step",
    "euler step, independent",
    "rk4 step",
    "rk4 step, independent",
];
const FORWARD: &str = "forward dynamics, throughput";

/// Results of one program, by name and number.
type Results = BTreeMap<String, Vec<f64>>;

fn read_results(path: &Path) -> Results {
    let text = fs::read_to_string(path).expect("results can be read");
    let result = |line: &str| {
        let (kind, rest) = line.split_once(' ').expect("a name");
        let (number, rest) = rest.split_once(' ').expect("a number of it");
        let numbers = rest.split(' ').map(|x| x.parse().expect("a number"));
        (format!("{kind} {number}"), numbers.collect())
    };
    text.lines().map(result).collect()
}

/// Largest difference of two results, relative to the largest number of the first. Not a number counts as infinite.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len(), "numbers in a result");
    let largest = a.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs() / largest);
    apart.fold(0.0, |worst, x| {
        if x.is_nan() {
            f64::INFINITY
        } else {
            worst.max(x)
        }
    })
}

/// Compares the results in `folder`, then, if they agree, the times.
pub(crate) fn compare(folder: &Path) {
    let mut agree = true;
    for links in [2, 3] {
        agree &= compare_results(folder, links);
    }
    if !agree {
        eprintln!("peers: the results differ, so the times mean nothing");
        std::process::exit(1);
    }
    compare_times(folder);
}

/// Compares the results of all programs pairwise, and prints the worst of each kind. Returns false if one is out of
/// bounds.
fn compare_results(folder: &Path, links: usize) -> bool {
    let prefix = format!("check-{links}-");
    let mut programs: Vec<(String, Results)> = Vec::new();
    for entry in fs::read_dir(folder).expect("the folder can be read") {
        let path = entry.expect("an entry").path();
        let name = path
            .file_stem()
            .and_then(|name| name.to_str())
            .unwrap_or_default();
        if let Some(system) = name.strip_prefix(&prefix) {
            programs.push((system.to_owned(), read_results(&path)));
        }
    }
    programs.sort_by(|a, b| a.0.cmp(&b.0));
    assert!(programs.len() > 1, "nothing to compare with");
    // Kind of result: the worst difference, and the two programs.
    let mut worst: BTreeMap<&str, (f64, String)> = BTreeMap::new();
    for (i, (a_name, a)) in programs.iter().enumerate() {
        for (b_name, b) in &programs[i + 1..] {
            assert!(
                a.keys().eq(b.keys()),
                "{a_name} and {b_name} were asked different things"
            );
            for (name, numbers) in a {
                let kind = name.split(' ').next().unwrap_or_default();
                let apart = difference(numbers, &b[name]);
                let entry = worst.entry(kind).or_insert((0.0, String::from("all")));
                if apart > entry.0 {
                    *entry = (apart, format!("{a_name}, {b_name}"));
                }
            }
        }
    }
    let mut agree = true;
    let names: Vec<&str> = programs.iter().map(|(name, _)| name.as_str()).collect();
    println!(
        "{links} links: {} programs, each against every other ({})",
        names.len(),
        names.join("; ")
    );
    for (kind, (apart, between)) in worst {
        let bound = if kind == "swing" { SWING_BOUND } else { BOUND };
        agree &= apart <= bound;
        println!(
            "  {kind:8} largest relative difference {apart:.1e} of at most {bound:.0e}  ({between})"
        );
    }
    agree
}

/// Shortest and median time of a row over the passes.
#[derive(Default)]
struct Row {
    shortest: Vec<f64>,
    median: Vec<f64>,
}

impl Row {
    fn least(&self) -> f64 {
        self.shortest.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// The median of the passes' medians.
    fn middle(&self) -> f64 {
        let mut medians = self.median.clone();
        medians.sort_unstable_by(f64::total_cmp);
        medians[medians.len() / 2]
    }
}

/// Times by number of links, kind of work, and system.
type Rows = BTreeMap<(String, String, String), Row>;

/// `system,links,"what",shortest,median` line by line; `what` may hold a comma.
fn read_times(path: &Path) -> Rows {
    let mut rows = Rows::new();
    for line in fs::read_to_string(path)
        .expect("times can be read")
        .lines()
        .skip(1)
    {
        let (head, tail) = line.split_once(",\"").expect("a quoted name");
        let (what, numbers) = tail.split_once("\",").expect("a quoted name");
        let (system, links) = head.split_once(',').expect("a number of links");
        let (shortest, median) = numbers.split_once(',').expect("two times");
        let row = rows
            .entry((links.to_owned(), what.to_owned(), system.to_owned()))
            .or_default();
        row.shortest.push(shortest.parse().expect("a time"));
        row.median.push(median.parse().expect("a time"));
    }
    rows
}

fn compare_times(folder: &Path) {
    let rows = read_times(&folder.join("times.csv"));
    println!(
        "\nns per call: shortest run (median); ratio to pendularm's of the same kind: of the shortest (of the medians)"
    );
    let mut title = String::new();
    for ((links, what, system), row) in &rows {
        // The same kind, or that of which this is a variant ("... in the world frame", "..., live").
        let same = |what: &str| rows.get(&(links.clone(), what.to_owned(), "pendularm".to_owned()));
        let own = same(what).or_else(|| same(&what.replace(" in the world frame", "")));
        let heading = format!("{links} links, {what}");
        if heading != title {
            println!("{heading}");
            title = heading;
        }
        let ratio = own
            .filter(|_| system != "pendularm")
            .map_or(String::new(), |own| {
                format!(
                    "  x {:.2} ({:.2})",
                    row.least() / own.least(),
                    row.middle() / own.middle()
                )
            });
        println!(
            "  {system:24} {:8.1} ({:.1}){ratio}",
            row.least(),
            row.middle()
        );
    }
    println!();
    for links in ["2", "3"] {
        print_targets(&rows, links);
    }
}

/// The bars, and whether they were reached. A peer of several builds is the fastest of them.
fn print_targets(rows: &Rows, links: &str) {
    let least = |system: &str, what: &str| {
        rows.get(&(links.to_owned(), what.to_owned(), system.to_owned()))
            .map(Row::least)
    };
    let bar = |peers: &[&str], what: &str, own: &str, own_what: &str, bar: f64| {
        let peer = peers.iter().filter_map(|peer| least(peer, what));
        let (Some(peer), Some(ours)) = (peer.min_by(f64::total_cmp), least(own, own_what)) else {
            return;
        };
        let ratio = peer / ours;
        let verdict = if ratio >= bar { "reached" } else { "MISSED" };
        println!(
            "target, {links} links: {}, {what} / {own}, {own_what}: {ratio:.2}, at least {bar:.0}: {verdict}",
            peers.join(" or ")
        );
    };
    bar(&["pinocchio wheel"], FORWARD, "pendularm", FORWARD, 10.0);
    bar(&["mujoco"], "rk4 step", "pendularm", "rk4 step", 15.0);
    bar(&["mujoco"], "rk4 step", "pendularm", "rk4 step, live", 15.0);
    for what in GENERATED_ROWS {
        bar(&GENERATED, what, "pendularm", what, 1.0);
    }
    for (own, target) in [("pendularm 4 lanes", 6.0), ("pendularm 8 lanes", 12.0)] {
        bar(&GENERATED, FORWARD, own, FORWARD, target);
    }
}
