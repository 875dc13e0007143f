//! A record in the arm's place: what clients hear of it, forward, back and from anywhere.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use actix::prelude::*;
use pendularm::actors::gateway::messages::{Handled, PublishInTurn};
use pendularm::actors::gateway::registry::{Attach, Registry};
use pendularm::actors::node::Interest;
use pendularm::actors::player::{self, DriveRecord, MAX_AT_ONCE, MAX_RATE, PlayedRecord, Player};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::wire::Nodes;
use pendularm::protocol::catalog::Topic;
use pendularm::record::{Content, RecordEntry};
use serde_json::{Value, json};
use tokio::sync::oneshot;
use tokio::time::sleep;

use crate::recorder::{Notes, file, passages, stop};
use crate::stage::{self, Client, Stage, connect, ms, number, numbers};
use crate::system::in_virtual_time;

/// A run of four seconds: the controller on, a setpoint, and after two seconds longer links and less gravity.
async fn run() -> Vec<RecordEntry> {
    let stage = Stage::<2>::start().await;
    let mut client = stage.connect();
    let notes = Notes::default();
    notes.take(&stage).await;
    client.enable().await;
    sleep(ms(500)).await;
    client.publish_trajectory(json!([0.5, -0.5])).await;
    sleep(ms(1500)).await;
    let changed = json!({"lengths": [1.5, 1.0], "gravity": 4.25});
    client.ask("/arm_sim/set_params", changed).await;
    sleep(ms(2000)).await;
    stop(&stage).await;
    notes.entries()
}

/// A record under a name of its own, being played.
struct Show {
    registry: Addr<Registry>,
    gauges: Arc<Gauges>,
}

fn on_disk(name: &str, bytes: &[u8]) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("player-{name}.mcap"));
    fs::write(&path, bytes).unwrap();
    path
}

impl Show {
    async fn of(name: &str, entries: &[RecordEntry]) -> Self {
        let gauges = Arc::new(Gauges::default());
        let registry = Registry::new(Arc::clone(&gauges)).start();
        let mut nodes = Nodes::default();
        let path = on_disk(name, &file(entries));
        player::start(&path, &registry, System::current().arbiter(), &mut nodes).unwrap();
        registry.send(Attach(nodes)).await.unwrap();
        Self { registry, gauges }
    }

    fn connect(&self) -> Client {
        connect(&self.registry, &self.gauges)
    }
}

async fn drive(client: &mut Client, how: &str, args: Value) -> Value {
    client.ask(&format!("/rosbag2_player/{how}"), args).await
}

/// Some ticks: a place that is sought again so soon is shown at the next one.
const TICKS: std::time::Duration = ms(50);

async fn seek(client: &mut Client, sec: u32, nanosec: u32) {
    let time = json!({"time": {"sec": sec, "nanosec": nanosec}});
    let answer = drive(client, "seek", time).await;
    assert_eq!(answer, json!({"success": true}));
}

async fn position(client: &mut Client) -> f64 {
    number(&drive(client, "get_position", json!({})).await["position"])
}

/// The messages of a topic, as they stand in the record.
fn recorded(entries: &[RecordEntry], topic: &str) -> Vec<Value> {
    let (all, _) = passages(&file(entries));
    let of_topic = all.into_iter().filter(|one| one.topic == topic);
    of_topic.map(|one| one.msg.unwrap()).collect()
}

fn time_of(state: &Value) -> f64 {
    let stamp = &state["header"]["stamp"];
    number(&stamp["sec"]) + 1e-9 * number(&stamp["nanosec"])
}

#[test]
fn topics_are_published_as_they_were_recorded() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("as-recorded", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "pause", json!({})).await;
        seek(&mut client, 0, 0).await;
        for topic in [
            "/joint_states",
            "/tf",
            "/clock",
            "/joint_trajectory",
            "/diagnostics",
        ] {
            client.subscribe(topic).await;
        }
        let before = client.heard.len();
        drive(&mut client, "resume", json!({})).await;
        client.messages_for(ms(5000), "/clock").await;
        for topic in [
            "/joint_states",
            "/tf",
            "/clock",
            "/joint_trajectory",
            "/diagnostics",
        ] {
            let mut heard: Vec<Value> = client.heard[before..]
                .iter()
                .filter(|frame| frame["topic"] == topic)
                .map(|frame| frame["msg"].clone())
                .collect();
            // While it stood, the one that was present came again.
            heard.dedup();
            let all = recorded(&entries, topic);
            assert!(
                heard.len() >= all.len() - 1,
                "{topic}: {} of {}",
                heard.len(),
                all.len()
            );
            // The first may have come before.
            let first = all.iter().position(|one| *one == heard[0]).unwrap();
            assert!(first <= 1, "{topic} begins with message {first}");
            let length = all.len() - first;
            assert_eq!(heard[..length], all[first..], "{topic}");
        }
        let end = drive(&mut client, "get_position", json!({})).await;
        assert_eq!(end["position"], end["duration"]);
        assert!((number(&end["duration"]) - 4.0).abs() < 0.1, "{end}");
    });
}

