//! The node `study` on the worker pool; and, in virtual time, the arm's questions to it and words about its timestep.
//!
//! The node is asked as another node asks it; a client's calls are here where it is meant what is made of their fields,
//! and how an answer is written.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::stage::{in_virtual_time, ms, pass};
use actix::prelude::*;
use pendularm::actors::ConnectionId;
use pendularm::actors::arm::sim::{
    ArmSettings, ArmSim, Consult, Enable, HeldLimit, LEAST_PAUSE, Pause, Present, Reset, SetGains,
    SetIntegrator, SetParams, SetSetpoint, TakeSnapshot,
};
use pendularm::actors::compute::integration::{Integration, IntegrationStep};
use pendularm::actors::compute::study::{
    NotPlanned, NotRun, PlanRun, PredictStability, RunOffline, Study, SuggestGains,
};
use pendularm::actors::compute::workers::WorkerPool;
use pendularm::actors::node::{
    Ask, Asker, Call, Done, Interest, Publish, Reply, Respond, Unserved, ask,
};
use pendularm::actors::resources::gauges::Gauges;
use pendularm::actors::resources::work_clock;
use pendularm::actors::wire::{Caller, Nodes, ServiceCall};
use pendularm::math::arm::{Arm, State};
use pendularm::math::integrator::Method;
use pendularm::math::pid::{Gains, Setpoint};
use pendularm::math::simulation::Simulation;
use pendularm::protocol::catalog::{Service, Topic};
use pendularm::protocol::op::Arguments;
use pendularm::study::control_loop::ControlLoop;
use pendularm::study::error_estimate::estimate;
use pendularm::study::gains::{GainsSearch, Wish};
use pendularm::study::linear::no_control;
use pendularm::study::motion::Motion;
use pendularm::study::planner::{Planning, Task};
use pendularm::study::stability::{Limits, limit_held, limits};
use serde_json::value::to_raw_value;
use serde_json::{Value, json};
use tokio::sync::{mpsc, oneshot};
use tokio::time::{sleep, timeout};

/// How long anything may take before a test gives up.
const PATIENCE: Duration = Duration::from_secs(20);

/// Stands in for a client that has called: says that it has its answer, and hands it on.
struct Asking<T> {
    connection: u64,
    gone: Arc<AtomicBool>,
    answered: mpsc::UnboundedSender<u64>,
    answer: oneshot::Sender<Result<T, Unserved>>,
}

impl<T: Send> Asker<T> for Asking<T> {
    fn answer(self: Box<Self>, answer: Result<T, Unserved>, _: Option<Done>) {
        let _ = self.answered.send(self.connection);
        let _ = self.answer.send(answer);
    }

    fn client(&self) -> Option<ConnectionId> {
        Some(ConnectionId(self.connection))
    }

    fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }
}

/// A call on its way: its answer and its end to come, and the flag that its caller has gone.
struct Called<T> {
    answer: oneshot::Receiver<Result<T, Unserved>>,
    ended: oneshot::Receiver<()>,
    gone: Arc<AtomicBool>,
}

/// Asks as the client of that connection, which says so once it has its answer.
fn call<A: Ask>(
    node: &Recipient<Call<A>>,
    connection: u64,
    answered: &mpsc::UnboundedSender<u64>,
    ask: A,
) -> Called<A::Answer> {
    let gone = Arc::new(AtomicBool::new(false));
    let (done, ended) = oneshot::channel();
    let (give, answer) = oneshot::channel();
    let asking = Asking {
        connection,
        gone: Arc::clone(&gone),
        answered: answered.clone(),
        answer: give,
    };
    let reply = Reply::new(asking, Some(done));
    node.do_send(Call { ask, reply });
    Called {
        answer,
        ended,
        gone,
    }
}

// ---- the node, on real workers --------------------------------------------------------------------------------------

/// Stands in for the registry; passes on every response.
struct Probe(mpsc::UnboundedSender<Value>);

impl Actor for Probe {
    type Context = Context<Self>;
}

impl Handler<Respond> for Probe {
    type Result = ();

    fn handle(&mut self, respond: Respond, _: &mut Context<Self>) {
        let frame = serde_json::from_slice(&respond.frame.write()).expect("valid JSON");
        let _ = self.0.send(frame);
    }
}

/// An arm with settings of its own, none of them the default.
struct SettledArm<const N: usize>;

impl<const N: usize> Actor for SettledArm<N> {
    type Context = Context<Self>;
}

fn settings<const N: usize>() -> Present<N> {
    Present {
        control: ControlLoop {
            arm: Arm::new([0.8; N], [1.5; N], 3.7).unwrap(),
            gains: Gains {
                kp: [300.0; N],
                ki: [50.0; N],
                kd: [20.0; N],
            },
            setpoint: Setpoint {
                position: [0.4; N],
                velocity: [0.0; N],
            },
            method: Method::Midpoint,
            timestep: 0.002,
        },
        state: State {
            position: [0.3; N],
            velocity: [-0.2; N],
        },
    }
}

/// The same as a client would write it.
fn settings_as_args<const N: usize>() -> Value {
    json!({
        "integrator": "midpoint",
        "gains": {"kp": vec![300.0; N], "ki": vec![50.0; N], "kd": vec![20.0; N]},
        "params": {"gravity": 3.7, "masses": vec![1.5; N], "lengths": vec![0.8; N]},
        "setpoint": vec![0.4; N],
    })
}

impl<const N: usize> Handler<ArmSettings<N>> for SettledArm<N> {
    type Result = Present<N>;

    fn handle(&mut self, _: ArmSettings<N>, _: &mut Context<Self>) -> Present<N> {
        settings()
    }
}

