//! Wrong servers over TCP: an arm with one usual mistake, for the causes that the suite names. The right one is ours.
//!
//! | module | what |
//! | --- | --- |
//! | [`plant`] | the arm with a mistake |
//! | [`expression`] | a parser with a mistake |
//! | [`score`] | the share of right causes |
//!
//! Mistakes in methods and equations are the models of the suite. Those in expressions, inverse kinematics and the control law are
//! programs of their own, because the suite has only their outcomes.

mod expression;
mod plant;
mod score;

use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use pendularm_conformance::arm::State;
use pendularm_conformance::method::METHODS;
use pendularm_conformance::mistakes::equations;
use serde_json::{Value, json};

use expression::Misread;
use plant::{Mistake, Plant, steppings};

/// Mistakes of parsers, with words of their causes.
const EXPRESSIONS: [(&str, Misread); 12] = [
    ("unary minus binds looser than ^", Misread::MinusBindsLooser),
    ("^ is left-associative", Misread::PowerFromTheLeft),
    ("- and / are right-associative", Misread::FromTheRight("-/")),
    ("- is right-associative", Misread::FromTheRight("-")),
    ("/ is right-associative", Misread::FromTheRight("/")),
    ("all operators bind alike", Misread::AllBindAlike),
    ("^ binds as * does", Misread::PowerBindsAsTimes),
    ("the division of integers drops the fraction", Misread::WholeDivision),
    ("the angle of sin is taken for degrees", Misread::Degrees),
    ("ln is the decimal logarithm", Misread::Decimal),
    ("ln is the logarithm to base 2", Misread::Binary),
    ("parentheses are ignored", Misread::NoParentheses),
];

/// Mistakes of inverse kinematics; the last two are for 3 links.
const KINEMATICS: [&str; 10] = [
    "the solution has absolute instead of relative angles",
    "the solution is in degrees",
    "the two joints have different elbows",
    "x and y are exchanged",
    "y points down",
    "joint 2 is the inner angle of the elbow",
    "the lengths of the links are not used",
    "the lengths of the first two links are exchanged",
    "the last joint has phi itself",
    "the wrist lies beyond the target",
];

/// Mistakes of the control law.
const LAW: [&str; 14] = [
    "the position error has the wrong sign",
    "the proportional term has the wrong sign",
    "the proportional term is missing",
    "all joints have the kp of joint 1",
    "the position error is wrapped",
    "the derivative term has the wrong sign",
    "the derivative term is missing",
    "the derivative term ignores the velocity of the setpoint",
    "the integral term has the wrong sign",
    "the integral term is missing",
    "the integral is summed without the timestep",
    "enable does not clear the integral",
    "reset does not clear the integral",
    "neither enable nor reset clears the integral",
];

/// Mistakes in what is told.
const TOLD: [&str; 11] = [
    "x0 is not used",
    "xdot0 is not used",
    "the series starts one step late",
    "the numbers have single precision",
    "the timestep is 0.001 s",
    "the angles and rates in /joint_states are absolute",
    "the times are one step ahead",
    "the times are one step behind",
    "the times are the numbers of the steps",
    "the times have single precision",
    "the times are a running sum of single precision",
];

/// A wrong server: words of its cause, the number of its links, and sections of rules that show the mistake.
pub struct Wrong {
    pub says: String,
    pub links: usize,
    pub rules: &'static [&'static str],
    mistake: Mistake,
}

/// All, by number.
pub fn all() -> Vec<Wrong> {
    let server = |says: &str, links, rules, mistake| Wrong { says: says.to_owned(), links, rules, mistake };
    let mut all = Vec::new();
    for method in METHODS {
        all.extend(steppings(method).map(|(says, mistake)| server(&says, 2, &["method", "set_integrator"], mistake)));
    }
    for links in [2, 3] {
        all.extend(
            equations::MISTAKES
                .into_iter()
                .map(|(says, mistake)| server(says, links, &["set_integrator", "set_params-8"], Mistake::Equations(mistake))),
        );
    }
    all.extend(EXPRESSIONS.into_iter().map(|(says, misread)| server(says, 2, &["function"], Mistake::Expression(misread))));
    let kinematics = KINEMATICS.into_iter().enumerate();
    all.extend(kinematics.map(|(at, says)| server(says, if at < 8 { 2 } else { 3 }, &["ik"], Mistake::Kinematics(at))));
    let rules = &["law", "trajectory", "enable", "reset"];
    all.extend(LAW.into_iter().enumerate().map(|(at, says)| server(says, 2, rules, Mistake::Law(at))));
    let rules = |at| [&["method"], &["set_integrator"], &["checkpoint-4"]][usize::from(at > 3) + usize::from(at > 5)];
    all.extend(TOLD.into_iter().enumerate().map(|(at, says)| server(says, 2, rules(at), Mistake::Told(at))));
    all
}

impl Wrong {
    /// Serves at a free port to the end of the program.
    pub fn serve(&self) -> String {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let plant = Arc::new(Mutex::new(Plant::new(self.links, self.mistake)));
        thread::spawn(move || {
            for client in listener.incoming().flatten() {
                let plant = Arc::clone(&plant);
                thread::spawn(move || attend(&client, &plant));
            }
        });
        address
    }
}

/// The right server of this program, which has no goals and no trials.
pub fn right(links: usize) -> Wrong {
    Wrong { says: String::new(), links, rules: &[], mistake: Mistake::Nothing }
}