#[test]
fn a_record_goes_backward_and_at_other_speeds() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("backward", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "set_rate", json!({"rate": -2})).await;
        assert_eq!(
            drive(&mut client, "get_rate", json!({})).await,
            json!({"rate": -2.0})
        );
        client.subscribe("/joint_states").await;
        seek(&mut client, 3, 0).await;
        client.settle().await;
        let before = client.messages("/joint_states").len();
        let heard = client.messages_for(ms(1000), "/joint_states").await;
        // Two seconds of a record with sixty a second, give or take a tick at either end.
        assert!((117..=123).contains(&heard.len()), "{}", heard.len());
        let times: Vec<f64> = heard.iter().map(time_of).collect();
        assert!(times.is_sorted_by(|a, b| a > b), "{times:?}");
        assert!(before > 0, "the state at the place that was sought");
        let all = recorded(&entries, "/joint_states");
        assert!(heard.iter().all(|one| all.contains(one)));
        // At its beginning it ends, and goes on forward when that is asked.
        client.messages_for(ms(1000), "/joint_states").await;
        assert_eq!(position(&mut client).await, 0.0);
        drive(&mut client, "set_rate", json!({"rate": 0.5})).await;
        let heard = client.messages_for(ms(1000), "/joint_states").await;
        assert!((28..=32).contains(&heard.len()), "{}", heard.len());
        let at = position(&mut client).await;
        assert!((at - 0.5).abs() < 0.05, "{at}");
    });
}

#[test]
fn a_paused_record_shows_where_it_stands() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("paused", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "pause", json!({})).await;
        assert_eq!(
            drive(&mut client, "is_paused", json!({})).await,
            json!({"paused": true})
        );
        seek(&mut client, 0, 0).await;
        client.subscribe("/joint_states").await;
        client.settle().await;
        let state = client.messages("/joint_states").pop().unwrap();
        assert!(
            time_of(&state) < 0.02,
            "at its beginning the first one: {state}"
        );
        seek(&mut client, 1, 500_000_000).await;
        client.messages_for(TICKS, "/joint_states").await;
        let state = client.messages("/joint_states").pop().unwrap();
        assert!((time_of(&state) - 1.5).abs() < 0.05, "{state}");
        // Who comes later gets it within a second.
        let mut late = show.connect();
        late.subscribe("/joint_states").await;
        let heard = late.messages_for(ms(1100), "/joint_states").await;
        assert!(!heard.is_empty() && heard.iter().all(|one| *one == state));
        assert_eq!(position(&mut client).await, 1.5);
        let time = client.ask("/rosapi/get_time", json!({})).await;
        assert_eq!(time["time"]["sec"], 1);
        // The pause that clients know from the arm is the same.
        assert_eq!(client.ask("/arm_sim/pause", json!({})).await["data"], true);
        client.ask("/arm_sim/pause", json!({"data": false})).await;
        assert_eq!(
            drive(&mut client, "is_paused", json!({})).await,
            json!({"paused": false})
        );
        drive(&mut client, "toggle_paused", json!({})).await;
        assert_eq!(
            drive(&mut client, "is_paused", json!({})).await,
            json!({"paused": true})
        );
    });
}

#[test]
fn after_the_answer_that_it_stands_or_is_elsewhere_no_state_from_before_comes() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("stale", &entries).await;
        let mut client = show.connect();
        client
            .send(
                &json!({"op": "subscribe", "topic": "/joint_states", "throttle_rate": 300,
                "queue_length": 20}),
            )
            .await;
        client.messages_for(ms(700), "/joint_states").await;
        drive(&mut client, "pause", json!({})).await;
        let stood = position(&mut client).await;
        let heard = client.messages_for(ms(2000), "/joint_states").await;
        assert!(
            heard.iter().all(|state| time_of(state) >= stood - 0.02),
            "{stood} s: {heard:?}"
        );
    });
}