struct Bench<const N: usize> {
    pool: WorkerPool,
    study: Addr<Study<N>>,
    probe: Addr<Probe>,
    responses: mpsc::UnboundedReceiver<Value>,
    answered: mpsc::UnboundedSender<u64>,
    order: mpsc::UnboundedReceiver<u64>,
}

impl<const N: usize> Bench<N> {
    /// With one worker, so that turns can be told from luck.
    fn new() -> Self {
        let (sender, responses) = mpsc::unbounded_channel();
        let (answered, order) = mpsc::unbounded_channel();
        let pool = WorkerPool::start(1).unwrap();
        let arm = SettledArm::<N>.start();
        Self {
            study: Study::new(arm.recipient(), pool.clone()).start(),
            pool,
            probe: Probe(sender).start(),
            responses,
            answered,
            order,
        }
    }

    fn call<A: Ask>(&self, connection: u64, ask: A) -> Called<A::Answer>
    where
        Study<N>: Actor<Context = Context<Study<N>>> + Handler<Call<A>>,
    {
        let node = self.study.clone().recipient();
        call(&node, connection, &self.answered, ask)
    }

    /// The connection whose call is answered next.
    async fn next(&mut self) -> u64 {
        let next = timeout(PATIENCE, self.order.recv()).await;
        next.expect("an answer in time").expect("the bench lives")
    }

    async fn ask<A: Ask>(&self, question: A) -> A::Answer
    where
        Study<N>: Actor<Context = Context<Study<N>>> + Handler<Call<A>>,
    {
        let answer = ask(&self.study.clone().recipient(), question);
        let answer = timeout(PATIENCE, answer).await;
        answer.expect("an answer in time").expect("an answer")
    }

    /// The response to a client's call.
    async fn response(&mut self, service: Service, args: &Value) -> Value {
        let (caller, _) = Caller::new(
            self.probe.clone().recipient(),
            ConnectionId(1),
            service,
            service.name().into(),
            None,
            Arc::default(),
        );
        let mut routes = Nodes::default();
        Study::attach(&self.study, &mut routes);
        routes.services[&service](ServiceCall {
            service,
            arguments: Arguments::Object(to_raw_value(args).unwrap().into()),
            caller,
        });
        let response = timeout(PATIENCE, self.responses.recv()).await;
        response
            .expect("a response in time")
            .expect("the probe lives")
    }

    async fn values(&mut self, service: Service, args: &Value) -> Value {
        let response = self.response(service, args).await;
        assert_eq!(response["result"], true, "{response}");
        assert_eq!(response["status"], "", "{response}");
        response["values"].clone()
    }

    async fn refusal(&mut self, service: Service, args: &Value) -> String {
        let response = self.response(service, args).await;
        assert_eq!(
            (&response["result"], &response["values"]),
            (&json!(false), &json!({})),
            "{response}"
        );
        response["status"].as_str().unwrap().to_owned()
    }
}

impl<const N: usize> Drop for Bench<N> {
    fn drop(&mut self) {
        self.pool.close("the test is over");
    }
}

/// The values that the service gives of these limits and this motion.
fn stability_values<const N: usize>(limits: &Limits<N>, motion: &Motion) -> Value {
    let critical = limits.critical.unwrap();
    let bears = Some(motion.timestep).filter(|timestep| timestep.is_finite());
    let advised = [limits.advised, bears.map(|timestep| 0.8 * timestep)];
    json!({
        "timestep_limit_held": limits.held,
        "timestep_limit_continuous": limits.continuous,
        "equilibrium": limits.equilibrium.to_vec(),
        "equilibrium_kind": limits.rest.name(),
        "minimum_over_poses_held": limits.minimum_held,
        "minimum_over_poses_continuous": limits.minimum_continuous,
        "minimum_over_poses_bound": limits.bound,
        "certified": limits.certified,
        "worst_pose": limits.worst_pose.map(|pose| pose.to_vec()),
        "critical": {
            "growth_per_step": critical.growth_per_step,
            "frequency": critical.frequency,
            "joint": critical.joint,
        },
        "timestep_limit_motion": bears,
        "motion_speed": motion.speed,
        "advised_timestep": advised.into_iter().flatten().reduce(f64::min),
    })
}

async fn assert_predictions_are_the_studys<const N: usize>() {
    let mut bench = Bench::<N>::new();
    let Present { control, state } = settings::<N>();
    let expected = limits(&control);
    let motion = Motion::ahead(&control, &state);
    assert!(expected.held.is_some_and(|limit| limit > 0.0));
    let predicted = bench.ask(PredictStability::default()).await.unwrap();
    assert_eq!((predicted.limits, predicted.motion), (expected, motion));
    let written = stability_values(&expected, &motion);
    let all = settings_as_args::<N>();
    let nulls =
        json!({"integrator": null, "gains": {"kp": null}, "params": null, "setpoint": null});
    for args in [json!({}), all, nulls] {
        assert_eq!(bench.values(Service::Stability, &args).await, written);
    }
}

#[test]
fn the_predictions_are_the_studys_and_what_is_left_out_is_the_arms_own() {
    System::new().block_on(async {
        assert_predictions_are_the_studys::<2>().await;
        assert_predictions_are_the_studys::<3>().await;
    });
}

#[test]
fn members_that_are_left_out_of_an_object_are_the_arms_own() {
    System::new().block_on(async {
        let bench = Bench::<2>::new();
        let predicted = bench
            .ask(PredictStability {
                gains: Some(SetGains {
                    kd: Some([9.0, 4.0]),
                    ..SetGains::default()
                }),
                params: Some(gravity(0.0)),
                method: Some(Method::Rk4),
                setpoint: None,
            })
            .await
            .unwrap();
        let mut control = settings::<2>().control.with_method(Method::Rk4);
        control.arm = Arm::new(*control.arm.lengths(), *control.arm.masses(), 0.0).unwrap();
        control.gains.kd = [9.0, 4.0];
        assert_eq!(predicted.limits, limits(&control));
    });
}

