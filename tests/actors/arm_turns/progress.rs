//! Progress of a goal while clients step the arm.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::task::Poll;

use super::*;
use glam::DVec2;
use pendularm::actors::arm::sim::{CommandGoal, Connect, GoalOrder, GoalProgress, TrackGoal};
use pendularm::actors::node::Barrier;
use pendularm::math::goal::Criteria;
use pendularm::math::kinematics::Target;

/// Each step of a second is reported separately, also if there are ten thousand. The next step waits until the report has
/// been published.
#[test]
fn progress_of_a_goal_is_sent_step_by_step_however_many_clients_step_the_arm() {
    in_virtual_time(async {
        let bench = TurnsBench::paused().await;
        let turns = Rc::new(Cell::new(0));
        let others = Rc::clone(&turns);
        // Another task that always has work.
        actix_rt::spawn(std::future::poll_fn(move |cx| {
            others.set(others.get() + 1);
            cx.waker().wake_by_ref();
            Poll::<()>::Pending
        }));
        // The goal's time at each progress, and whose turn it was.
        let received: Rc<RefCell<Vec<(f64, u64)>>> = Rc::default();
        let log = Rc::clone(&received);
        let owner = stand_in(move |judged: GoalProgress<3>| {
            log.borrow_mut().push((judged.elapsed, turns.get()));
        });
        // The number of reports before each barrier of the registry.
        let before: Rc<RefCell<Vec<usize>>> = Rc::default();
        let (log, barriers) = (Rc::clone(&received), Rc::clone(&before));
        let publisher = stand_in(move |_: Barrier| barriers.borrow_mut().push(log.borrow().len()));
        let owners = vec![publisher];
        let study = None;
        bench.arm.send(Connect { study, owners }).await.unwrap();
        let long = SetIntegrator {
            timestep: Some(1.0),
            ..SetIntegrator::default()
        };
        let weightless = SetParams {
            gravity: Some(0.0),
            ..SetParams::default()
        };
        bench.ask(0, long);
        bench.ask(0, weightless);
        let rest = [0.0; 3];
        let goal = GoalOrder {
            number: 1,
            target: Target {
                position: DVec2::new(0.0, 1.0),
                orientation: None,
            },
            criteria: Criteria::default(),
        };
        let tracking = bench.arm.send(TrackGoal { goal, owner }).await;
        assert!(tracking.unwrap().is_ok());
        let (number, positions) = (1, rest);
        let command = CommandGoal { number, positions };
        bench.arm.send(command).await.unwrap();
        for client in 1..=5 {
            bench.step(client, 1000);
        }
        while bench.answered() < 7 {
            advance(Duration::from_millis(1)).await;
        }
        // The last ones are still in the mailbox.
        advance(Duration::from_millis(1)).await;
        let received = received.borrow();
        assert_eq!(received.len(), 5000);
        assert!(received.is_sorted());
        assert!(before.borrow().iter().copied().eq(1..=5000));
        let most = received.chunk_by(|(_, one), (_, other)| one == other);
        let most = most.map(<[_]>::len).max().unwrap();
        assert_eq!(most, 1, "in a turn");
    });
}