#[test]
fn the_arm_is_asked_about_as_it_was_and_not_changed() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("settings", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "pause", json!({})).await;
        for (sec, gravity, lengths) in [(3, 4.25, [1.5, 1.0]), (1, 9.81, [1.0, 1.0])] {
            seek(&mut client, sec, 0).await;
            let params = client.ask("/arm_sim/set_params", json!({})).await;
            assert_eq!(number(&params["gravity"]), gravity);
            assert_eq!(numbers(&params["lengths"]), lengths);
            let param = client
                .ask("/rosapi/get_param", json!({"name": "gravity"}))
                .await;
            assert_eq!(param["value"], gravity.to_string());
        }
        let enabled = client.ask("/pid_controller/enable", json!({})).await;
        assert_eq!(enabled["data"], true);
        let integrator = client.ask("/arm_sim/set_integrator", json!({})).await;
        assert_eq!(integrator["method"], "rk4");
        for (service, args, field) in [
            ("/arm_sim/set_params", json!({"gravity": 1}), "gravity"),
            (
                "/arm_sim/set_integrator",
                json!({"timestep": 0.1}),
                "timestep",
            ),
            ("/pid_controller/set_gains", json!({"kp": [1, 1]}), "kp"),
            ("/pid_controller/enable", json!({"data": false}), "data"),
        ] {
            let refused = client.call(service, args).await;
            assert_eq!(refused["result"], false, "{refused}");
            let status = refused["status"].as_str().unwrap();
            assert_eq!(
                status,
                format!("{field} cannot be changed: this is a record")
            );
        }
        let params = client.ask("/arm_sim/set_params", json!({})).await;
        assert_eq!(params["gravity"], 9.81);
    });
}

#[test]
fn a_latched_message_is_the_one_that_held_there() {
    let entries = in_virtual_time(run());
    let descriptions = recorded(&entries, "/robot_description");
    assert_eq!(descriptions.len(), 2);
    in_virtual_time(async {
        let show = Show::of("latched", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "pause", json!({})).await;
        seek(&mut client, 3, 0).await;
        client.subscribe("/robot_description").await;
        client.settle().await;
        assert_eq!(
            client.messages("/robot_description"),
            [descriptions[1].clone()]
        );
        let mut other = show.connect();
        other.subscribe("/robot_description").await;
        other.settle().await;
        assert_eq!(
            other.messages("/robot_description"),
            [descriptions[1].clone()]
        );
        seek(&mut client, 1, 0).await;
        client.messages_for(TICKS, "/robot_description").await;
        assert_eq!(
            client.messages("/robot_description").last(),
            Some(&descriptions[0])
        );
        // It is not repeated while the record stands.
        assert!(
            client
                .messages_for(ms(3000), "/robot_description")
                .await
                .is_empty()
        );
    });
}

#[test]
fn what_is_listed_is_served_and_a_live_arms_services_are_not() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("listed", &entries).await;
        let mut client = show.connect();
        let services = client.ask("/rosapi/services", json!({})).await["services"].clone();
        let services: Vec<&str> = services
            .as_array()
            .unwrap()
            .iter()
            .map(|one| one.as_str().unwrap())
            .collect();
        assert!(
            services.contains(&"/rosbag2_player/seek") && services.contains(&"/arm_sim/set_params")
        );
        for missing in [
            "/arm_sim/reset",
            "/ik/solve",
            "/study/stability",
            "/recorder/start",
        ] {
            assert!(!services.contains(&missing), "{missing}");
            let refused = client.call(missing, json!({})).await;
            assert_eq!(
                refused["status"],
                format!("{missing} is not served by this runtime")
            );
        }
        let actions = client.ask("/rosapi/action_servers", json!({})).await;
        assert_eq!(actions["action_servers"], json!([]));
        let seek = client
            .ask(
                "/rosapi/service_type",
                json!({"service": "/rosbag2_player/seek"}),
            )
            .await;
        assert_eq!(seek["type"], "rosbag2_interfaces/srv/Seek");
        let details = client
            .ask(
                "/rosapi/service_request_details",
                json!({"type": "rosbag2_interfaces/srv/Seek"}),
            )
            .await;
        assert_eq!(details["typedefs"][0]["fieldnames"], json!(["time"]));
    });
    // And the other way round.
    in_virtual_time(async {
        let stage = Stage::<2>::start().await;
        let mut client = stage.connect();
        let refused = client.call("/rosbag2_player/pause", json!({})).await;
        assert_eq!(
            refused["status"],
            "/rosbag2_player/pause is not served by this runtime"
        );
    });
}

