//! "System architecture" and "Topics and services": the envelope of calls and messages.

use std::time::Duration;

use serde_json::{Value, json};

use crate::Check;
use crate::peer::is_response_to;
use crate::values::{member, must, text};

/// The checks of this part.
pub const CHECKS: &[Check] = &[
    ("envelope-1", |bench| {
        let answer = bench.peer.call("/arm_sim/set_params", &json!({}))?;
        let service = text(&answer.frame, "service")?;
        must(service == "/arm_sim/set_params", || format!("service {service}"))?;
        let id = answer.has_id()?.clone();
        bench.peer.call("/arm_sim/pause", &json!({}))?;
        let second = bench.peer.find(std::time::Instant::now() + Duration::from_millis(100), |frame| is_response_to(frame, &id));
        must(second.is_err(), || "a second response".to_owned())?;
        Ok(format!("one, with id {id}"))
    }),
    ("envelope-2", |bench| {
        for service in [
            "/arm_sim/set_params",
            "/arm_sim/set_integrator",
            "/arm_sim/pause",
            "/arm_sim/reset",
            "/pid_controller/enable",
            "/pid_controller/set_gains",
        ] {
            let frame = bench.peer.call(service, &json!({}))?.frame;
            must(member(&frame, "values")?.is_object(), || format!("{service}: values is no object"))?;
            must(frame.get("result") == Some(&Value::Bool(true)), || format!("{service}: result is not true"))?;
            text(&frame, "status")?;
        }
        Ok("all three, from 6 services".to_owned())
    }),
    ("envelope-3", |bench| {
        let answer = bench.rejected("/arm_sim/set_params", &json!({"gravity": -1}))?;
        answer.has_id()?;
        must(member(&answer.frame, "values")?.is_object(), || "values is no object".to_owned())?;
        Ok(answer.status)
    }),
    ("envelope-4", |bench| {
        let mut publisher = bench.another()?;
        bench.watch("/conformance/chatter")?;
        // The answer to a later call shows that the subscription is active.
        bench.peer.call("/arm_sim/pause", &json!({}))?;
        let msg = json!({"data": "hello"});
        publisher.peer.send(&json!({"op": "advertise", "topic": "/conformance/chatter", "type": "std_msgs/msg/String"}))?;
        publisher.peer.send(&json!({"op": "publish", "topic": "/conformance/chatter", "msg": msg}))?;
        let came = bench.message("/conformance/chatter", Duration::from_secs(2))?;
        must(came == msg, || came.to_string())?;
        Ok(came.to_string())
    }),
    ("envelope-5", |bench| {
        let mut other = bench.another()?;
        bench.watch("/joint_states")?;
        other.watch("/joint_states")?;
        bench.joints()?;
        other.joints()?;
        Ok("messages on both".to_owned())
    }),
    ("envelope-6", |bench| {
        bench.fresh()?;
        bench.peer.send(&json!({"op": "unsubscribe", "topic": "/joint_states", "id": "watch /joint_states"}))?;
        bench.peer.send(&json!({"op": "unsubscribe", "topic": "/joint_states"}))?;
        bench.peer.call("/arm_sim/pause", &json!({}))?;
        std::thread::sleep(Duration::from_millis(50));
        bench.peer.call("/arm_sim/pause", &json!({}))?;
        bench.forget("/joint_states");
        let later = bench.messages_for("/joint_states", Duration::from_millis(400))?;
        must(later.is_empty(), || format!("{} messages", later.len()))?;
        Ok("none".to_owned())
    }),
    ("envelope-7", |bench| {
        let mut other = bench.another()?;
        for line in ["{\"op\": \"call_service\", ", "[1, 2]", "{}", "no JSON at all"] {
            // The server may close this connection.
            let _ = other.peer.send_line(line);
        }
        // An answer or the end of that connection shows that the server has read the lines.
        let _ = other.peer.call("/arm_sim/set_params", &json!({}));
        bench.accepted("/arm_sim/set_params", &json!({}))?;
        Ok("an answer".to_owned())
    }),
];
