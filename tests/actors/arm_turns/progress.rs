//! Progress of a goal while clients step the arm.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::task::Poll;

use super::*;
use glam::DVec2;
use pendularm::actors::arm::sim::{AddBarrier, CommandGoal, GoalOrder, GoalProgress, TrackGoal};
use pendularm::actors::node::Barrier;
use pendularm::math::goal::Criteria;

/// Replaces the owner of a goal. Records the goal's time at each progress, and whose turn it was.
struct Owner {
    turns: Rc<Cell<u64>>,
    received: Rc<RefCell<Vec<(f64, u64)>>>,
}

impl Actor for Owner {
    type Context = Context<Self>;
}

impl Handler<GoalProgress<3>> for Owner {
    type Result = ();

    fn handle(&mut self, judged: GoalProgress<3>, _: &mut Context<Self>) {
        let received = (judged.elapsed, self.turns.get());
        self.received.borrow_mut().push(received);
    }
}

/// Stands in for the registry: the messages about the goal before each barrier.
struct Publisher {
    received: Rc<RefCell<Vec<(f64, u64)>>>,
    before: Rc<RefCell<Vec<usize>>>,
}

impl Actor for Publisher {
    type Context = Context<Self>;
}

impl Handler<Barrier> for Publisher {
    type Result = ();

    fn handle(&mut self, _: Barrier, _: &mut Context<Self>) {
        let before = self.received.borrow().len();
        self.before.borrow_mut().push(before);
    }
}

/// Each step of a second is reported separately, also if there are ten thousand. The next step waits until the report has
/// been published.
#[test]
fn progress_of_a_goal_is_sent_step_by_step_however_many_clients_step_the_arm() {
    in_virtual_time(async {
        let bench = TurnsBench::paused().await;
        let (turns, received) = (Rc::new(Cell::new(0)), Rc::default());
        let others = Rc::clone(&turns);
        // Another task that always has work.
        actix_rt::spawn(std::future::poll_fn(move |cx| {
            others.set(others.get() + 1);
            cx.waker().wake_by_ref();
            Poll::<()>::Pending
        }));
        let owner = Owner {
            turns,
            received: Rc::clone(&received),
        };
        let before = Rc::default();
        let publisher = Publisher {
            received: Rc::clone(&received),
            before: Rc::clone(&before),
        };
        let publisher = publisher.start().recipient();
        bench.arm.send(AddBarrier(publisher)).await.unwrap();
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
        let owner = owner.start();
        let goal = GoalOrder {
            number: 1,
            target: DVec2::new(0.0, 1.0),
            criteria: Criteria::default(),
            solution: rest,
        };
        let owner = owner.clone().recipient();
        bench.arm.send(TrackGoal { goal, owner }).await.unwrap();
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