/// Without gravity and control nothing limits; Euler on a free swing is stable at no timestep.
#[test]
fn no_limit_is_null_and_no_stable_timestep_is_zero() {
    System::new().block_on(async {
        let mut bench = Bench::<2>::new();
        let none = json!({"kp": [0, 0], "ki": [0, 0], "kd": [0, 0]});
        let args = json!({"gains": none, "params": {"gravity": 0}});
        let values = bench.values(Service::Stability, &args).await;
        for limit in [
            "timestep_limit_held",
            "timestep_limit_continuous",
            "minimum_over_poses_held",
            "minimum_over_poses_continuous",
            "minimum_over_poses_bound",
            "worst_pose",
            "critical",
        ] {
            assert!(values[limit].is_null(), "{limit} {values}");
        }
        // The motion alone limits: 0.2 and 0.4 rad/s of the links, all of whose energy one of them might have.
        let speed = values["motion_speed"].as_f64().unwrap();
        assert!((0.4..2.0).contains(&speed), "{values}");
        assert_eq!(values["timestep_limit_motion"], 0.3 / speed);
        assert_eq!(values["advised_timestep"], 0.8 * (0.3 / speed));
        let args = json!({"gains": none, "integrator": "euler"});
        let values = bench.values(Service::Stability, &args).await;
        assert_eq!(values["timestep_limit_held"], 0.0, "{values}");
        assert_eq!(values["advised_timestep"], 0.0, "{values}");
    });
}

/// The search for gains and for a plan are the library's; what is left out is the arm's own.
#[test]
fn advice_is_the_studys_and_what_is_left_out_is_the_arms_own() {
    System::new().block_on(async {
        let mut bench = Bench::<2>::new();
        let Present { control, state } = settings::<2>();
        let wish = Wish {
            settling_time: 4.0,
            margin: 1.25,
        };
        let mut search = GainsSearch::new(&control, wish).unwrap();
        let found = loop {
            if let Some(found) = search.advance() {
                break found.unwrap();
            }
        };
        let suggested = bench.ask(SuggestGains::default()).await.unwrap();
        assert_eq!(suggested.found, found);
        assert_eq!(suggested.timestep, control.timestep);
        let values = bench.values(Service::SuggestGains, &json!({})).await;
        assert_eq!(values["kp"], json!(found.gains.kp));
        assert_eq!(values["timestep_limit"], json!(found.limit));
        let task = Task {
            control,
            start: state,
            duration: 4.0,
            error: 0.05,
        };
        let mut planning = Planning::new(task).unwrap();
        let planned = loop {
            if let Some(planned) = planning.advance() {
                break planned.unwrap();
            }
        };
        let run = bench.ask(plan_with(0.05)).await.unwrap();
        assert_eq!(run.planned, planned);
        assert!(run.controlled);
        let args = json!({"error": 0.05, "servo": true});
        let values = bench.values(Service::Plan, &args).await;
        let best = planned.best().unwrap();
        assert_eq!(values["integrator"], best.method.name());
        assert_eq!(values["timestep"], json!(best.timestep));
        assert_eq!(
            bench
                .refusal(Service::Plan, &json!({"error": -1, "servo": 1}))
                .await,
            "error must be greater than 0, got -1; servo must be true or false, got 1"
        );
        let tiny = SuggestGains {
            timestep: Some(2_f64.powi(-20)),
            ..SuggestGains::default()
        };
        let refused = bench.ask(tiny).await.unwrap_err();
        assert_eq!(
            refused.to_string(),
            "settling_time / timestep must be at most 1e6 steps, got 4.194304e6"
        );
        let too_long = PlanRun {
            duration: Some(1e9),
            ..plan_with(0.05)
        };
        let refused = bench.ask(too_long).await.unwrap_err();
        assert!(matches!(refused, NotPlanned::Plan(_)), "{refused}");
    });
}

/// A servo's plan of which only the allowed error is said.
fn plan_with(error: f64) -> PlanRun<2> {
    PlanRun {
        error,
        duration: None,
        servo: true,
        q0: None,
        qdot0: None,
        params: None,
        gains: None,
        setpoint: None,
    }
}

#[test]
fn every_field_that_is_wrong_is_named_members_with_their_object() {
    System::new().block_on(async {
        let mut bench = Bench::<2>::new();
        let common = [
            (json!({"gains": {"kp": [1, -2]}}), "gains.kp[1] must be at least 0, got -2"),
            (json!({"gains": {"ki": [1]}}), "gains.ki must have 2 entries, got 1"),
            (json!({"gains": {"kd": 3}}), "gains.kd must be an array of 2 numbers, got 3"),
            (json!({"gains": [1, 2, 3]}), "gains must be an object, got an array"),
            (json!({"gains": true}), "gains must be an object, got true"),
            (json!({"params": {"masses": [0, 1]}}), "params.masses[0] must be greater than 0, got 0"),
            (json!({"params": {"lengths": ["a", 1]}}), "params.lengths[0] must be a number, got \"a\""),
            (json!({"params": {"gravity": -1}}), "params.gravity must be at least 0, got -1"),
            (json!({"setpoint": [1, 2, 3]}), "setpoint must have 2 entries, got 3"),
            (json!({"integrator": "heun"}), "integrator must be one of euler, midpoint, verlet, rk4, got \"heun\""),
            (json!({"integrator": 1, "params": {"gravity": "g"}, "setpoint": 0, "gains": {"kp": 1}}),
             "integrator must be one of euler, midpoint, verlet, rk4, got 1; gains.kp must be an array of 2 numbers, got 1; \
              params.gravity must be a number, got \"g\"; setpoint must be an array of 2 numbers, got 0"),
        ];
        for (args, why) in &common {
            assert_eq!(bench.refusal(Service::Stability, args).await, *why);
        }
        for (args, why) in &common[..10] {
            assert_eq!(bench.refusal(Service::Rollout, args).await, *why);
        }
        for (args, why) in [
            (json!({"q0": [1]}), "q0 must have 2 entries, got 1"),
            (json!({"qdot0": [1, true]}), "qdot0[1] must be a number, got true"),
            (json!({"duration": 0}), "duration must be greater than 0, got 0"),
            (json!({"timestep": -1}), "timestep must be greater than 0, got -1"),
            (json!({"samples": 0}), "samples must be an integer, at least 1, got 0"),
            (json!({"samples": 1}), "samples must be between 2 and 100000, got 1"),
            (json!({"samples": 100_001}), "samples must be at most 100000, got 100001"),
            (json!({"samples": 2.5}), "samples must be an integer, at least 1, got 2.5"),
            (json!({"reference": 1}), "reference must be true or false, got 1"),
            (json!({"duration": 1, "timestep": 2}), "duration must be at least the timestep 2, got 1"),
            (json!({"duration": 20, "timestep": 1e-6}), "duration / timestep must be at most 10000000 steps, got 20000000"),
        ] {
            assert_eq!(bench.refusal(Service::Rollout, &args).await, why);
        }
        let too_long = RunOffline { duration: Some(20.0), timestep: Some(1e-6), ..RunOffline::default() };
        assert!(matches!(bench.ask(too_long).await, Err(NotRun::Plan(_))));
    });
}