/// Serves one client. The lock on the arm is held while a frame is written, so no older state follows an answer.
fn attend(client: &TcpStream, plant: &Arc<Mutex<Plant>>) -> Option<()> {
    client.set_nodelay(true).ok()?;
    let sees = Arc::new(AtomicBool::new(false));
    for line in BufReader::new(client).lines() {
        let frame: Value = serde_json::from_str(&line.ok()?).unwrap_or_default();
        let (op, is_states) = (frame["op"].as_str().unwrap_or_default(), frame["topic"] == "/joint_states");
        if op == "subscribe" && is_states && !sees.swap(true, Ordering::Relaxed) {
            let (client, plant, sees) = (client.try_clone().ok()?, Arc::clone(plant), Arc::clone(&sees));
            thread::spawn(move || publish(&client, &plant, &sees));
        }
        if op == "unsubscribe" && is_states {
            sees.store(false, Ordering::Relaxed);
        }
        let mut plant = plant.lock().unwrap();
        plant.advance();
        if op == "publish" && frame["topic"] == "/joint_trajectory" {
            command(&mut plant, frame["msg"]["points"].as_array().and_then(|points| points.last()).unwrap_or(&Value::Null));
        }
        if op == "call_service" {
            let service = frame["service"].as_str().unwrap_or_default();
            let mut why = String::new();
            let values = called(&mut plant, service, &frame["args"], &mut why).unwrap_or_else(|| {
                why = format!("{service} does not accept {}", frame["args"]);
                json!({})
            });
            let answer = json!({
                "op": "service_response", "service": service, "id": frame["id"], "values": values, "result": why.is_empty(), "status": why,
            });
            writeln!(&mut &*client, "{answer}").ok()?;
        }
    }
    sees.store(false, Ordering::Relaxed);
    Some(())
}

/// Publishes 60 times a second.
fn publish(mut client: &TcpStream, plant: &Mutex<Plant>, sees: &AtomicBool) {
    while sees.load(Ordering::Relaxed) {
        {
            let mut plant = plant.lock().unwrap();
            plant.advance();
            let frame = json!({"op": "publish", "topic": "/joint_states", "msg": plant.message()});
            if writeln!(client, "{frame}").is_err() {
                return;
            }
        }
        thread::sleep(Duration::from_micros(16_600));
    }
}

/// Numbers, one for each joint.
fn each(value: &Value, links: usize, is_good: fn(f64) -> bool) -> Option<Vec<f64>> {
    let values: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
    values.filter(|values| values.len() == links && values.iter().all(|value| is_good(*value)))
}

fn command(plant: &mut Plant, point: &Value) {
    let links = plant.arm.masses.len();
    if let Some(position) = each(&point["positions"], links, f64::is_finite) {
        let velocity = each(&point["velocities"], links, f64::is_finite).unwrap_or_else(|| vec![0.0; links]);
        plant.setpoint = State { position, velocity };
    }
}

/// The values of an answer. `None`, or a reason in `why`: the call is rejected.
fn called(plant: &mut Plant, service: &str, args: &Value, why: &mut String) -> Option<Value> {
    let links = plant.arm.masses.len();
    // Sets each member that is there, and keeps the names of those that are wrong.
    let mut set = |name: &str, is_set: &mut dyn FnMut(&Value) -> bool| {
        if args.get(name).is_some_and(|value| !is_set(value)) {
            *why += name;
        }
    };
    fn to<T>(place: &mut T, value: Option<T>) -> bool {
        value.map(|value| *place = value).is_some()
    }
    match service {
        "/arm_sim/integration_step" => return plant.integrate(args),
        "/ik/solve" => return plant.solve(args).map(|pose| json!({"positions": pose})),
        "/arm_sim/reset" => return Some(plant.reset()),
        "/arm_sim/set_params" => {
            set("gravity", &mut |value| to(&mut plant.arm.gravity, value.as_f64().filter(|value| *value >= 0.0)));
            set("masses", &mut |value| to(&mut plant.arm.masses, each(value, links, |value| value > 0.0)));
            set("lengths", &mut |value| to(&mut plant.arm.lengths, each(value, links, |value| value > 0.0)));
            return Some(json!({"gravity": plant.arm.gravity, "masses": plant.arm.masses, "lengths": plant.arm.lengths}));
        }
        "/arm_sim/set_integrator" => {
            let known = |value: &Value| METHODS.into_iter().find(|name| value == name).map(str::to_owned);
            set("method", &mut |value| to(&mut plant.method, known(value)));
            set("timestep", &mut |value| to(&mut plant.timestep, value.as_f64().filter(|value| *value > 0.0)));
            return Some(json!({"method": plant.method, "timestep": plant.timestep}));
        }
        "/pid_controller/set_gains" => {
            for (at, name) in ["kp", "ki", "kd"].into_iter().enumerate() {
                set(name, &mut |value| to(&mut plant.gains[at], each(value, links, |value| value >= 0.0)));
            }
            return Some(json!({"kp": plant.gains[0], "ki": plant.gains[1], "kd": plant.gains[2]}));
        }
        "/arm_sim/pause" => {
            set("data", &mut |value| to(&mut plant.paused, value.as_bool()));
            return Some(json!({"data": plant.paused}));
        }
        "/pid_controller/enable" => {
            set("data", &mut |value| value.as_bool().map(|on| plant.enable(on)).is_some());
            return Some(json!({"data": plant.enabled}));
        }
        _ => {}
    }
    None
}
