//! Every recorded state is reached again, or the first that differs is named.

use super::*;

#[test]
fn every_recorded_state_is_replayed_bit_for_bit_for_random_requests() {
    let (mut steps, mut states) = (0, 0);
    for seed in 0..6 {
        for entries in [
            in_virtual_time(random_run::<2>(seed)),
            in_virtual_time(random_run::<3>(seed)),
        ] {
            let verdict = replayed(&entries);
            let inputs = |entry: &&RecordEntry| matches!(entry.content, Content::Input { .. });
            let told = entries.iter().filter(inputs).count() as u64;
            assert_eq!(verdict.difference, None, "seed {seed}");
            assert_eq!(verdict.inputs, told - 1, "all but the beginning");
            steps += verdict.steps;
            states += verdict.states;
            assert_eq!(
                (verdict.losses, verdict.ending),
                (0, Some(RecordEnding::Whole))
            );
        }
    }
    // A run may spend most of its two seconds paused, but not all of them do.
    assert!(
        steps > 5000 && states > 300,
        "{steps} steps, {states} states"
    );
}

#[test]
fn a_divergence_is_reached_again_at_its_step() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        let notes = Notes::default();
        notes.take(&stage).await;
        client.enable().await;
        client
            .ask(
                "/arm_sim/set_integrator",
                json!({"method": "euler", "timestep": 0.05}),
            )
            .await;
        client.publish_trajectory(json!([2.0, -1.0])).await;
        sleep(ms(20_000)).await;
        client.ask("/arm_sim/reset", json!({})).await;
        sleep(ms(100)).await;
        stop(&stage).await;
        let entries = notes.entries();
        let diverged = |entry: &RecordEntry| matches!(&entry.content, Content::Input { note, .. } if note == "{\"diverged\":null}");
        let at = entries.iter().position(diverged).expect("it diverges");
        assert_eq!(replayed(&entries).difference, None);

        // With another timestep it does not.
        let mut other = entries.clone();
        for entry in &mut other {
            if let Content::Input { note, .. } = &mut entry.content {
                *note = note.replace("{\"timestep\":0.05}", "{\"timestep\":0.001}");
            }
        }
        other.retain(|entry| !matches!(entry.content, Content::State { .. }));
        let Content::Input { step, .. } = entries[at].content else {
            unreachable!()
        };
        let difference = replayed(&other).difference.unwrap();
        assert_eq!(difference.step, step);
        assert!(
            difference.what.contains("was not finite in the record"),
            "{difference:?}"
        );
    });
}

#[test]
fn the_first_state_that_differs_in_its_last_bit_is_named_with_its_step() {
    let mut entries = in_virtual_time(random_run::<2>(3));
    let is_state = |entry: &RecordEntry| matches!(entry.content, Content::State { .. });
    let states: Vec<usize> = (0..entries.len())
        .filter(|&at| is_state(&entries[at]))
        .collect();
    let (before, changed) = (states[1], states[2]);
    let step_of = |entry: &RecordEntry| match entry.content {
        Content::State { step, .. } => step,
        _ => unreachable!(),
    };
    let (agreed_to, differs_at) = (step_of(&entries[before]), step_of(&entries[changed]));
    if let Content::State { velocity, .. } = &mut entries[changed].content {
        velocity[1] = velocity[1].next_up();
    }
    let verdict = replayed(&entries);
    let difference = verdict.difference.clone().unwrap();
    assert_eq!(
        (verdict.agreed_to, difference.step),
        (agreed_to, differs_at)
    );
    assert!(
        difference.what.starts_with("velocity[1] was "),
        "{difference:?}"
    );
    let says = verdict.to_string();
    let names = format!("the same up to step {agreed_to}, and at step {differs_at} (t = ");
    assert!(says.contains(&names), "{says}");
}

/// After lost reports the whole simulation is recorded once, and no report before it.
#[test]
fn a_listener_that_has_lost_an_input_gets_the_whole_simulation_again() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        let notes = Notes::default();
        let kept = notes.clone();
        let mut told = 0;
        let listener = listeners::arm::<2>(move |content| {
            told += 1;
            let takes = !(30..60).contains(&told);
            if takes {
                kept.put(content);
            }
            takes
        });
        stage.arm.send(SetListener(Some(listener))).await.unwrap();
        client.enable().await;
        for turn in 1..=20 {
            client
                .publish_trajectory(json!([0.1 * f64::from(turn), 0.2]))
                .await;
            sleep(ms(100)).await;
        }
        stop(&stage).await;
        let verdict = replayed(&notes.entries());
        assert_eq!((verdict.difference, verdict.losses), (None, 1));
        assert!(verdict.states > 50);
    });
}