fn joints(values: &Value) -> Vec<[f64; 2]> {
    serde_json::from_value(values.clone()).unwrap()
}

/// Against the live arm's stepper, asked for every sample; the numbers as written read back as the same bits.
#[test]
fn a_rollout_is_the_live_simulation_bit_for_bit() {
    System::new().block_on(async {
        let mut bench = Bench::<2>::new();
        for method in Method::ALL {
            for controlled in [false, true] {
                let mut args = json!({"q0": [0.4, -0.3], "qdot0": [0.5, 1], "duration": 1, "timestep": 0.005,
                    "samples": 51, "integrator": method.name(), "setpoint": [1, -0.5],
                    "params": {"gravity": 9.81, "masses": [1, 2], "lengths": [1, 0.5]}});
                let mut live = Simulation::new(
                    Arm::new([1.0, 0.5], [1.0, 2.0], 9.81).unwrap(),
                    Gains { kp: [200.0, 100.0], ki: [20.0, 0.0], kd: [30.0, 12.0] },
                );
                if controlled {
                    args["gains"] = json!({"kp": [200, 100], "ki": [20, 0], "kd": [30, 12]});
                    live.enable(true);
                }
                live.set_method(method);
                live.set_timestep(0.005);
                live.set_state(State { position: [0.4, -0.3], velocity: [0.5, 1.0] });
                live.set_setpoint(Setpoint { position: [1.0, -0.5], velocity: [0.0; 2] });
                let values = bench.values(Service::Rollout, &args).await;
                let times: Vec<f64> = serde_json::from_value(values["times"].clone()).unwrap();
                assert_eq!(times.len(), 51);
                let (positions, velocities) = (joints(&values["positions"]), joints(&values["velocities"]));
                let efforts = joints(&values["efforts"]);
                assert_eq!(efforts[0], [0.0; 2]);
                for k in 0..51 {
                    assert_eq!(times[k], live.time());
                    assert_eq!(positions[k], live.state().position, "{method}, sample {k}");
                    assert_eq!(velocities[k], live.state().velocity);
                    assert_eq!(efforts[k], *live.effort());
                    live.advance(4);
                }
                assert_eq!(values["energy"].as_array().unwrap().len(), 51);
                assert_eq!(values["evaluations"], 200 * method.evaluations());
                assert_eq!(values["error"], Value::Null, "no reference was asked for");
                assert_eq!(values["error_uncertainty"], Value::Null);
                assert!(values["wall_time"].as_f64().unwrap() > 0.0);
                assert_eq!(values.as_object().unwrap().len(), 9);
            }
        }
    });
}

#[test]
fn an_empty_rollout_is_ten_seconds_of_the_present_arm_left_to_itself() {
    System::new().block_on(async {
        let bench = Bench::<3>::new();
        let run = bench.ask(RunOffline::default()).await.unwrap().run;
        let mut live = Simulation::new(settings::<3>().control.arm, no_control());
        live.set_method(Method::Midpoint);
        live.set_timestep(0.002);
        live.advance(5000);
        assert_eq!(run.times().len(), 1001);
        assert_eq!(run.times()[1000], live.time());
        assert_eq!(run.positions()[1000], live.state().position);
        assert_eq!(run.positions()[0], [0.0; 3]);
        assert_eq!(run.evaluations(), 10_000);
    });
}

/// At the same timestep the order tells; the reference changes neither the samples nor what counts as evaluations.
#[test]
fn methods_can_be_compared_by_their_errors() {
    System::new().block_on(async {
        let bench = Bench::<2>::new();
        let control = SetGains {
            kp: Some([200.0, 100.0]),
            kd: Some([30.0, 12.0]),
            ..SetGains::default()
        };
        for gains in [None, Some(control)] {
            let mut errors = Vec::new();
            for method in [Method::Euler, Method::Midpoint, Method::Rk4] {
                let alone = RunOffline {
                    q0: Some([0.4, -0.3]),
                    duration: Some(1.0),
                    timestep: Some(0.005),
                    samples: Some(11),
                    method: Some(method),
                    gains: gains.clone(),
                    setpoint: Some([1.0, -0.5]),
                    ..RunOffline::default()
                };
                let compared = RunOffline {
                    reference: Some(true),
                    ..alone.clone()
                };
                let compared = bench.ask(compared).await.unwrap().run;
                errors.push(compared.deviation().unwrap().known().expect("finite"));
                let alone = bench.ask(alone).await.unwrap().run;
                assert!(alone.deviation().is_none(), "no reference was asked for");
                assert_eq!(compared.times(), alone.times());
                assert_eq!(compared.positions(), alone.positions());
                assert_eq!(compared.velocities(), alone.velocities());
                assert_eq!(compared.efforts(), alone.efforts());
                assert_eq!(compared.energy(), alone.energy());
                assert_eq!(compared.evaluations(), alone.evaluations());
            }
            // Orders 1, 2 and 4 at a timestep some fifty times shorter than the motion.
            assert!(
                errors[0] > 20.0 * errors[1] && errors[1] > 20.0 * errors[2],
                "{errors:?}"
            );
            assert!(errors[2] > 0.0);
        }
    });
}

