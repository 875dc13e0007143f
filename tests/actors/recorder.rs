//! Runs on record: what arm and registry tell, and that it is enough to take every step again.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use pendularm::actors::arm::sim::Tell;
use pendularm::actors::gateway::messages::SetTap;
use pendularm::actors::recorder::limits::MAX_RECORDED_FRAME;
use pendularm::actors::recorder::listeners;
use pendularm::math::integrator::Method;
use pendularm::math::pid::Gains;
use pendularm::protocol::catalog::Topic;
use pendularm::record::{
    CALLS, Content, INPUTS, Passage, ReadError, RecordEnding, RecordEntry, Recording,
    ReplayVerdict, RunSettings, STATES, Scribe, replay,
};
use serde_json::{Value, json};
use tokio::time::{Instant, sleep};

use crate::stage::{Client, Stage, ms};
use crate::system::in_virtual_time;

/// Entries as they come, in the order in which they are told.
#[derive(Clone, Default)]
pub struct Notes(Arc<Mutex<Noted>>);

#[derive(Default)]
struct Noted {
    began: Option<Instant>,
    entries: Vec<RecordEntry>,
}

impl Notes {
    fn put(&self, content: Content) {
        let mut noted = self.0.lock().unwrap();
        let began = *noted.began.get_or_insert_with(Instant::now);
        let log_time = began.elapsed().as_nanos() as u64;
        noted.entries.push(RecordEntry { log_time, content });
    }

    pub fn entries(&self) -> Vec<RecordEntry> {
        self.0.lock().unwrap().entries.clone()
    }

    /// Begins to note all that passes.
    pub async fn take<const N: usize>(&self, stage: &Stage<N>)
    where
        Gains<N>: Default,
    {
        let (of_arm, of_registry) = (self.clone(), self.clone());
        let listener = listeners::arm::<N>(move |content| {
            of_arm.put(content);
            true
        });
        stage.arm.send(Tell(Some(listener))).await.unwrap();
        let tap = listeners::registry(move |content| {
            if let Some(content) = content {
                of_registry.put(content);
            }
        });
        let set_tap = SetTap(Some(tap));
        stage.registry.send(set_tap).await.unwrap();
    }
}

pub fn file(entries: &[RecordEntry]) -> Vec<u8> {
    let settings = RunSettings { links: 2, seed: 1 };
    let mut scribe = Scribe::new(Vec::new(), &settings).unwrap();
    for (number, entry) in entries.iter().enumerate() {
        scribe.write(entry).unwrap();
        if number % 20 == 19 {
            scribe.flush().unwrap();
        }
    }
    scribe.finish().unwrap()
}

pub fn passages(file: &[u8]) -> (Vec<Passage>, RecordEnding) {
    let mut recording = Recording::new(file);
    let mut passages = Vec::new();
    while let Some(passage) = recording.next_passage().unwrap() {
        passages.push(passage);
    }
    (passages, recording.ending().unwrap())
}

pub fn replayed(entries: &[RecordEntry]) -> ReplayVerdict {
    replay(&*file(entries)).unwrap()
}

pub async fn stop<const N: usize>(stage: &Stage<N>)
where
    Gains<N>: Default,
{
    stage.arm.send(Tell::<N>(None)).await.unwrap();
    stage.registry.send(SetTap(None)).await.unwrap();
}

/// Something that a client may do, out of everything that changes the arm's steps.
async fn do_something<const N: usize>(client: &mut Client, rng: &mut fastrand::Rng) {
    let mut numbers = |low: f64, high: f64| -> Vec<f64> {
        (0..N).map(|_| low + (high - low) * rng.f64()).collect()
    };
    let (poses, weights) = (numbers(-2.0, 2.0), numbers(0.5, 2.0));
    let (service, args) = match rng.u32(..12) {
        0 => ("/pid_controller/enable", json!({"data": rng.bool()})),
        1 => ("/pid_controller/set_gains", json!({"kp": weights})),
        2 => (
            "/arm_sim/set_params",
            json!({"masses": weights, "gravity": 10.0 * rng.f64()}),
        ),
        3 => ("/arm_sim/set_params", json!({"lengths": weights})),
        4 => {
            let timestep = 0.0005 + 0.001 * rng.f64();
            let method = rng.choice(Method::ALL).unwrap().name();
            (
                "/arm_sim/set_integrator",
                json!({"method": method, "timestep": timestep}),
            )
        }
        5 => (
            "/arm_sim/disturb",
            json!({"effort": poses, "duration": 0.2 * rng.f64() + 1e-9}),
        ),
        6 => ("/arm_sim/reset", json!({})),
        7 => ("/arm_sim/pause", json!({"data": rng.bool()})),
        8 => ("/arm_sim/step", json!({"steps": rng.u32(1..50)})),
        9 => ("/ik_trial/start", json!({})),
        10 => ("/pid_controller/set_gains", json!({})),
        _ => return client.publish_trajectory(json!(poses)).await,
    };
    client.call(service, args).await;
}