#[test]
fn bad_wishes_are_refused_by_name() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("refused", &entries).await;
        let mut client = show.connect();
        for rate in [
            json!(0),
            json!(MAX_RATE + 1.0),
            json!(-MAX_RATE - 1.0),
            json!("fast"),
            json!(null),
        ] {
            let refused = client
                .call("/rosbag2_player/set_rate", json!({"rate": rate}))
                .await;
            assert_eq!(refused["result"], false, "{refused}");
            assert!(
                refused["status"]
                    .as_str()
                    .unwrap()
                    .starts_with("rate must be"),
                "{refused}"
            );
        }
        for rate in [MAX_RATE, -MAX_RATE] {
            drive(&mut client, "set_rate", json!({"rate": rate})).await;
        }
        for time in [
            json!(3),
            json!({"sec": -1}),
            json!({"sec": 1, "nanosec": "x"}),
        ] {
            let refused = client
                .call("/rosbag2_player/seek", json!({"time": time}))
                .await;
            assert!(
                refused["status"].as_str().unwrap().starts_with("time"),
                "{refused}"
            );
        }
        let missing = client.call("/rosbag2_player/seek", json!({})).await;
        assert_eq!(missing["status"], "time is required");
        // A time beyond its end is its end.
        seek(&mut client, 4_000_000_000, 0).await;
        let end = drive(&mut client, "get_position", json!({})).await;
        assert_eq!(end["position"], end["duration"]);
    });
}

/// A look back costs thousands of messages: there is one from one tick to the next.
#[test]
fn who_seeks_over_and_over_hears_where_it_was_first_and_where_it_is_at_the_next_tick() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("sought", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "pause", json!({})).await;
        client.subscribe("/joint_states").await;
        client.messages_for(ms(100), "/joint_states").await;
        for second in [1, 2, 3] {
            seek(&mut client, second, 0).await;
        }
        let at = position(&mut client).await;
        assert!((at - 3.0).abs() < 1e-6, "{at}");
        let heard = client.messages_for(ms(50), "/joint_states").await;
        let times: Vec<f64> = heard.iter().map(|one| time_of(one).round()).collect();
        assert_eq!(times.last(), Some(&3.0), "{times:?}");
        assert!(!times.contains(&2.0), "{times:?}");
    });
}

/// So many at one time are not published in one turn; nor is one lost.
#[test]
fn many_messages_at_one_time_come_in_several_turns() {
    let mut entries = in_virtual_time(run());
    let is_clock = |one: &RecordEntry| {
        matches!(
            &one.content,
            Content::Published {
                topic: Topic::Clock,
                ..
            }
        )
    };
    let one = entries.iter().rfind(|one| is_clock(one)).unwrap().clone();
    entries.retain(|one| !is_clock(one));
    let many = 2 * MAX_AT_ONCE + 10;
    entries.extend((0..many).map(|_| one.clone()));
    in_virtual_time(async {
        let show = Show::of("many", &entries).await;
        let mut client = show.connect();
        drive(&mut client, "pause", json!({})).await;
        seek(&mut client, 4, 0).await;
        client.subscribe("/clock").await;
        client.settle().await;
        let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
        drive(&mut client, "set_rate", json!({"rate": -1})).await;
        drive(&mut client, "resume", json!({})).await;
        for turn in 0..10 {
            let heard = client.messages_for(ms(17), "/clock").await.len();
            *counts.entry(turn).or_default() += heard;
        }
        let most = counts.values().max().unwrap();
        assert!(*most <= 2 * MAX_AT_ONCE, "{counts:?}");
        let sum: usize = counts.values().sum();
        // The one that is present is heard before it goes on, too.
        assert!((many..=many + 1).contains(&sum), "{sum}: {counts:?}");
    });
}

/// A gateway whose subscribers take nothing yet: keeps the ends of what has come. Or they take all at once.
#[derive(Default)]
struct Deaf {
    come: Rc<Cell<usize>>,
    underway: Vec<oneshot::Sender<()>>,
    takes: bool,
}

impl Actor for Deaf {
    type Context = Context<Self>;
}

impl Handler<PublishInTurn> for Deaf {
    type Result = Handled;

    fn handle(&mut self, PublishInTurn(messages): PublishInTurn, _: &mut Context<Self>) -> Handled {
        self.come.set(self.come.get() + messages.len());
        let (underway, end) = oneshot::channel();
        if !self.takes {
            self.underway.push(underway);
        }
        Handled::by_node(end)
    }
}