#[test]
fn a_rollout_that_diverges_ends_with_its_last_finite_sample() {
    System::new().block_on(async {
        let mut bench = Bench::<2>::new();
        let args = json!({"integrator": "euler", "timestep": 1, "duration": 1000, "q0": [1, 1], "reference": true,
            "gains": {"kp": [1e9, 1e9], "ki": [0, 0], "kd": [1e9, 1e9]}});
        let values = bench.values(Service::Rollout, &args).await;
        let times = values["times"].as_array().unwrap();
        assert!(times.len() < 1001, "{}", times.len());
        for key in ["positions", "velocities", "efforts", "energy"] {
            assert_eq!(values[key].as_array().unwrap().len(), times.len());
        }
        assert!(values["positions"].to_string().len() > 10);
        assert!(!values["positions"].to_string().contains("null"));
    });
}

/// Minutes of work in an unoptimised build; no test waits for its end.
fn heavy() -> RunOffline<2> {
    RunOffline {
        duration: Some(10.0),
        timestep: Some(1e-6),
        reference: Some(true),
        gains: Some(SetGains {
            kp: Some([1.0; 2]),
            ..SetGains::default()
        }),
        ..RunOffline::default()
    }
}

/// Ten steps.
fn short<const N: usize>() -> RunOffline<N> {
    RunOffline {
        duration: Some(0.01),
        timestep: Some(0.001),
        ..RunOffline::default()
    }
}

#[test]
fn what_is_light_is_answered_while_what_is_heavy_takes_turns_with_it() {
    System::new().block_on(async {
        let mut bench = Bench::<2>::new();
        let heavy = bench.call(1, heavy());
        bench.call(2, short());
        bench.call(3, short());
        let mut light = [bench.next().await, bench.next().await];
        light.sort_unstable();
        assert_eq!(light, [2, 3]);
        // A prediction is cut into slices too.
        let mut three = Bench::<3>::new();
        three.call(1, PredictStability::default());
        three.call(2, short());
        assert_eq!(three.next().await, 2);
        assert_eq!(three.next().await, 1);
        heavy.gone.store(true, Ordering::Relaxed);
        assert!(timeout(PATIENCE, heavy.ended).await.is_ok());
        assert_eq!(bench.next().await, 1);
        assert!(matches!(heavy.answer.await, Ok(Err(Unserved::CallerGone))));
    });
}

/// Turns of one worker until a client has its million steps, while so many others have begun heavy rollouts.
async fn turns_until_integrated(others: u64) -> u32 {
    let (answered, mut order) = mpsc::unbounded_channel();
    let pool = WorkerPool::without_threads();
    let study = Study::new(SettledArm::<2>.start().recipient(), pool.clone())
        .start()
        .recipient();
    let integration = Integration::new(pool.clone()).start().recipient();
    for connection in 1..=others {
        call(&study, connection, &answered, heavy());
    }
    // The study asks the arm first; a moment of virtual time passes when all wait.
    pass(ms(1)).await;
    for _ in 0..10 * others {
        assert!(pool.turn());
    }
    let step = IntegrationStep {
        function: Some("sin(t)".to_owned()),
        x0: Some(0.5),
        dt: Some(1e-3),
        steps: Some(1_000_000),
        method: Some(Method::Rk4),
        ..IntegrationStep::default()
    };
    let mut honest = call(&integration, 100, &answered, step);
    pass(ms(1)).await;
    let mut turns = 0;
    while honest.ended.try_recv() == Err(oneshot::error::TryRecvError::Empty) {
        assert!(pool.turn());
        turns += 1;
    }
    assert_eq!(order.recv().await, Some(100));
    assert!(matches!(honest.answer.await, Ok(Ok(Ok(_)))));
    pool.close("the test is over");
    turns
}

/// Each look at the clock costs the same here, so that turns can be counted on any machine.
#[test]
fn heavy_rollouts_delay_an_integration_by_its_fair_share_and_no_more() {
    in_virtual_time(async {
        work_clock::count(Duration::from_micros(100));
        let alone = turns_until_integrated(0).await;
        let among_six = turns_until_integrated(5).await;
        assert!(alone > 10, "{alone} turns: too few to be shared");
        let fair = 5 * alone..=6 * (alone + 1);
        assert!(
            fair.contains(&among_six),
            "{among_six} turns instead of {alone}"
        );
    });
}

#[test]
fn the_end_of_the_pool_refuses_what_runs_and_what_comes() {
    System::new().block_on(async {
        let mut bench = Bench::<2>::new();
        let (first, third) = (bench.call(1, heavy()), bench.call(3, heavy()));
        bench.call(2, PredictStability::default());
        while bench.pool.is_idle() {
            tokio::task::yield_now().await;
        }
        bench.pool.close("shutting down");
        let late = bench.call(4, heavy());
        let mut heard = Vec::new();
        for _ in 1..=4 {
            heard.push(bench.next().await);
        }
        heard.sort_unstable();
        assert_eq!(heard, [1, 2, 3, 4]);
        for refused in [first, third, late] {
            let answer = refused.answer.await.unwrap();
            assert!(matches!(answer, Err(Unserved::Refused("shutting down"))));
        }
        let control = settings::<2>().control;
        assert_eq!(bench.study.send(HeldLimit(control)).await.unwrap(), None);
    });
}

