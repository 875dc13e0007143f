//! A fault for every rule: a wrong answer, a wrong message, or a request that reaches the arm as another one.

use std::cell::Cell;

use serde_json::{Value, json};

use crate::proxy::{Fault, Side};

/// A fault that a rule must find.
pub struct Planted {
    /// The rule.
    pub rule: &'static str,
    /// A description of the server's fault.
    pub says: &'static str,
    /// Makes it, for a number of links.
    pub fault: fn(usize) -> Fault,
}

const fn planted(rule: &'static str, says: &'static str, fault: fn(usize) -> Fault) -> Planted {
    Planted { rule, says, fault }
}

const STEP: &str = "/arm_sim/integration_step";
const INTEGRATOR: &str = "/arm_sim/set_integrator";
const PARAMS: &str = "/arm_sim/set_params";
const PAUSE: &str = "/arm_sim/pause";
const RESET: &str = "/arm_sim/reset";
const ENABLE: &str = "/pid_controller/enable";
const GAINS: &str = "/pid_controller/set_gains";
const SOLVE: &str = "/ik/solve";
const SEND: &str = "/ik_action/send_goal";
const CANCEL: &str = "/ik_action/cancel_goal";
const STATES: &str = "/joint_states";
const TRAJECTORY: &str = "/joint_trajectory";
const FEEDBACK: &str = "/ik_action/feedback";
const RESULT: &str = "/ik_action/result";
const STATUS: &str = "/ik_trial/status";

fn is(frame: &Value, name: &str, value: &str) -> bool {
    frame[name] == value
}

/// Changes the answers of a service; told their number so far.
fn answer(service: &'static str, change: impl Fn(&mut Value, usize) + Send + 'static) -> Fault {
    let mut count = 0;
    Box::new(move |side, _, mut frame| {
        if side == Side::Server && is(&frame, "op", "service_response") && is(&frame, "service", service) {
            change(&mut frame, count);
            count += 1;
        }
        vec![frame]
    })
}

/// Changes the arguments of calls of a service.
fn request(service: &'static str, change: impl Fn(&mut Value) + Send + 'static) -> Fault {
    Box::new(move |side, _, mut frame| {
        if side == Side::Client && is(&frame, "op", "call_service") && is(&frame, "service", service) {
            change(&mut frame["args"]);
        }
        vec![frame]
    })
}

/// Changes the messages on a topic that the server publishes; told their number so far.
fn topic(topic: &'static str, change: impl Fn(&mut Value, usize) + Send + 'static) -> Fault {
    let mut count = 0;
    Box::new(move |side, _, mut frame| {
        if side == Side::Server && is(&frame, "op", "publish") && is(&frame, "topic", topic) {
            change(&mut frame["msg"], count);
            count += 1;
        }
        vec![frame]
    })
}

/// Changes the trajectories that the suite sends.
fn trajectory(change: impl Fn(&mut Value) + Send + 'static) -> Fault {
    Box::new(move |side, _, mut frame| {
        if side == Side::Client && is(&frame, "op", "publish") && is(&frame, "topic", TRAJECTORY) {
            change(&mut frame["msg"]["points"]);
        }
        vec![frame]
    })
}

/// Drops frames.
fn without(is_dropped: impl Fn(Side, usize, &Value) -> bool + Send + 'static) -> Fault {
    Box::new(move |side, number, frame| if is_dropped(side, number, &frame) { vec![] } else { vec![frame] })
}

/// Sends frames twice.
fn twice(is_doubled: impl Fn(Side, &Value) -> bool + Send + 'static) -> Fault {
    Box::new(move |side, _, frame| if is_doubled(side, &frame) { vec![frame.clone(), frame] } else { vec![frame] })
}

/// Changes joint states once a service has been called this many times.
fn after_calls(service: &'static str, calls: usize, change: impl Fn(&mut Value) + Send + 'static) -> Fault {
    let mut seen = 0;
    Box::new(move |side, _, mut frame| {
        if side == Side::Client && is(&frame, "service", service) {
            seen += 1;
        }
        if side == Side::Server && is(&frame, "topic", STATES) && seen >= calls {
            change(&mut frame["msg"]);
        }
        vec![frame]
    })
}

/// Adds to a number.
fn add(number: &mut Value, by: f64) {
    *number = json!(number.as_f64().unwrap_or(0.0) + by);
}

