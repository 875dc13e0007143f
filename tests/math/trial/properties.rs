//! Any events in any order.

use pendularm::math::goal::Outcome;
use pendularm::math::trial::{ActionStatus, Changes, Trial, TrialCommand};
use proptest::prelude::*;

use super::{assert_cleared, ended, target};

#[derive(Debug, Clone)]
enum Event {
    Start,
    Skip,
    Stop,
    Tick(f64),
    Accepted(u64),
    Refused(u64),
    Reached(u64),
    Preempted(u64),
    Feedback(u64),
}

fn event() -> impl Strategy<Value = Event> {
    let n = 0u64..12;
    prop_oneof![
        Just(Event::Start),
        Just(Event::Skip),
        Just(Event::Stop),
        (0.0..200.0f64).prop_map(Event::Tick),
        n.clone().prop_map(Event::Accepted),
        n.clone().prop_map(Event::Accepted),
        n.clone().prop_map(Event::Refused),
        n.clone().prop_map(Event::Reached),
        n.clone().prop_map(Event::Reached),
        n.clone().prop_map(Event::Preempted),
        n.prop_map(Event::Feedback),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn the_status_is_consistent_after_random_events(events in prop::collection::vec(event(), 0..60)) {
        let mut trial = Trial::default();
        let mut elapsed = 0.0;
        let mut counted = 0;
        for event in events {
            let mut sampled = 0;
            let next = || { sampled += 1; Some(target(1)) };
            // Goal n is the one sent under ticket n.
            let id = |n: u64| format!("g{n}");
            let commands = match event {
                Event::Start => { elapsed = 0.0; counted = 0; trial.start(0.0, Changes::default(), next).unwrap() }
                Event::Skip => trial.skip(next).unwrap_or_default(),
                Event::Stop => trial.stop().unwrap_or_default(),
                Event::Tick(now) => trial.tick(now),
                Event::Accepted(n) => trial.accepted(n, &id(n), next),
                Event::Refused(n) => trial.refused(n, next),
                Event::Reached(n) => trial.concluded(ended(&id(n), Outcome::Reached), next),
                Event::Preempted(n) => trial.concluded(ended(&id(n), Outcome::Preempted), next),
                Event::Feedback(n) => { trial.feedback(&id(n), 0.1, &[0.0]); Vec::new() }
            };
            let sent = commands.iter().filter(|a| matches!(a, TrialCommand::SendGoal { .. })).count();
            prop_assert_eq!(sent, sampled, "every target that is sampled is sent, and no other");
            let Some(status) = trial.status() else { continue };
            prop_assert!(status.elapsed >= elapsed && status.elapsed <= status.duration);
            prop_assert!(status.targets_reached >= counted && status.targets_reached <= counted + 1);
            elapsed = status.elapsed;
            counted = status.targets_reached;
            if !status.running {
                assert_cleared(&status);
            }
            if status.desired_positions.is_some() {
                prop_assert!(status.error.is_some() && status.target.is_some());
            }
            match status.action_status {
                ActionStatus::Idle | ActionStatus::Preempted => prop_assert_eq!(status.error, None),
                ActionStatus::Active | ActionStatus::Reached => prop_assert!(status.target.is_some()),
            }
        }
    }
}