#[test]
fn the_arms_own_question_is_answered_by_the_pool() {
    System::new().block_on(async {
        let bench = Bench::<2>::new();
        let control = settings::<2>().control;
        let limit = bench.study.send(HeldLimit(control)).await.unwrap();
        assert_eq!(limit, limit_held(&control));
        let arm = Arm::new([1.0; 2], [1.0; 2], 0.0).unwrap();
        let free = ControlLoop {
            arm,
            gains: no_control(),
            ..control
        };
        let limit = bench.study.send(HeldLimit(free)).await.unwrap();
        assert_eq!(limit, Some(f64::INFINITY));
    });
}

// ---- the arm, in virtual time ---------------------------------------------------------------------------------------

/// Stands in for the study: keeps what it is asked, and always gives the same answer.
#[derive(Clone)]
struct Oracle {
    asked: Rc<RefCell<Vec<ControlLoop<2>>>>,
    limit: Rc<Cell<f64>>,
}

impl Actor for Oracle {
    type Context = Context<Self>;
}

impl Handler<HeldLimit<2>> for Oracle {
    type Result = Option<f64>;

    fn handle(&mut self, HeldLimit(control): HeldLimit<2>, _: &mut Context<Self>) -> Option<f64> {
        self.asked.borrow_mut().push(control);
        Some(self.limit.get())
    }
}

/// Stands in for the registry: keeps all that the arm says.
#[derive(Clone, Default)]
struct Ear {
    published: Rc<RefCell<Vec<(Topic, Value)>>>,
}

impl Actor for Ear {
    type Context = Context<Self>;
}

impl Handler<Publish> for Ear {
    type Result = ();

    fn handle(&mut self, publish: Publish, _: &mut Context<Self>) {
        let frame: Value = serde_json::from_slice(&publish.frame.write()).expect("valid JSON");
        let said = (publish.topic, frame["msg"].clone());
        self.published.borrow_mut().push(said);
    }
}

struct Stage {
    arm: Addr<ArmSim<2>>,
    oracle: Oracle,
    ear: Ear,
    gauges: Arc<Gauges>,
}

impl Stage {
    async fn new(limit: f64) -> Self {
        let oracle = Oracle {
            asked: Rc::default(),
            limit: Rc::new(Cell::new(limit)),
        };
        let ear = Ear::default();
        let gauges = Arc::new(Gauges::default());
        let arm = ArmSim::new(
            Arm::default(),
            Gains::default(),
            ear.clone().start().recipient(),
            Arc::clone(&gauges),
        )
        .start();
        let study = oracle.clone().start().recipient();
        arm.send(Consult(study)).await.unwrap();
        Self {
            arm,
            oracle,
            ear,
            gauges,
        }
    }

    async fn want(&self, topic: Topic, wanted: bool) {
        self.arm.send(Interest { topic, wanted }).await.unwrap();
    }

    /// Asks the arm as another node does.
    async fn ask<A: Ask>(&self, question: A)
    where
        ArmSim<2>: Handler<Call<A>>,
    {
        let answer = ask(&self.arm.clone().recipient(), question).await;
        assert!(answer.is_ok(), "an answer");
        tokio::task::yield_now().await;
    }

    async fn set_setpoint(&self, position: [f64; 2]) {
        let velocity = [0.0; 2];
        let (setpoint, done) = (Setpoint { position, velocity }, None);
        let held = SetSetpoint { setpoint, done };
        self.arm.send(held).await.unwrap();
    }

    /// Questions to the study since the last look, once there has been time to ask.
    async fn questions(&self) -> Vec<ControlLoop<2>> {
        sleep(Duration::from_millis(150)).await;
        std::mem::take(&mut self.oracle.asked.borrow_mut())
    }

    /// The messages on `topic` since the last look at anything.
    fn said(&self, topic: Topic) -> Vec<Value> {
        let said = std::mem::take(&mut *self.ear.published.borrow_mut());
        said.into_iter()
            .filter_map(|(of, msg)| (of == topic).then_some(msg))
            .collect()
    }
}

fn enable(on: bool) -> Enable {
    Enable {
        enabled: Some(on),
        ..Enable::default()
    }
}

fn pause(paused: bool) -> Pause {
    Pause {
        paused: Some(paused),
        ..Pause::default()
    }
}

fn integrator(timestep: Option<f64>, method: Option<Method>) -> SetIntegrator {
    SetIntegrator {
        timestep,
        method,
        ..SetIntegrator::default()
    }
}

fn gravity(gravity: f64) -> SetParams<2> {
    SetParams {
        gravity: Some(gravity),
        ..SetParams::default()
    }
}

fn value<'a>(message: &'a Value, key: &str) -> &'a str {
    let values = message["status"][0]["values"].as_array().unwrap();
    let entry = values.iter().find(|entry| entry["key"] == key).unwrap();
    entry["value"].as_str().unwrap()
}

#[test]
fn without_subscribers_no_limit_is_asked_for_and_no_error_estimated() {
    in_virtual_time(async {
        let stage = Stage::new(0.004).await;
        stage.want(Topic::JointStates, true).await;
        for timestep in [0.01, 0.02, 0.03] {
            stage
                .ask(integrator(Some(timestep), Some(Method::Verlet)))
                .await;
            stage.ask(enable(true)).await;
            stage.set_setpoint([timestep, 1.0]).await;
            sleep(Duration::from_secs(2)).await;
        }
        assert_eq!(stage.questions().await, []);
        assert_eq!(stage.gauges.error_estimates(), 0);
    });
}