/// Multiplies every number of an array.
fn scale(array: &mut Value, by: f64) {
    for number in array.as_array_mut().into_iter().flatten() {
        *number = json!(by * number.as_f64().unwrap_or(0.0));
    }
}

/// Replaces a member that has a value.
fn replace(object: &mut Value, name: &str, from: &Value, to: &Value) {
    if object[name] == *from {
        object[name] = to.clone();
    }
}

fn remove(object: &mut Value, name: &str) {
    if let Some(members) = object.as_object_mut() {
        members.remove(name);
    }
}

fn members(object: &Value) -> usize {
    object.as_object().map_or(0, serde_json::Map::len)
}

/// Parses a function as another one.
fn reads(from: &'static str, to: &'static str) -> Fault {
    request(STEP, move |args| replace(args, "function", &json!(from), &json!(to)))
}

/// Integrates by another method.
fn integrates(from: &'static str, to: &'static str) -> Fault {
    request(STEP, move |args| replace(args, "integrator", &json!(from), &json!(to)))
}

/// Steps the live arm by another method.
fn steps(from: &'static str, to: &'static str) -> Fault {
    request(INTEGRATOR, move |args| replace(args, "method", &json!(from), &json!(to)))
}

/// Rejects a request as a whole: the other fields of a request with a bad one are not applied.
fn all_or_nothing(service: &'static str, is_bad: impl Fn(&Value) -> bool + Send + 'static) -> Fault {
    request(service, move |args| {
        if let Some(members) = args.as_object_mut()
            && members.values().any(&is_bad)
        {
            members.retain(|_, value| is_bad(value));
        }
    })
}

fn has_not_positive(value: &Value) -> bool {
    value.as_array().is_some_and(|array| array.iter().any(|entry| entry.as_f64().is_some_and(|entry| entry <= 0.0)))
}

fn has_negative(value: &Value) -> bool {
    value.as_array().is_some_and(|array| array.iter().any(|entry| entry.as_f64().is_some_and(|entry| entry < 0.0)))
}

fn is_below_zero(value: &Value) -> bool {
    value.as_f64().is_some_and(|value| value < 0.0)
}

/// Never stops.
fn no_pause(_: usize) -> Fault {
    request(PAUSE, |args| replace(args, "data", &json!(true), &json!(false)))
}

/// Whether a thing has happened, for faults that remember.
#[derive(Default)]
struct Memory {
    happened: Cell<bool>,
    kept: Cell<Value>,
}