async fn random_run<const N: usize>(seed: u64) -> Vec<RecordEntry>
where
    Gains<N>: Default,
{
    let stage = Stage::<N>::with_seed(seed).await;
    let mut client = stage.connect();
    let mut rng = fastrand::Rng::with_seed(seed);
    // A record may begin in the middle of anything.
    for _ in 0..rng.u32(..8) {
        do_something::<N>(&mut client, &mut rng).await;
        sleep(ms(rng.u64(..90))).await;
    }
    let notes = Notes::default();
    notes.take(&stage).await;
    for _ in 0..40 {
        do_something::<N>(&mut client, &mut rng).await;
        sleep(ms(rng.u64(..90))).await;
    }
    stop(&stage).await;
    notes.entries()
}

#[test]
fn whatever_clients_do_every_recorded_state_is_reached_again_bit_for_bit() {
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
        let diverged = |entry: &RecordEntry| matches!(&entry.content, Content::Input { note, .. } if note == "\"diverged\"");
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
            difference.what.contains("was not finite, and is"),
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
    let (before, changed) = (states[10], states[11]);
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

/// The simulation is told as a whole behind what was lost, and nothing in between.
#[test]
fn a_listener_that_has_lost_an_input_hears_the_whole_again() {
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
        stage.arm.send(Tell(Some(listener))).await.unwrap();
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

#[test]
fn every_topic_is_recorded_though_nobody_subscribes_and_none_is_made_afterwards() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        client.enable().await;
        let notes = Notes::default();
        notes.take(&stage).await;
        client.ask("/ik_trial/start", json!({"duration": 3})).await;
        sleep(ms(4000)).await;
        stop(&stage).await;
        let before = notes.entries().len();
        sleep(ms(2000)).await;
        assert_eq!(notes.entries().len(), before);

        let (passages, ending) = passages(&file(&notes.entries()));
        assert_eq!((passages.len(), ending), (before, RecordEnding::Whole));
        let mut counts: HashMap<&str, u32> = HashMap::new();
        for passage in &passages {
            let count = counts.entry(passage.topic.as_str()).or_default();
            *count += 1;
            assert_eq!(passage.sequence, *count);
            assert!(passage.msg.is_some(), "{}", passage.topic);
        }
        // Without the study there are no warnings; the node of transforms is not there.
        let others = [INPUTS, STATES, CALLS];
        let unasked = [
            Topic::Rosout,
            Topic::TfWeb,
            Topic::TfWebGoal,
            Topic::TfWebCancel,
            Topic::TfWebFeedback,
        ];
        let topics = Topic::ALL.into_iter().filter(|one| !unasked.contains(one));
        for topic in topics.map(Topic::name).chain(others) {
            assert!(counts.contains_key(topic), "{topic} is missing: {counts:?}");
        }
        assert!(counts["/joint_states"] >= 239, "60 a second: {counts:?}");
        assert_eq!(counts["/robot_description"], 1);
    });
}

#[test]
fn a_subscriber_that_comes_while_it_is_recorded_gets_the_latched_message() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let notes = Notes::default();
        notes.take(&stage).await;
        sleep(ms(100)).await;
        let mut client = stage.connect();
        client.subscribe("/robot_description").await;
        client.settle().await;
        assert_eq!(client.messages("/robot_description").len(), 1);
        // The end of the record is not the end of the subscription.
        stop(&stage).await;
        client
            .ask("/arm_sim/set_params", json!({"lengths": [2.0, 1.0]}))
            .await;
        assert_eq!(client.messages("/robot_description").len(), 2);
    });
}

