//! Attacks on the release program, one after the other, and the service of a healthy client during each.
//!
//! `attack PATH/TO/pendularm [--quick] [--list] [--only=WORD,WORD]`. For every attack the program is started anew on a
//! free port. A healthy client makes a light call every 10 ms and watches `/joint_states`. Four times a second a new
//! client connects, does a little of everything, and disconnects. SIGTERM is sent in the middle of the attack. Exit
//! status 1 if a bar is missed. Linux only: memory is read from `/proc`.

mod table;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use pendularm_benches::attack::admission::REPORT;
use pendularm_benches::attack::stage::{Deeds, play};
use pendularm_benches::attack::{Attack, TOKEN, groups, picks};
use pendularm_benches::healthy::{Healthy, Target};
use pendularm_benches::program::{Program, peak};

use table::{Bars, Row, Verdict};

/// Time from the healthy client's first call to the attack.
const CALM: Duration = Duration::from_millis(100);
/// Bytes of the report's file that slow readers ask for.
const LARGE: usize = 3_900_000;

/// Duration, strictness and selection of the attacks.
struct Plan {
    program: String,
    attacked: Duration,
    /// Time until a call or a new client counts as not answered.
    patience: Duration,
    bars: Bars,
    /// Most repetitions of an attack that was too slow.
    tries: usize,
    /// Parts of the names of the attacks to play, separated by commas. All if empty.
    only: String,
}

impl Plan {
    fn of(program: String, arguments: &[String]) -> Self {
        let only = arguments
            .iter()
            .find_map(|argument| argument.strip_prefix("--only="));
        let full = Self {
            program,
            attacked: Duration::from_secs(4),
            patience: Duration::from_secs(2),
            bars: Bars::FULL,
            tries: 1,
            only: only.unwrap_or_default().to_owned(),
        };
        if !arguments.iter().any(|argument| argument == "--quick") {
            return full;
        }
        // A machine that pauses for seconds answers late, so only a missing answer counts. One pause of the machine can
        // delay a whole play of a second.
        Self {
            attacked: Duration::from_millis(900),
            patience: Duration::from_secs(20),
            bars: Bars::QUICK,
            tries: 3,
            ..full
        }
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.iter().any(|argument| argument == "--list") {
        for (group, attacks) in groups() {
            println!("{group}");
            for attack in attacks {
                println!("  {:<24} {}", attack.name, attack.what);
            }
        }
        return ExitCode::SUCCESS;
    }
    let Some(program) = arguments.first().filter(|first| !first.starts_with("--")) else {
        eprintln!("attack: which program? attack PATH/TO/pendularm");
        return ExitCode::from(2);
    };
    let missed =
        Folder::enter(program).and_then(|(_folder, program)| run(&Plan::of(program, &arguments)));
    match missed {
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

/// Plays all selected attacks. Returns the names of the attacks that missed a bar.
fn run(plan: &Plan) -> Result<Vec<&'static str>, String> {
    let mut missed = Vec::new();
    println!("{}", plan.bars);
    table::print_head();
    attacked(
        &Attack::new("baseline", "nobody attacks", Vec::new),
        plan,
        &mut missed,
    )?;
    for (group, attacks) in groups() {
        let mut picked = attacks
            .iter()
            .filter(|attack| picks(&plan.only, attack.name))
            .peekable();
        if picked.peek().is_some() {
            println!("-- {group}");
        }
        for attack in picked {
            attacked(attack, plan, &mut missed)?;
        }
    }
    Ok(missed)
}

fn attacked(attack: &Attack, plan: &Plan, missed: &mut Vec<&'static str>) -> Result<(), String> {
    for left in (0..plan.tries).rev() {
        match endure(attack, plan)?.print(&plan.bars) {
            Verdict::Held => break,
            Verdict::Late if left > 0 => println!("     late: once more"),
            Verdict::Late | Verdict::Missed => {
                println!("     {}: {}", attack.name, attack.what);
                missed.push(attack.name);
                break;
            }
        }
    }
    Ok(())
}

/// The program with the options of the attack, on a free port.
fn start(attack: &Attack, program: &str) -> Result<Program, String> {
    let mut arguments = vec!["--bind", "127.0.0.1:0", "--seed", "1"];
    if !attack.options.contains(&"--log") {
        arguments.extend(["--log", "warn"]);
    }
    if attack.locked {
        arguments.extend(["--token", TOKEN]);
    }
    arguments.extend(attack.options);
    Program::start(program, &arguments)
}

/// Attacks the program; SIGTERM comes before the attack ends.
fn endure(attack: &Attack, plan: &Plan) -> Result<Row, String> {
    let program = start(attack, &plan.program)?;
    let (address, pid, cast) = (program.address, program.pid(), (attack.cast)());
    let (over, deeds) = (AtomicBool::new(false), Deeds::default());
    let healthy = Healthy::start(Target {
        address,
        locked: attack.locked,
        patience: plan.patience,
        long: attack.holds,
    })?;
    let (health, peak, ended) = std::thread::scope(|scope| {
        std::thread::sleep(CALM);
        let attackers =
            scope.spawn(|| play(&cast, address, &deeds, || over.load(Ordering::Relaxed)));
        std::thread::sleep(plan.attacked);
        let health = healthy.finish();
        let peak = peak(pid);
        let ended = program.end();
        over.store(true, Ordering::Relaxed);
        let _ = attackers.join();
        (health, peak, ended)
    });
    Ok(Row {
        attack: *attack,
        health,
        peak: peak.unwrap_or(f64::NAN),
        ended: peak.ok_or("it was gone before".to_owned()).and(ended),
        deeds,
        attacked: !cast.is_empty(),
    })
}

/// The folder in which the program runs, with a report in it; removed at the end.
struct Folder(PathBuf);

impl Folder {
    /// Creates it, and changes to it. Returns the program's absolute path.
    fn enter(program: &str) -> Result<(Self, String), String> {
        let program =
            std::fs::canonicalize(program).map_err(|error| format!("{program}: {error}"))?;
        let folder = std::env::temp_dir().join(format!("pendularm-attack-{}", std::process::id()));
        let report = folder.join(REPORT);
        let make = || {
            std::fs::create_dir_all(&report)?;
            std::fs::write(
                report.join("index.html"),
                "<!doctype html><title>report</title>",
            )?;
            std::fs::write(report.join("large.csv"), "0.125,".repeat(LARGE / 6))?;
            std::env::set_current_dir(&folder)
        };
        make().map_err(|error| format!("{}: {error}", folder.display()))?;
        Ok((Self(folder), program.to_string_lossy().into_owned()))
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
