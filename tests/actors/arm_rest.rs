//! An arm that nothing observes wakes 10 times a second instead of 60, and does the same.
//!
//! **Invariant:** wake-ups are those of the thread, in virtual time.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crate::arm_steps::{enable, of_timestep};
use crate::stage::{asked, ms};
use crate::system::{counting_wake_ups, in_virtual_time};
use crate::virtual_time::stand_in;
use actix::prelude::*;
use pendularm::actors::arm::sim::{
    ArmSim, EndGoal, GoalOrder, GoalProgress, PUBLISH_RATE, REST_TICKS, SetListener, TakeSnapshot,
    TrackGoal,
};
use pendularm::actors::node::{Interest, Publish};
use pendularm::math::arm::Arm;
use pendularm::math::goal::Criteria;
use pendularm::math::kinematics::Target;
use pendularm::math::pid::Gains;
use pendularm::protocol::catalog::Topic;
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep, sleep_until};

/// Wake-ups of a second are fewer. Each wait of 100 ms has some wake-ups of the timer's own.
const AT_REST: u64 = 55;

/// The topics and times of published messages.
type Published = Rc<RefCell<Vec<(Topic, Duration)>>>;

/// An arm whose ticks begin now.
fn arm() -> (Addr<ArmSim<2>>, Published) {
    let (published, began) = (Published::default(), Instant::now());
    let seen = Rc::clone(&published);
    let publish = stand_in(move |message: Publish| {
        seen.borrow_mut().push((message.topic, began.elapsed()));
    });
    let arm = ArmSim::new(Arm::default(), Gains::default(), publish, Arc::default());
    (arm.start(), published)
}

async fn want(arm: &Addr<ArmSim<2>>, topic: Topic, wanted: bool) {
    arm.send(Interest { topic, wanted }).await.unwrap();
}

fn goal(number: u64) -> TrackGoal<2> {
    TrackGoal {
        goal: GoalOrder {
            number,
            target: Target {
                position: [1.0, 0.5].into(),
                orientation: None,
            },
            criteria: Criteria::default(),
        },
        owner: stand_in(|_: GoalProgress<2>| ()),
    }
}

#[test]
fn an_arm_that_nothing_observes_wakes_ten_times_a_second() {
    counting_wake_ups(|sleeps| async move {
        let (arm, _) = arm();
        let in_a_second = async || {
            // The present tick ends first.
            sleep(ms(100)).await;
            let before = sleeps.load(Ordering::Relaxed);
            sleep(ms(1000)).await;
            sleeps.load(Ordering::Relaxed) - before
        };
        let at_rest = in_a_second().await;
        assert!((10..AT_REST).contains(&at_rest), "{at_rest}");
        for topic in [Topic::JointStates, Topic::Diagnostics] {
            want(&arm, topic, true).await;
            assert!(in_a_second().await >= 60, "{topic:?}");
            want(&arm, topic, false).await;
            assert!(in_a_second().await < AT_REST, "{topic:?}");
        }
        assert!(arm.send(goal(1)).await.unwrap().is_ok());
        assert!(in_a_second().await >= 60, "a goal");
        arm.send(EndGoal { number: 1 }).await.unwrap();
        assert!(in_a_second().await < AT_REST);
        arm.send(SetListener(Some(Box::new(|_| true))))
            .await
            .unwrap();
        assert!(in_a_second().await >= 60, "a record");
        arm.send(SetListener(None)).await.unwrap();
        assert!(in_a_second().await < AT_REST);
    });
}

/// The timer of tokio sorts waits into slots of 64 ms, and at the slot into slots of 1 ms. So each wait of 100 ms wakes the
/// thread once more. The arm itself adds no wake-up to those of a timer with its period.
#[test]
fn an_arm_at_rest_wakes_as_often_as_a_bare_timer_of_its_period() {
    let in_ten_seconds = |has_arm: bool| {
        counting_wake_ups(|sleeps| async move {
            let period = REST_TICKS * (1_000_000_000 / u64::from(PUBLISH_RATE));
            let timer = async move {
                let began = Instant::now();
                for count in 1.. {
                    sleep_until(began + Duration::from_nanos(count * period)).await;
                }
            };
            let _arm = has_arm.then(arm);
            let timer = (!has_arm).then(|| actix_rt::spawn(timer));
            sleep(ms(10_050)).await;
            timer.inspect(JoinHandle::abort);
            sleeps.load(Ordering::Relaxed)
        })
    };
    let (arm, timer) = (in_ten_seconds(true), in_ten_seconds(false));
    assert_eq!(arm, timer);
    assert!(timer > 2 * 100, "{timer}");
}

#[test]
fn an_arm_at_rest_has_the_same_time_and_state_to_the_bit() {
    in_virtual_time(async {
        let ((resting, _), (observed, _)) = (arm(), arm());
        want(&observed, Topic::JointStates, true).await;
        for (wait, timestep) in [
            (37, 0.001),
            (142, 0.0007),
            (3, 0.02),
            (1000, 0.31),
            (2500, 0.001),
        ] {
            for arm in [&resting, &observed] {
                asked(arm, enable(wait == 142)).await;
                asked(arm, of_timestep(timestep)).await;
            }
            sleep(ms(wait)).await;
            let resting = resting.send(TakeSnapshot).await.unwrap();
            let observed = observed.send(TakeSnapshot).await.unwrap();
            assert!(resting.steps() > 0 || wait < 100);
            assert_eq!(resting.steps(), observed.steps());
            assert_eq!(resting.time().to_bits(), observed.time().to_bits());
            assert_eq!(
                format!("{:?}", resting.state()),
                format!("{:?}", observed.state())
            );
        }
    });
}

#[test]
fn the_first_message_after_a_rest_comes_when_it_is_due() {
    in_virtual_time(async {
        for (topic, ticks) in [
            (Topic::JointStates, 1),
            (Topic::ErrorEstimate, 6),
            (Topic::TfWeb, 2),
        ] {
            for wait in [1, 20, 33, 51, 99, 101, 1234] {
                let (arm, published) = arm();
                sleep(ms(wait)).await;
                want(&arm, topic, true).await;
                sleep(ms(250)).await;
                let published = published.borrow();
                let tick = Duration::from_secs(1) / 60;
                let (first, at) = *published.iter().find(|(one, _)| *one == topic).unwrap();
                assert_eq!(first, topic);
                let due = (1..)
                    .map(|n| tick * ticks * n)
                    .find(|due| *due > ms(wait))
                    .unwrap();
                let late = at.saturating_sub(due);
                assert!(
                    at >= due && late <= ms(1),
                    "{topic:?} {wait}: {at:?}, due {due:?}"
                );
            }
        }
    });
}

/// A message that ends the rest may come when the wake-up is already due.
#[test]
fn a_subscription_at_the_time_of_a_wake_up_does_not_double_the_messages() {
    for microseconds in [99_999, 100_000, 100_001, 100_999, 101_000, 101_500, 102_000] {
        in_virtual_time(async move {
            let (arm, published) = arm();
            sleep(Duration::from_micros(microseconds)).await;
            want(&arm, Topic::JointStates, true).await;
            sleep(ms(1000)).await;
            let count = published.borrow().len();
            assert!(
                (59..=62).contains(&count),
                "{count} after {microseconds} us"
            );
        });
    }
}