#[test]
fn calls_are_recorded_with_their_answers() {
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        let notes = Notes::default();
        notes.take(&stage).await;
        client
            .ask("/arm_sim/set_params", json!({"gravity": 3.5}))
            .await;
        client
            .call("/arm_sim/set_params", json!({"gravity": -1}))
            .await;
        let (passages, _) = passages(&file(&notes.entries()));
        let calls: Vec<Value> = passages
            .into_iter()
            .filter(|one| one.topic == CALLS)
            .map(|one| one.msg.unwrap())
            .collect();
        assert_eq!(calls.len(), 4);
        assert_eq!(calls[0]["service"], "/arm_sim/set_params");
        assert_eq!(calls[0]["type"], "pendularm_interfaces/srv/SetParams");
        assert_eq!(calls[0]["content"], "{\"gravity\":3.5}");
        assert_eq!(calls[1]["is_answer"], true);
        assert_eq!(calls[1]["id"], calls[0]["id"]);
        let values: Value = serde_json::from_str(calls[1]["content"].as_str().unwrap()).unwrap();
        assert_eq!(values["gravity"], 3.5);
        assert_eq!(calls[1]["result"], true);
        assert_eq!(calls[3]["result"], false);
        assert!(calls[3]["status"].as_str().unwrap().starts_with("gravity"));
    });
}

#[test]
fn a_frame_that_is_too_long_is_left_out_and_counted() {
    use pendularm::actors::ConnectionId;
    use pendularm::actors::gateway::messages::Tapped;
    use pendularm::protocol::catalog::Service;
    use pendularm::protocol::wire::payload::Payload;
    use serde_json::value::RawValue;

    let counts = Arc::new(Mutex::new((0, 0)));
    let counted = Arc::clone(&counts);
    let mut tap = listeners::registry(move |content| {
        let mut counts = counted.lock().unwrap();
        match content {
            Some(_) => counts.0 += 1,
            None => counts.1 += 1,
        }
    });
    for length in [MAX_RECORDED_FRAME, MAX_RECORDED_FRAME + 1] {
        tap(Tapped::Answered {
            to: ConnectionId(1),
            service: Service::Rollout,
            frame: &vec![b' '; length].into(),
        });
    }
    assert_eq!(*counts.lock().unwrap(), (1, 1));
    // The name that a call goes by is copied too.
    let payload = |text: String| Payload::from(RawValue::from_string(text).unwrap());
    let args = payload("{}".to_owned());
    for length in [MAX_RECORDED_FRAME - 2, MAX_RECORDED_FRAME - 1] {
        let id = payload(format!("\"{}\"", "x".repeat(length - 2)));
        tap(Tapped::Called {
            from: ConnectionId(1),
            service: Service::Rollout,
            id: Some(&id),
            args: &args,
        });
    }
    assert_eq!(*counts.lock().unwrap(), (2, 2));
}

#[test]
fn a_record_that_was_cut_anywhere_is_read_up_to_there() {
    let entries = in_virtual_time(random_run::<2>(1));
    let file = file(&entries);
    let (all, ending) = passages(&file);
    assert_eq!((all.len(), ending), (entries.len(), RecordEnding::Whole));
    let mut longest = 0;
    for length in (0..file.len()).step_by(997) {
        let (part, ending) = passages(&file[..length]);
        assert_eq!(ending, RecordEnding::Cut, "{length} of {}", file.len());
        assert_eq!(part[..], all[..part.len()]);
        assert!(part.len() >= longest);
        longest = part.len();
        if let Ok(verdict) = replay(&file[..length]) {
            assert_eq!(verdict.difference, None);
            assert!(
                verdict
                    .to_string()
                    .ends_with("the file ends early, and was read up to there")
            );
        }
    }
    assert!(longest > all.len() * 9 / 10, "{longest} of {}", all.len());
}

#[test]
fn a_record_that_was_damaged_is_no_proof_of_a_difference() {
    let entries = in_virtual_time(random_run::<2>(2));
    let file = file(&entries);
    let mut rng = fastrand::Rng::with_seed(9);
    let mut refused = 0;
    for _ in 0..100 {
        let mut damaged = file.clone();
        let at = rng.usize(..file.len());
        damaged[at] ^= 1 << rng.u32(..8);
        match replay(&*damaged) {
            // A bit of the index at the end, which is not needed.
            Ok(verdict) => assert_eq!(verdict.difference, None, "byte {at}"),
            Err(_) => refused += 1,
        }
    }
    assert!(refused > 50, "{refused} of 100");
    assert!(matches!(
        Recording::new(&b"no record at all"[..]).next_passage(),
        Err(ReadError::Mcap(_))
    ));
}
