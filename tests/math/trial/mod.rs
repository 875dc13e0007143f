//! Every transition of a trial: events, the commands that they return, and the status after each; and the sampling of targets.
//!
//! `transcripts.txt` has the transitions. A transcript begins with `# ` and its statement, and plays on a new trial, or with `#+ ` on one
//! whose first goal is active. Each line of it is `event | commands | status`. The `n`th goal has ticket `n`, and target `n`; its id is `gn`.

mod sampling;

use glam::dvec2;
use pendularm::math::goal::{Criteria, Outcome};
use pendularm::math::kinematics::Target;
use pendularm::math::trial::{Changes, Conclusion, Rejection, Trial, TrialCommand};

const TRANSCRIPTS: &str = include_str!("transcripts.txt");

/// The `n`th target of a test: each a different one.
fn target(n: u64) -> Target {
    Target {
        position: dvec2(n as f64, 0.5),
        orientation: None,
    }
}

fn ended(goal_id: &str, outcome: Outcome) -> Conclusion {
    Conclusion {
        goal_id: goal_id.to_owned(),
        outcome,
        final_distance: 0.015,
    }
}

/// Applies settings from a text `name value name value`.
fn changes(words: &[&str]) -> Changes {
    let mut changes = Changes::default();
    for pair in words.chunks(2) {
        let value = Some(pair[1].parse().unwrap());
        match pair[0] {
            "duration" => changes.duration = value,
            "epsilon" => changes.epsilon = value,
            "success_hold" => changes.success_hold = value,
            other => panic!("no setting: {other}"),
        }
    }
    changes
}

/// Plays an event; `sent` counts the targets that have been sampled.
fn play(trial: &mut Trial, event: &str, sent: &mut u64) -> Result<Vec<TrialCommand>, Rejection> {
    let (event, has_target) = match event.strip_suffix(" without target") {
        Some(event) => (event, false),
        None => (event, true),
    };
    let words: Vec<&str> = event.split(' ').collect();
    let sample = || {
        has_target.then(|| {
            *sent += 1;
            target(*sent)
        })
    };
    let ticket = || words[1].parse().unwrap();
    let number = |word: &str| word.parse().unwrap();
    Ok(match words[0] {
        "start" => trial.start(number(words[1]), changes(&words[2..]), sample)?,
        "skip" => trial.skip(sample)?,
        "stop" => trial.stop()?,
        "tick" => trial.tick(number(words[1])),
        "accept" => trial.accepted(ticket(), &format!("g{}", words[1]), sample),
        "refuse" => trial.refused(ticket(), sample),
        "reach" => trial.concluded(ended(words[1], Outcome::Reached), sample),
        "preempt" => trial.concluded(ended(words[1], Outcome::Preempted), sample),
        "feedback" => {
            trial.feedback(words[1], number(words[2]), &[0.5, number(words[2])]);
            Vec::new()
        }
        other => panic!("no event: {other}"),
    })
}

fn spelled(command: TrialCommand) -> String {
    match command {
        TrialCommand::PublishStatus => "publish".to_owned(),
        TrialCommand::CancelGoal { goal_id } => format!("cancel {goal_id}"),
        TrialCommand::SendGoal {
            ticket,
            target: sent,
            criteria,
        } => {
            assert_eq!(sent, target(ticket), "every sampled target is sent");
            let Criteria {
                epsilon,
                success_hold,
            } = criteria;
            format!("send {ticket} ({epsilon} m, {success_hold} s)")
        }
    }
}

fn shown(trial: &Trial) -> String {
    assert_eq!(trial.remaining().is_some(), trial.running());
    let Some(status) = trial.status() else {
        return "none".to_owned();
    };
    assert_eq!(status.running, trial.running());
    let state = if status.running { "runs" } else { "over" };
    let mut text = format!(
        "{state} {} of {} s, {} reached, {:?}",
        status.elapsed, status.duration, status.targets_reached, status.action_status
    );
    if let Some(target) = status.target {
        text += &format!(", target {}", target.position.x);
    }
    if let Some(error) = status.error {
        text += &format!(", error {error}");
    }
    if let Some(positions) = status.desired_positions {
        text += &format!(", joints {positions:?}");
    }
    text
}

#[test]
fn every_event_has_its_commands_and_its_status() {
    let mut found = String::new();
    let (mut trial, mut sent) = (Trial::default(), 0);
    for line in TRANSCRIPTS.lines() {
        if line.is_empty() || line.starts_with('#') {
            (trial, sent) = (Trial::default(), 0);
            if line.starts_with("#+") {
                for event in ["start 10", "accept 1"] {
                    play(&mut trial, event, &mut sent).unwrap();
                }
            }
            found += &format!("{line}\n");
            continue;
        }
        let event = line.split(" | ").next().unwrap();
        let commands = match play(&mut trial, event, &mut sent) {
            Ok(commands) => {
                let commands: Vec<String> = commands.into_iter().map(spelled).collect();
                commands.join(", ")
            }
            Err(rejection) => rejection.to_string(),
        };
        found += &format!("{event} | {commands} | {}\n", shown(&trial));
    }
    let mut other: Vec<(&str, &str)> = found.lines().zip(TRANSCRIPTS.lines()).collect();
    other.retain(|(found, line)| found != line);
    assert!(other.is_empty(), "found and expected: {other:#?}");
}

#[test]
fn the_end_is_not_missed_by_rounding() {
    // A clock of 1 ms steps that has run for a day shows 60.1 s as that, or as 1e-11 s less.
    let changes = Changes {
        duration: Some(60.1),
        ..Changes::default()
    };
    let mut trial = Trial::default();
    for start in 0..1000u32 {
        let steps = 86_400_000 + 7919 * start;
        let at = |k: u32| f64::from(steps + k) * 0.001;
        trial.start(at(0), changes, || Some(target(1))).unwrap();
        assert_eq!(trial.tick(at(60_099)), []);
        assert_eq!(trial.tick(at(60_100)), [TrialCommand::PublishStatus]);
    }
}

/// A difference rounds once; a sum of differences would round at every one of them.
#[test]
fn elapsed_time_is_one_difference_for_repeated_times() {
    let mut trial = Trial::default();
    let start = 0.1;
    let sample = || Some(target(1));
    trial.start(start, Changes::default(), sample).unwrap();
    for tenth in 2..=500 {
        let now = f64::from(tenth) / 10.0;
        for _ in 0..2 {
            assert_eq!(trial.tick(now), []);
            assert_eq!(trial.status().unwrap().elapsed, now - start);
            assert_eq!(trial.remaining(), Some(60.0 - (now - start)));
        }
    }
}
