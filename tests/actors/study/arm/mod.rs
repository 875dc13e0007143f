//! The arm's questions to the study, in virtual time: here the study's and the registry's stand-ins.

mod limits;
mod warnings;

use super::*;

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

fn value<'a>(message: &'a Value, key: &str) -> &'a str {
    let values = message["status"][0]["values"].as_array().unwrap();
    let entry = values.iter().find(|entry| entry["key"] == key).unwrap();
    entry["value"].as_str().unwrap()
}
