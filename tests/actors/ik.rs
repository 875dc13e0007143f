//! `/ik/solve` as its node does it, before an arm that stands wherever a test puts it.

use std::cell::Cell;
use std::rc::Rc;

use crate::askers::JsonCaller;
use crate::stage::numbers;
use crate::system::in_virtual_time;
use actix::prelude::*;
use pendularm::actors::arm::ik::{Ik, Solve, SolveError};
use pendularm::actors::arm::sim::{ArmPose, Pose};
use pendularm::actors::node::ask;
use pendularm::math::kinematics::{Target, solve};
use pendularm::protocol::catalog::Service;
use serde_json::{Value, json};

/// An arm that stands still, and counts how often it is asked.
struct StandIn<const N: usize> {
    pose: Rc<Cell<Pose<N>>>,
    asked: Rc<Cell<u32>>,
}

impl<const N: usize> Actor for StandIn<N> {
    type Context = Context<Self>;
}

impl<const N: usize> Handler<ArmPose<N>> for StandIn<N> {
    type Result = Pose<N>;

    fn handle(&mut self, _: ArmPose<N>, _: &mut Context<Self>) -> Pose<N> {
        self.asked.set(self.asked.get() + 1);
        self.pose.get()
    }
}

struct IkBench<const N: usize> {
    pose: Rc<Cell<Pose<N>>>,
    asked: Rc<Cell<u32>>,
    ik: Addr<Ik<N>>,
    client: JsonCaller,
}

impl<const N: usize> IkBench<N> {
    fn new(lengths: [f64; N], positions: [f64; N]) -> Self {
        let pose = Rc::new(Cell::new(Pose {
            lengths,
            positions,
            time: 0.0,
            resets: 0,
            simulated: 0.0,
            obstacle: None,
        }));
        let asked = Rc::default();
        let arm = StandIn {
            pose: Rc::clone(&pose),
            asked: Rc::clone(&asked),
        };
        let ik = Ik::new(arm.start().recipient()).start();
        Self {
            pose,
            asked,
            client: JsonCaller::of(|routes| Ik::attach(&ik, routes)),
            ik,
        }
    }

    /// The answer to a client that asks for this.
    async fn read_and_solve(&mut self, args: Value) -> [f64; N] {
        let values = self.client.values(Service::Solve, &args).await;
        assert_eq!(values.as_object().unwrap().len(), 1);
        numbers(&values["positions"]).try_into().unwrap()
    }

    async fn ask(&self, target: Target) -> Result<[f64; N], SolveError> {
        let answer = ask(&self.ik.clone().recipient(), Solve(target)).await;
        answer.expect("the node answers")
    }

    async fn solve(&self, target: Target) -> [f64; N] {
        self.ask(target).await.unwrap()
    }

    async fn refusal(&self, target: Target) -> String {
        self.ask(target).await.unwrap_err().to_string()
    }
}

/// A target without an orientation.
fn at(x: f64, y: f64) -> Target {
    Target {
        position: glam::dvec2(x, y),
        orientation: None,
    }
}

fn turned(target: Target, phi: f64) -> Target {
    let orientation = Some(phi);
    Target {
        orientation,
        ..target
    }
}

/// The closed form is tested in `tests/math/kinematics/`; here, that lengths and pose are the arm's at every call.
#[test]
fn a_solution_is_the_closed_form_for_the_arms_present_lengths_and_pose() {
    in_virtual_time(async {
        let bench = IkBench::new([1.0, 1.0, 0.5], [0.0; 3]);
        let target = turned(at(1.2, 0.3), 0.4);
        for (count, lengths, positions) in [
            (1, [1.0, 1.0, 0.5], [0.0, 0.5, 0.2]),
            (2, [1.0, 1.0, 0.5], [1.5, -1.0, 0.3]),
            (3, [1.5, 1.0, 0.5], [1000.0, -2000.0, 3000.0]),
        ] {
            let pose = bench.pose.get();
            bench.pose.set(Pose {
                lengths,
                positions,
                ..pose
            });
            for target in [at(1.2, 0.3), target] {
                let solved = solve(&lengths, &positions, &target).unwrap();
                assert_eq!(bench.solve(target).await, solved);
            }
            assert_eq!(bench.asked.get(), 2 * count);
        }
        let refused = solve(&[1.5, 1.0, 0.5], &[0.0; 3], &at(9.0, 0.0)).unwrap_err();
        assert_eq!(bench.refusal(at(9.0, 0.0)).await, refused.to_string());
    });
}

#[test]
fn a_node_that_asks_gets_what_a_client_gets() {
    in_virtual_time(async {
        let mut bench = IkBench::new([1.0; 3], [0.0; 3]);
        let named = bench
            .read_and_solve(json!({"x": 1, "y": 0.5, "phi": 1}))
            .await;
        let target = turned(at(1.0, 0.5), 1.0);
        let solved = ask(&bench.ik.clone().recipient(), Solve(target)).await;
        assert_eq!(solved, Ok(Ok(named)));
    });
}

/// An arm that has ended.
struct Gone;

impl Actor for Gone {
    type Context = Context<Self>;

    fn started(&mut self, ctx: &mut Context<Self>) {
        ctx.stop();
    }
}

impl Handler<ArmPose<2>> for Gone {
    type Result = Pose<2>;

    fn handle(&mut self, _: ArmPose<2>, _: &mut Context<Self>) -> Pose<2> {
        unreachable!("it has ended")
    }
}

#[test]
fn without_an_arm_the_caller_is_told_so() {
    in_virtual_time(async {
        let gone = Gone.start();
        while gone.connected() {
            tokio::task::yield_now().await;
        }
        let ik = Ik::<2>::new(gone.recipient()).start();
        let target = at(1.0, 0.0);
        let answer = ask(&ik.recipient(), Solve(target)).await;
        assert_eq!(answer, Ok(Err(SolveError::NoArm)));
    });
}
