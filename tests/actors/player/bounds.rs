//! How much is looked at and published at a time, whoever seeks, subscribes or takes nothing.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::rc::Rc;

use super::*;
use crate::stage;
use pendularm::actors::gateway::messages::{Handled, PublishInTurn};
use pendularm::actors::node::Interest;
use pendularm::actors::player::{DriveRecord, MAX_AT_ONCE, PlayedRecord, Player};
use pendularm::protocol::catalog::Topic;
use pendularm::record::Content;
use tokio::sync::oneshot;

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