#[test]
fn the_limit_is_asked_for_when_the_loop_in_force_changes_and_never_else() {
    in_virtual_time(async {
        let stage = Stage::new(0.004).await;
        stage.want(Topic::Diagnostics, true).await;
        let first = stage.questions().await;
        let free = ControlLoop::free(Arm::default());
        assert_eq!(first, [free]);
        sleep(Duration::from_secs(10)).await;
        assert_eq!(stage.questions().await, []);
        // Changes that do not bear on the loop in force: with the controller off, gains and setpoint too.
        stage.ask(integrator(Some(0.002), Some(Method::Rk4))).await;
        stage.ask(gravity(9.81)).await;
        stage
            .ask(SetGains {
                kp: Some([50.0, 50.0]),
                ..SetGains::default()
            })
            .await;
        stage.set_setpoint([1.0, -1.0]).await;
        stage.ask(pause(true)).await;
        stage.ask(pause(false)).await;
        assert_eq!(stage.questions().await, []);
        stage.ask(enable(true)).await;
        let gains = Gains {
            kp: [50.0; 2],
            ..Gains::default()
        };
        let setpoint = Setpoint {
            position: [1.0, -1.0],
            velocity: [0.0; 2],
        };
        let mut control = ControlLoop {
            gains,
            setpoint,
            timestep: 0.002,
            ..free
        };
        assert_eq!(stage.questions().await, [control]);
        stage.ask(integrator(None, Some(Method::Midpoint))).await;
        control.method = Method::Midpoint;
        assert_eq!(stage.questions().await, [control]);
        stage.ask(gravity(1.0)).await;
        control.arm = Arm::new([1.0; 2], [1.0; 2], 1.0).unwrap();
        assert_eq!(stage.questions().await, [control]);
        stage
            .ask(SetGains {
                ki: Some([0.0, 0.0]),
                ..SetGains::default()
            })
            .await;
        control.gains.ki = [0.0; 2];
        assert_eq!(stage.questions().await, [control]);
        stage.set_setpoint([0.5, 0.5]).await;
        control.setpoint.position = [0.5; 2];
        assert_eq!(stage.questions().await, [control]);
        stage.ask(Reset::default()).await;
        control.setpoint.position = [0.0; 2];
        assert_eq!(stage.questions().await, [control]);
        stage.want(Topic::Diagnostics, false).await;
        stage.set_setpoint([0.5, 0.5]).await;
        assert_eq!(stage.questions().await, []);
    });
}

/// A thousand setpoints a second for two seconds: twenty questions, and one at the start.
#[test]
fn a_stream_of_setpoints_costs_ten_predictions_a_second() {
    in_virtual_time(async {
        let stage = Stage::new(0.004).await;
        stage.ask(enable(true)).await;
        stage.want(Topic::Diagnostics, true).await;
        for k in 0..2000 {
            stage.set_setpoint([1e-4 * f64::from(k), 0.0]).await;
            sleep(Duration::from_millis(1)).await;
        }
        let questions = stage.questions().await;
        assert!((15..=22).contains(&questions.len()), "{}", questions.len());
        let last = questions.last().unwrap().setpoint.position;
        assert_eq!(last, [1e-4 * 1999.0, 0.0], "the latest has the last word");
    });
}

#[test]
fn a_warning_is_told_when_it_comes_and_when_it_goes_running_or_paused() {
    in_virtual_time(async {
        let stage = Stage::new(0.004).await;
        stage.ask(enable(true)).await;
        stage.want(Topic::Diagnostics, true).await;
        sleep(Duration::from_millis(2100)).await;
        for message in stage.said(Topic::Diagnostics) {
            assert_eq!(message["status"][0]["level"], 0);
            assert_eq!(
                (
                    value(&message, "timestep_limit"),
                    value(&message, "warning")
                ),
                ("0.004", "")
            );
        }
        for paused in [false, true] {
            let state = if paused { "paused" } else { "running" };
            stage.ask(pause(paused)).await;
            for (timestep, level) in [(0.005, 1), (0.004, 0)] {
                // Within a tick of the change, not a second later.
                sleep(Duration::from_millis(5)).await;
                stage.said(Topic::Diagnostics);
                stage.ask(integrator(Some(timestep), None)).await;
                sleep(Duration::from_millis(20)).await;
                let told = stage.said(Topic::Diagnostics);
                let status = &told[0]["status"][0];
                assert_eq!(
                    (&status["level"], &status["message"]),
                    (&json!(level), &json!(state))
                );
                let warning = value(&told[0], "warning");
                assert_eq!(
                    warning,
                    if level == 1 {
                        "the timestep 0.005 s exceeds 0.004 s, up to which rk4 is predicted to be stable at the present setpoint"
                    } else {
                        ""
                    }
                );
            }
        }
        stage.oracle.limit.set(0.0);
        stage.ask(enable(false)).await;
        sleep(Duration::from_millis(300)).await;
        let told = stage.said(Topic::Diagnostics);
        assert_eq!(
            value(told.last().unwrap(), "warning"),
            "rk4 is predicted to be unstable at every timestep with the controller off"
        );
    });
}

/// A setpoint that is dragged asks for a prediction now and then, not at every tick; the last one has its own.
#[test]
fn a_setpoint_that_goes_on_moving_is_predicted_now_and_then() {
    in_virtual_time(async {
        let stage = Stage::new(0.004).await;
        stage.want(Topic::Diagnostics, true).await;
        stage.ask(enable(true)).await;
        stage.questions().await;
        let time = Duration::from_secs(2);
        let moves = 100_u32;
        for n in 1..=moves {
            stage.set_setpoint([f64::from(n) * 1e-2, 0.0]).await;
            sleep(time / moves).await;
        }
        let asked = stage.questions().await;
        let most = usize::try_from(time.as_millis() / LEAST_PAUSE.as_millis()).unwrap() + 2;
        assert!(
            asked.len() > 5 && asked.len() <= most,
            "{} questions",
            asked.len()
        );
        let last = f64::from(moves) * 1e-2;
        assert_eq!(asked.last().unwrap().setpoint.position, [last, 0.0]);
    });
}