/// However often the speed is changed, at whatever speed: nothing more is published while what was is underway.
#[test]
fn a_record_waits_for_its_subscribers() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let come = Rc::new(Cell::new(0));
        let deaf = Deaf {
            come: Rc::clone(&come),
            ..Deaf::default()
        };
        let path = on_disk("deaf", &file(&entries));
        let record = PlayedRecord::<2>::open(fs::File::open(path).unwrap()).unwrap();
        let player = Player::new(record, deaf.start().recipient()).start();
        let wanted = true;
        for topic in [Topic::JointStates, Topic::Clock, Topic::RobotDescription] {
            player.send(Interest { topic, wanted }).await.unwrap();
        }
        sleep(ms(1)).await;
        let underway = come.get();
        assert!((1..=8).contains(&underway), "{underway}");
        for n in 0..300 {
            let rate = if n % 2 == 0 { MAX_RATE } else { -MAX_RATE };
            for drive in [DriveRecord::Rate(rate), DriveRecord::Seek(ms(n))] {
                stage::asked(&player, drive).await.unwrap();
            }
            sleep(ms(10)).await;
        }
        assert_eq!(come.get(), underway);
    });
}

/// However often somebody comes and goes: the present messages are looked for once from one tick to the next.
#[test]
fn who_subscribes_over_and_over_has_the_record_searched_once_a_tick() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let come = Rc::new(Cell::new(0));
        let taking = Deaf {
            come: Rc::clone(&come),
            takes: true,
            ..Deaf::default()
        };
        let path = on_disk("over-and-over", &file(&entries));
        let record = PlayedRecord::<2>::open(fs::File::open(path).unwrap()).unwrap();
        let player = Player::new(record, taking.start().recipient()).start();
        let paused = stage::asked(&player, DriveRecord::Pause(true)).await;
        assert!(paused.unwrap().is_paused);
        let interest = async |topic, wanted| {
            player.send(Interest { topic, wanted }).await.unwrap();
            tokio::task::yield_now().await;
        };
        for _ in 0..200 {
            for wanted in [true, false] {
                interest(Topic::JointStates, wanted).await;
            }
        }
        assert!((1..=2).contains(&come.get()), "{}", come.get());
        // Who stays has its message at the next tick, and who leaves before has none.
        interest(Topic::Clock, true).await;
        interest(Topic::RobotDescription, true).await;
        let before = come.get();
        sleep(ms(20)).await;
        assert_eq!(come.get(), before + 2);
    });
}

#[test]
fn a_place_that_cannot_be_read_any_more_is_not_gone_to() {
    let entries = in_virtual_time(run());
    in_virtual_time(async {
        let show = Show::of("shrunk", &entries).await;
        let mut client = show.connect();
        let played = Path::new(env!("CARGO_TARGET_TMPDIR")).join("player-shrunk.mcap");
        let played = fs::File::options().write(true).open(played).unwrap();
        played.set_len(100).unwrap();
        let time = json!({"time": {"sec": 1, "nanosec": 0}});
        let refused = client.call("/rosbag2_player/seek", time).await;
        assert_eq!(refused["result"], false, "{refused}");
        let why = refused["status"].as_str().unwrap();
        assert!(
            why.starts_with("the record cannot be read there: "),
            "{why}"
        );
        let stands = drive(&mut client, "is_paused", json!({})).await;
        assert_eq!(stands, json!({"paused": true}));
        assert!(position(&mut client).await < 1.0);
    });
}

#[test]
fn a_record_that_was_cut_is_played_up_to_there_and_no_record_is_refused() {
    let entries = in_virtual_time(run());
    let whole = file(&entries);
    in_virtual_time(async {
        let gauges = Arc::new(Gauges::default());
        let registry = Registry::new(Arc::clone(&gauges)).start();
        let begin = |name: &str, bytes: &[u8]| {
            let path = on_disk(name, bytes);
            let thread = System::current().arbiter().clone();
            player::start(&path, &registry, &thread, &mut Nodes::default())
        };
        begin("cut", &whole[..whole.len() / 2]).unwrap();
        let refused = begin("none", b"no record at all").unwrap_err().to_string();
        assert!(
            refused.contains("player-none.mcap: not a record"),
            "{refused}"
        );
        let refused = begin("empty", &file(&[])).unwrap_err().to_string();
        assert!(refused.contains("no states of an arm"), "{refused}");
        // A bit of an index is not missed; any other is.
        let places = (100..whole.len()).step_by(whole.len() / 100);
        let refused = places.filter(|at| {
            let mut damaged = whole.clone();
            damaged[*at] ^= 1;
            begin("damaged", &damaged).is_err()
        });
        assert!(refused.count() > 50);
    });
}