/// At least one for each rule.
pub const FAULTS: &[Planted] = &[
    planted("envelope-1", "answers twice", |_| twice(|side, frame| side == Side::Server && is(frame, "service", PARAMS))),
    planted("envelope-1", "leaves the service out", |_| answer(PARAMS, |frame, _| remove(frame, "service"))),
    planted("envelope-2", "leaves the status out", |_| answer(GAINS, |frame, _| remove(frame, "status"))),
    planted("envelope-2", "values is an array", |_| answer(PAUSE, |frame, _| frame["values"] = json!([]))),
    planted("envelope-3", "gives no reason", |_| answer(PARAMS, |frame, _| frame["status"] = json!(""))),
    planted("envelope-4", "does not relay", |_| {
        without(|_, _, frame| is(frame, "op", "publish") && is(frame, "topic", "/conformance/chatter"))
    }),
    planted("envelope-5", "publishes to the first connections alone", |_| {
        without(|side, number, frame| side == Side::Server && number == 2 && is(frame, "topic", STATES))
    }),
    planted("envelope-6", "ignores unsubscribe", |_| without(|side, _, frame| side == Side::Client && is(frame, "op", "unsubscribe"))),
    planted("envelope-7", "says nothing after a malformed frame", |_| {
        let memory = Memory::default();
        Box::new(move |side, _, frame| {
            if side == Side::Client && frame.is_string() {
                memory.happened.set(true);
            }
            if side == Side::Server && memory.happened.get() { vec![] } else { vec![frame] }
        })
    }),
    planted("checkpoint-1", "leaves out the last time", |_| {
        answer(STEP, |frame, _| drop(frame["values"]["times"].as_array_mut().and_then(Vec::pop)))
    }),
    planted("checkpoint-2", "starts beside x0", |_| answer(STEP, |frame, _| add(&mut frame["values"]["positions"][0], 0.1))),
    planted("checkpoint-3", "has another default for xdot0", |_| {
        request(STEP, |args| {
            if args.get("xdot0").is_none() {
                args["xdot0"] = json!(0.5);
            }
        })
    }),
    planted("checkpoint-4", "has one time wrong", |_| answer(STEP, |frame, _| add(&mut frame["values"]["times"][5], 0.001))),
    planted("checkpoint-5", "midpoint is euler", |_| integrates("midpoint", "euler")),
    planted("checkpoint-6", "later answers differ", |_| {
        answer(STEP, |frame, count| {
            if count > 0 {
                add(&mut frame["values"]["positions"][3], 1e-6);
            }
        })
    }),
    planted("checkpoint-7", "moves the arm", |_| after_calls(STEP, 1, |msg| add(&mut msg["position"][0], 0.01))),
    planted("checkpoint-8", "falls back to rk4", |_| integrates("rk5", "rk4")),
    planted("checkpoint-9", "takes dt = 0 for a default", |_| request(STEP, |args| replace(args, "dt", &json!(0.0), &json!(0.1)))),
    planted("checkpoint-9", "takes dt < 0 for a default", |_| request(STEP, |args| replace(args, "dt", &json!(-0.1), &json!(0.1)))),
    planted("checkpoint-10", "takes 0 steps for 1", |_| request(STEP, |args| replace(args, "steps", &json!(0), &json!(1)))),
    planted("checkpoint-11", "completes an expression", |_| reads("2 +", "2 + t")),
    planted("checkpoint-12", "is silent after ten rejections", |_| {
        let memory = Memory::default();
        let mut rejections = 0;
        Box::new(move |side, _, frame| {
            rejections += usize::from(side == Side::Server && is(&frame, "service", STEP) && frame["result"] == false);
            memory.happened.set(rejections > 10);
            if side == Side::Server && memory.happened.get() { vec![] } else { vec![frame] }
        })
    }),
    planted("function-1", "minus is right-associative", |_| reads("10-4-3", "10-(4-3)")),
    planted("function-1", "division is right-associative", |_| reads("16/4/2", "16/(4/2)")),
    planted("function-2", "^ is left-associative", |_| reads("2^3^2", "(2^3)^2")),
    planted("function-3", "unary minus binds looser than ^", |_| reads("-3^2", "-(3^2)")),
    planted("function-4", "ignores parentheses", |_| reads("(1+2)*3", "1+2*3")),
    planted("function-5", "cuts the fraction", |_| reads("12.5", "12")),
    planted("function-6", "ln is the decimal logarithm", |_| reads("ln(t + 1)", "ln(t + 1)/ln(10)")),
    planted("function-7", "drops the last term", |_| reads("t^2 + 3*t - 1", "t^2 + 3*t")),
    planted("function-8", "takes an empty function for 0", |_| reads("", "0")),
    planted("function-9", "closes parentheses", |_| reads("(t", "(t)")),
    planted("function-10", "takes x for t", |_| reads("x", "t")),
    planted("function-11", "stops at the end of an expression", |_| reads("t + 1 garbage", "t + 1")),
    planted("function-12", "multiplies adjacent tokens", |_| reads("1 2", "1*2")),
    planted("function-13", "skips characters", |_| reads("t $ 2", "t - 2")),
    planted("function-14", "does not answer", |_| without(|_, _, frame| frame["args"]["function"] == "sqrt(-1)")),
    planted("trajectory-1", "has another setpoint", |_| trajectory(|points| add(&mut points[0]["positions"][0], 0.2))),
    planted("trajectory-2", "takes the first point", |_| {
        trajectory(|points| {
            if let Some(points) = points.as_array_mut() {
                points.truncate(1);
            }
        })
    }),
    planted("trajectory-3", "ignores velocities", |_| trajectory(|points| remove(&mut points[0], "velocities"))),
    planted("trajectory-4", "keeps the old velocities", |links| {
        trajectory(move |points| {
            if points[0].get("velocities").is_none() {
                points[0]["velocities"] = json!(vec![0.4; links]);
            }
        })
    }),
    planted("trajectory-5", "pads velocities", |links| {
        trajectory(move |points| replace(&mut points[0], "velocities", &json!([0.7]), &json!(vec![0.7; links])))
    }),
    planted("trajectory-6", "pads positions", |links| {
        trajectory(move |points| replace(&mut points[0], "positions", &json!([0.9]), &json!(vec![0.9; links])))
    }),
    planted("trajectory-7", "takes no points for the starting pose", |links| {
        trajectory(move |points| {
            if points == &json!([]) {
                *points = json!([{"positions": vec![0.0; links]}]);
            }
        })
    }),
    planted("trajectory-8", "ignores trajectories while it is off", |_| {
        let memory = Memory::default();
        Box::new(move |side, _, frame| {
            if side == Side::Client && is(&frame, "service", ENABLE) && frame["args"]["data"].is_boolean() {
                memory.happened.set(frame["args"]["data"] == false);
            }
            let is_lost = side == Side::Client && is(&frame, "topic", TRAJECTORY) && memory.happened.get();
            if is_lost { vec![] } else { vec![frame] }
        })
    }),
    planted("states-1", "publishes 2 messages a second", |_| {
        let mut count = 0;
        Box::new(move |side, _, frame| {
            let is_state = side == Side::Server && is(&frame, "topic", STATES);
            count += usize::from(is_state);
            if is_state && count % 30 != 1 { vec![] } else { vec![frame] }
        })
    }),
    planted("states-2", "two joints have one name", |_| topic(STATES, |msg, _| msg["name"][1] = msg["name"][0].clone())),
    planted("states-3", "lacks an effort", |_| topic(STATES, |msg, _| drop(msg["effort"].as_array_mut().and_then(Vec::pop)))),
    planted("states-3", "has a position that is no number", |_| {
        topic(STATES, |msg, count| {
            if count > 3 {
                msg["position"][0] = Value::Null;
            }
        })
    }),
    planted("states-4", "nanosec is beyond a second", |_| topic(STATES, |msg, _| msg["header"]["stamp"]["nanosec"] = json!(1_500_000_000))),
    planted("states-4", "a stamp runs backwards", |_| {
        topic(STATES, |msg, count| {
            if count % 8 == 7 {
                msg["header"]["stamp"]["sec"] = json!(0);
                msg["header"]["stamp"]["nanosec"] = json!(0);
            }
        })
    }),
    planted("set_integrator-1", "has no verlet", |_| steps("verlet", "rk4")),
    planted("set_integrator-2", "resets the method with the timestep", |_| {
        request(INTEGRATOR, |args| {
            if members(args) == 1 && args.get("timestep").is_some() {
                args["method"] = json!("rk4");
            }
        })
    }),
    planted("set_integrator-3", "a query changes the timestep", |_| {
        answer(INTEGRATOR, |frame, count| add(&mut frame["values"]["timestep"], 0.001 * f64::from(u32::try_from(count).unwrap())))
    }),
    planted("set_integrator-4", "falls back to euler", |_| steps("leapfrog", "euler")),
    planted("set_integrator-5", "ignores a bad timestep", |_| {
        request(INTEGRATOR, |args| {
            if args["timestep"].as_f64().is_some_and(|timestep| timestep <= 0.0) {
                remove(args, "timestep");
            }
        })
    }),
    planted("set_integrator-6", "euler is midpoint", |_| steps("euler", "midpoint")),
    planted("set_integrator-7", "midpoint is verlet", |_| steps("midpoint", "verlet")),
    planted("set_integrator-8", "verlet is midpoint", |_| steps("verlet", "midpoint")),
    planted("set_integrator-9", "rk4 is verlet", |_| steps("rk4", "verlet")),
    planted("set_integrator-9", "ignores the timestep", |_| request(INTEGRATOR, |args| remove(args, "timestep"))),
    planted("set_params-1", "has another gravity", |_| answer(PARAMS, |frame, _| frame["values"]["gravity"] = json!(9.8))),
    planted("set_params-2", "lacks a length", |_| {
        answer(PARAMS, |frame, _| drop(frame["values"]["lengths"].as_array_mut().and_then(Vec::pop)))
    }),
    planted("set_params-2", "a query changes gravity", |_| {
        answer(PARAMS, |frame, count| add(&mut frame["values"]["gravity"], f64::from(u32::try_from(count).unwrap())))
    }),
    planted("set_params-3", "gravity alone resets the masses", |links| {
        request(PARAMS, move |args| {
            if members(args) == 1 && args.get("lengths").is_some() {
                args["masses"] = json!(vec![1.0; links]);
            }
        })
    }),
    planted("set_params-4", "rejects all for a wrong length", |links| {
        all_or_nothing(PARAMS, move |value| value.as_array().is_some_and(|array| array.len() != links))
    }),
    planted("set_params-5", "rejects all for a mass of 0", |_| all_or_nothing(PARAMS, has_not_positive)),
    planted("set_params-6", "rejects all for negative gravity", |_| all_or_nothing(PARAMS, is_below_zero)),
    planted("set_params-7", "returns nothing when it rejects", |_| {
        answer(PARAMS, |frame, _| {
            if frame["result"] == false {
                frame["values"] = json!({});
            }
        })
    }),
    planted("set_params-8", "the live arm keeps its masses", |_| request(PARAMS, |args| remove(args, "masses"))),
    planted("set_params-9", "has always some gravity", |_| request(PARAMS, |args| replace(args, "gravity", &json!(0.0), &json!(0.1)))),
    planted("pause-1", "does not stop", no_pause),
    planted("pause-2", "rejects calls while paused", |_| answer(SOLVE, |frame, _| frame["result"] = json!(false))),
    planted("pause-3", "runs on while paused", no_pause),
    planted("pause-4", "says that it is paused", |_| answer(PAUSE, |frame, _| frame["values"]["data"] = json!(true))),
    planted("pause-5", "the integral runs on while paused", no_pause),
    planted("reset-1", "goes to another pose each time", |_| {
        answer(RESET, |frame, count| add(&mut frame["values"]["position"][0], f64::from(u32::try_from(count).unwrap())))
    }),
    planted("reset-2", "says another pose", |_| answer(RESET, |frame, _| add(&mut frame["values"]["position"][0], 0.1))),
    planted("reset-3", "keeps the setpoint", |_| {
        let memory = Memory::default();
        Box::new(move |side, _, frame| {
            let mut frames = vec![frame.clone()];
            if side == Side::Client && is(&frame, "topic", TRAJECTORY) && is(&frame, "op", "publish") {
                memory.kept.set(frame);
                memory.happened.set(true);
            } else if side == Side::Client && is(&frame, "service", RESET) && memory.happened.get() {
                let kept = memory.kept.take();
                frames.push(kept.clone());
                memory.kept.set(kept);
            }
            frames
        })
    }),
    planted("reset-4", "keeps the integral", |_| after_calls(RESET, 3, |msg| msg["effort"][0] = json!(0.003))),
    planted("reset-5", "the clock goes on", |_| topic(STATES, |msg, _| add(&mut msg["header"]["stamp"]["sec"], 5.0))),
    planted("reset-6", "switches the controller off", |_| {
        Box::new(move |side, _, frame| {
            if side == Side::Client && is(&frame, "service", RESET) {
                let off = json!({"op": "call_service", "id": "proxy", "service": ENABLE, "args": {"data": false}});
                return vec![frame, off];
            }
            vec![frame]
        })
    }),
    planted("enable-1", "starts enabled", |_| answer(ENABLE, |frame, _| frame["values"]["data"] = json!(true))),
    planted("enable-1", "has an effort at the start", |_| topic(STATES, |msg, _| msg["effort"][0] = json!(0.5))),
    planted("enable-2", "cannot be disabled", |_| request(ENABLE, |args| replace(args, "data", &json!(false), &json!(true)))),
    planted("enable-3", "a query switches", |_| answer(ENABLE, |frame, count| frame["values"]["data"] = json!(count % 2 == 0))),
    planted("enable-4", "has an effort while disabled", |_| topic(STATES, |msg, _| msg["effort"][0] = json!(0.001))),
    planted("enable-5", "cannot be enabled", |_| request(ENABLE, |args| replace(args, "data", &json!(true), &json!(false)))),
    planted("enable-6", "keeps the integral while disabled", |_| {
        request(ENABLE, |args| replace(args, "data", &json!(false), &json!(true)))
    }),
    planted("enable-7", "keeps the effort while paused", |_| request(ENABLE, |args| replace(args, "data", &json!(false), &json!(true)))),
    planted("gains-1", "returns other gains", |_| answer(GAINS, |frame, _| add(&mut frame["values"]["kp"][0], 1.0))),
    planted("gains-2", "a query changes gains", |_| {
        answer(GAINS, |frame, count| add(&mut frame["values"]["kp"][0], f64::from(u32::try_from(count).unwrap())))
    }),
    planted("gains-3", "ki alone resets kp", |links| {
        request(GAINS, move |args| {
            if members(args) == 1 && args.get("ki").is_some() {
                args["kp"] = json!(vec![0.0; links]);
            }
        })
    }),
    planted("gains-4", "rejects all for a wrong length", |links| {
        all_or_nothing(GAINS, move |value| value.as_array().is_some_and(|array| array.len() != links))
    }),
    planted("gains-5", "rejects all for a negative gain", |_| all_or_nothing(GAINS, has_negative)),
    planted("gains-5", "takes a negative gain for 0", |_| {
        request(GAINS, |args| {
            for array in args.as_object_mut().into_iter().flatten().filter(|(_, array)| has_negative(array)) {
                scale(array.1, 0.0);
            }
        })
    }),
    planted("gains-6", "a change of gains clears the integral", |_| {
        Box::new(move |side, _, frame| {
            if side == Side::Client && is(&frame, "service", GAINS) && members(&frame["args"]) == 1 {
                let switch = |on: bool| json!({"op": "call_service", "id": "proxy", "service": ENABLE, "args": {"data": on}});
                return vec![switch(false), switch(true), frame];
            }
            vec![frame]
        })
    }),
    planted("gains-7", "has an effort without gains", |_| topic(STATES, |msg, _| msg["effort"][0] = json!(0.1))),
    planted("law-1", "all joints have the first one's kp", |links| {
        request(GAINS, move |args| {
            if args.get("kp").is_some() {
                args["kp"] = json!(vec![args["kp"][0].clone(); links]);
            }
        })
    }),
    planted("law-2", "the derivative term has the wrong sign", |_| topic(STATES, |msg, _| scale(&mut msg["effort"], -1.0))),
    planted("law-3", "differentiates the error", |_| topic(STATES, |msg, _| msg["effort"][0] = json!(0.01))),
    planted("law-4", "sums the error twice a step", |_| request(GAINS, |args| scale(&mut args["ki"], 2.0))),
    planted("law-5", "the integral has no bound", |_| {
        topic(STATES, |msg, count| scale(&mut msg["effort"], 1.0 + 0.05 * f64::from(u32::try_from(count).unwrap())))
    }),
    planted("law-6", "something else compensates gravity", |_| {
        request(GAINS, |args| {
            args["ki"] = args["kp"].clone();
            scale(&mut args["ki"], 3.0);
        })
    }),
    planted("law-7", "the integral does not reach the effort", |_| request(GAINS, |args| scale(&mut args["ki"], 0.0))),
    planted("dynamics-1", "does not move", |_| request(PAUSE, |args| replace(args, "data", &json!(false), &json!(true)))),
    planted("dynamics-2", "the effort is a tenth too high", |_| topic(STATES, |msg, _| scale(&mut msg["effort"], 1.1))),
    planted("dynamics-3", "the load does not follow from the lengths", |_| request(PARAMS, |args| remove(args, "lengths"))),
    planted("dynamics-4", "joints are independent", |_| topic(STATES, |msg, _| msg["velocity"][1] = json!(0.0))),
    planted("dynamics-5", "steps by euler at 10 ms", |_| {
        request(INTEGRATOR, |args| {
            if members(args) > 0 {
                *args = json!({"method": "euler", "timestep": 0.01});
            }
        })
    }),
    planted("dynamics-5", "a rate is wrong", |_| topic(STATES, |msg, _| scale(&mut msg["velocity"], 1.01))),
    planted("dynamics-6", "a rate is wrong", |_| {
        topic(STATES, |msg, _| {
            let rate = msg["velocity"][1].as_f64().unwrap_or(0.0);
            msg["velocity"][1] = json!(1.05 * rate);
        })
    }),
    planted("dynamics-7", "a joint turns evenly", |links| topic(STATES, move |msg, _| msg["velocity"][links - 1] = json!(1.0))),
    planted("dynamics-8", "hides the instability", |links| {
        Box::new(move |side, _, mut frame| {
            if side == Side::Client && is(&frame, "service", INTEGRATOR) {
                remove(&mut frame["args"], "timestep");
            }
            if side == Side::Client && is(&frame, "service", GAINS) && members(&frame["args"]) == 3 {
                frame["args"] = json!({"kp": vec![20.0; links], "kd": vec![2.0; links], "ki": vec![0.0; links]});
            }
            vec![frame]
        })
    }),
    planted("dynamics-9", "does not come back", |_| after_calls(RESET, 4, |msg| add(&mut msg["position"][0], 1.0))),
    planted("method-1", "euler is semi-implicit, as verlet for a constant force", |_| integrates("euler", "verlet")),
    planted("method-2", "midpoint is verlet", |_| integrates("midpoint", "verlet")),
    planted("method-3", "verlet is midpoint", |_| integrates("verlet", "midpoint")),
    planted("method-4", "rk4 is midpoint", |_| integrates("rk4", "midpoint")),
    planted("method-5", "midpoint has the force of the start", |_| integrates("midpoint", "euler")),
    planted("method-6", "rk4 is midpoint", |_| integrates("rk4", "midpoint")),
    planted("method-7", "rk4 is of second order", |_| integrates("rk4", "midpoint")),
    planted("method-7", "euler is of second order", |_| integrates("euler", "midpoint")),
    planted("method-8", "euler is as good as rk4", |_| integrates("euler", "rk4")),
    planted("ik-1", "a joint is wrong by 1e-4 rad", |_| answer(SOLVE, |frame, _| add(&mut frame["values"]["positions"][0], 1e-4))),
    planted("ik-2", "the orientation is wrong", |_| answer(SOLVE, |frame, _| add(&mut frame["values"]["positions"][2], 1e-4))),
    planted("ik-2", "ignores phi", |_| request(SOLVE, |args| remove(args, "phi"))),
    planted("ik-3", "asks for phi", |_| {
        answer(SOLVE, |frame, _| {
            frame["result"] = json!(false);
        })
    }),
    planted("ik-4", "phi moves the target", |_| {
        request(SOLVE, |args| {
            let phi = args["phi"].as_f64().unwrap_or(0.0);
            add(&mut args["x"], 0.001 * phi);
        })
    }),
    planted("ik-5", "has a default for y", |_| {
        request(SOLVE, |args| {
            if args.get("y").is_none() && args.get("x").is_some() {
                args["y"] = json!(0.5);
            }
        })
    }),
    planted("ik-6", "goes as far as it can", |_| {
        request(SOLVE, |args| {
            *args = json!({"x": 1.0, "y": 0.5, "phi": 0.0});
        })
    }),
    planted("ik-7", "goes as near as it can", |_| {
        request(SOLVE, |args| {
            *args = json!({"x": 0.5, "y": 0.0});
        })
    }),
    planted("ik-8", "takes another orientation", |_| request(SOLVE, |args| args["phi"] = json!(0.0))),
    planted("ik-9", "rejects the boundary", |_| request(SOLVE, |args| scale_target(args, 1.0 + 1e-6))),
    planted("ik-10", "rejects the boundary", |_| request(SOLVE, |args| scale_target(args, 1.0 - 1e-6))),
    planted("ik-11", "keeps the lengths that it had", |links| {
        request(PARAMS, move |args| {
            if args["lengths"] == json!(vec![2.0; links]) {
                remove(args, "lengths");
            }
        })
    }),
    planted("ik-12", "moves the arm", |_| after_calls(SOLVE, 1, |msg| add(&mut msg["position"][0], 0.01))),
    planted("goal-1", "has no id", |_| answer(SEND, |frame, _| frame["values"] = json!({}))),
    planted("goal-2", "a rejected goal ends the active one", |_| {
        Box::new(move |side, _, frame| {
            if side == Side::Client && is(&frame, "service", SEND) && frame["args"]["x"] == 50.0 {
                let cancel = json!({"op": "call_service", "id": "proxy", "service": CANCEL, "args": {}});
                return vec![cancel, frame];
            }
            vec![frame]
        })
    }),
    planted("goal-3", "has a default for x", |_| {
        request(SEND, |args| {
            if !args["x"].is_number() {
                args["x"] = json!(1.0);
                args["y"] = json!(0.5);
            }
        })
    }),
    planted("goal-4", "takes epsilon 0 for its default", |_| request(SEND, |args| replace(args, "epsilon", &json!(0.0), &json!(0.02)))),
    planted("goal-4", "takes a negative success_hold for 0", |_| {
        request(SEND, |args| replace(args, "success_hold", &json!(-1.0), &json!(0.0)))
    }),
    planted("goal-5", "commands another pose", |_| topic(TRAJECTORY, |msg, _| add(&mut msg["points"][0]["positions"][0], 0.01))),
    planted("goal-5", "commands nothing", |_| without(|side, _, frame| side == Side::Server && is(frame, "topic", TRAJECTORY))),
    planted("goal-6", "has no elapsed", |_| topic(FEEDBACK, |msg, _| remove(msg, "elapsed"))),
    planted("goal-6", "elapsed does not run", |_| topic(FEEDBACK, |msg, _| msg["elapsed"] = json!(0.0))),
    planted("goal-7", "says reached", |_| topic(RESULT, |msg, _| msg["outcome"] = json!("reached"))),
    planted("goal-7", "has no target", |_| topic(RESULT, |msg, _| remove(msg, "target"))),
    planted("goal-8", "cancels nothing", |_| answer(CANCEL, |frame, _| frame["result"] = json!(true))),
    planted("goal-9", "ignores the id", |_| request(CANCEL, |args| remove(args, "goal_id"))),
    planted("goal-10", "publishes no result", |_| without(|side, _, frame| side == Side::Server && is(frame, "topic", RESULT))),
    planted("goal-11", "does not wait", |_| request(SEND, |args| args["success_hold"] = json!(0.0))),
    planted("goal-12", "waits all the same", |_| request(SEND, |args| args["success_hold"] = json!(5.0))),
    planted("goal-13", "publishes two results", |_| {
        twice(|side, frame| side == Side::Server && is(frame, "topic", RESULT) && is(frame, "op", "publish"))
    }),
    planted("trial-1", "skips nothing", |_| answer("/ik_trial/skip", |frame, _| frame["result"] = json!(true))),
    planted("trial-2", "has a duration of its own", |_| topic(STATUS, |msg, _| msg["duration"] = json!(30.0))),
    planted("trial-2", "publishes no status", |_| without(|side, _, frame| side == Side::Server && is(frame, "topic", STATUS))),
    planted("trial-3", "has no error", |_| topic(STATUS, |msg, _| remove(msg, "error"))),
    planted("trial-4", "has another target", |_| {
        topic(STATUS, |msg, _| {
            if msg["target"].is_object() {
                add(&mut msg["target"]["x"], 0.01);
            }
        })
    }),
    planted("trial-5", "keeps the target", |_| {
        topic(STATUS, |msg, _| {
            if msg["target"].is_object() {
                msg["target"] = json!({"x": 1.0, "y": 0.5, "phi": 0.0});
            }
        })
    }),
    planted("trial-5", "counts a skipped target", |_| topic(STATUS, |msg, _| msg["targets_reached"] = json!(1))),
    planted("trial-6", "leaves the action active", |_| topic(STATUS, |msg, _| msg["action_status"] = json!("active"))),
    planted("trial-6", "leaves the error", |_| topic(STATUS, |msg, _| msg["error"] = json!(0.5))),
    planted("trial-7", "does not end", |_| request("/ik_trial/start", |args| args["duration"] = json!(60.0))),
    planted("trial-7", "leaves desired_positions", |links| topic(STATUS, move |msg, _| msg["desired_positions"] = json!(vec![0.5; links]))),
    planted("trial-8", "does not count", |_| topic(STATUS, |msg, _| msg["targets_reached"] = json!(0))),
    planted("trial-9", "goes on counting", |_| {
        let memory = Memory::default();
        topic(STATUS, move |msg, _| {
            let most = memory.kept.take().as_u64().unwrap_or(0).max(msg["targets_reached"].as_u64().unwrap_or(0));
            msg["targets_reached"] = json!(most);
            memory.kept.set(json!(most));
        })
    }),
    planted("trial-10", "uses no goals", |_| without(|side, _, frame| side == Side::Server && is(frame, "topic", FEEDBACK))),
];

/// Moves a target away from the base or to it.
fn scale_target(args: &mut Value, by: f64) {
    for name in ["x", "y"] {
        let value = args[name].as_f64().unwrap_or(0.0);
        args[name] = json!(by * value);
    }
}