/// A limit of other gains says nothing: between the change and the answer the limit is unknown, and there is no warning.
#[test]
fn a_limit_of_another_loop_is_never_held_against_the_arm() {
    in_virtual_time(async {
        let stage = Stage::new(0.0).await;
        stage.want(Topic::Diagnostics, true).await;
        // Between two ticks, so that none comes between the change and the message.
        sleep(Duration::from_millis(508)).await;
        stage.said(Topic::Diagnostics);
        stage.oracle.limit.set(0.004);
        stage.ask(enable(true)).await;
        stage.ask(pause(true)).await;
        sleep(Duration::from_millis(100)).await;
        let told = stage.said(Topic::Diagnostics);
        let told: Vec<_> = told
            .iter()
            .map(|one| {
                (
                    one["status"][0]["level"].as_u64().unwrap(),
                    value(one, "timestep_limit"),
                )
            })
            .collect();
        assert_eq!(told, [(0, "NaN"), (0, "0.004")]);
    });
}

#[test]
fn an_arm_that_nothing_limits_says_so_and_does_not_warn() {
    in_virtual_time(async {
        let stage = Stage::new(f64::INFINITY).await;
        stage.want(Topic::Diagnostics, true).await;
        stage.ask(pause(true)).await;
        // At rest without gravity, so that nothing moves either.
        stage.ask(gravity(0.0)).await;
        stage.ask(Reset::default()).await;
        stage.ask(integrator(Some(1e6), None)).await;
        sleep(Duration::from_secs(2)).await;
        let told = stage.said(Topic::Diagnostics);
        let message = told.last().unwrap();
        assert_eq!(
            (value(message, "timestep_limit"), value(message, "warning")),
            ("inf", "")
        );
    });
}

/// A free arm with nothing to be unstable about, and yet spun so fast, or falling so far, that the method cannot follow: the
/// smaller of the two limits warns.
#[test]
fn a_motion_too_fast_for_the_timestep_is_warned_of() {
    in_virtual_time(async {
        let stage = Stage::new(0.2).await;
        stage.want(Topic::Diagnostics, true).await;
        stage.ask(pause(true)).await;
        for (timestep, warned) in [(0.05, false), (0.15, true)] {
            stage.ask(integrator(Some(timestep), None)).await;
            sleep(Duration::from_secs(2)).await;
            let told = stage.said(Topic::Diagnostics);
            let message = told.last().unwrap();
            let limit: f64 = value(message, "timestep_limit_motion").parse().unwrap();
            assert!((0.05..0.15).contains(&limit), "{limit}");
            let warning = value(message, "warning");
            assert_eq!(!warning.is_empty(), warned, "{warning}");
            let said = "up to which rk4 is predicted to carry a motion of 16.4 rad/s";
            assert_eq!(warning.contains(said), warned, "{warning}");
        }
        // Beyond both limits the smaller one is told.
        stage.ask(integrator(Some(0.3), None)).await;
        sleep(Duration::from_secs(2)).await;
        let told = stage.said(Topic::Diagnostics);
        let warning = value(told.last().unwrap(), "warning").to_owned();
        assert!(warning.contains("16.4 rad/s"), "{warning}");
    });
}

#[test]
fn the_error_estimate_comes_ten_times_a_second_while_somebody_listens() {
    in_virtual_time(async {
        let stage = Stage::new(0.004).await;
        stage.ask(integrator(None, Some(Method::Midpoint))).await;
        stage.want(Topic::ErrorEstimate, true).await;
        sleep(Duration::from_secs(3)).await;
        let told = stage.said(Topic::ErrorEstimate);
        assert!((29..=31).contains(&told.len()), "{}", told.len());
        assert_eq!(stage.gauges.error_estimates(), told.len() as u64);
        stage.ask(pause(true)).await;
        sleep(Duration::from_millis(200)).await;
        let simulation = stage.arm.send(TakeSnapshot::<2>).await.unwrap().0;
        let expected = estimate(&simulation).unwrap();
        assert!(expected.local_error > 0.0);
        assert_eq!(
            *stage.said(Topic::ErrorEstimate).last().unwrap(),
            json!({"method": "midpoint", "timestep": 0.001, "local_error": expected.local_error,
                "velocity_error": expected.velocity_error, "error_per_second": expected.error_per_second, "predicted_limit": 0.004})
        );
        stage.want(Topic::ErrorEstimate, false).await;
        let before = stage.gauges.error_estimates();
        sleep(Duration::from_secs(3)).await;
        assert_eq!(stage.gauges.error_estimates(), before);
    });
}

#[test]
fn an_arm_that_has_diverged_has_no_local_error() {
    in_virtual_time(async {
        let stage = Stage::new(f64::INFINITY).await;
        stage.want(Topic::ErrorEstimate, true).await;
        stage
            .ask(SetGains {
                kp: Some([1e200; 2]),
                ..SetGains::default()
            })
            .await;
        stage.set_setpoint([1.0, 1.0]).await;
        stage.ask(integrator(Some(0.01), Some(Method::Euler))).await;
        stage.ask(enable(true)).await;
        sleep(Duration::from_secs(1)).await;
        let told = stage.said(Topic::ErrorEstimate);
        assert_eq!(
            *told.last().unwrap(),
            json!({"method": "euler", "timestep": 0.01, "local_error": null, "velocity_error": null, "error_per_second": null, "predicted_limit": null})
        );
    });
}
